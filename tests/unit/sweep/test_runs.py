"""Whole sweeps: the same rows from every executor, and after every interruption."""

import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import sweep_work
from raccoon.core.errors import ConfigError
from raccoon.sweep.execute import Crew
from raccoon.sweep.results import read_results
from raccoon.sweep.runs import sweep, with_nominal_end
from sweep_work import tiny_match

TESTS = Path(sweep_work.__file__).parent


class AtOnce(Executor):
    """Runs each call when it is handed over."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_rows_depend_on_seed_and_number_alone() -> None:
    rows = sweep(tiny_match(), 6, seed=4, executor=AtOnce())
    assert [row["run"] for row in rows] == list(range(6))
    assert len({row["seed"] for row in rows}) == 6
    assert len({row["x"] for row in rows}) == 6
    with ThreadPoolExecutor(3) as threads:
        assert_same(rows, sweep(tiny_match(), 6, seed=4, executor=threads))
        assert_same(rows[:4], sweep(tiny_match(), 4, seed=4, executor=threads))
        assert rows[0]["x"] != sweep(tiny_match(), 1, seed=5, executor=threads)[0]["x"]


def assert_same(rows: list[dict[str, Any]], others: list[dict[str, Any]]) -> None:
    assert [repr(row) for row in rows] == [repr(row) for row in others]  # NaN is as NaN


def killed(out: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(TESTS / "sweep_work.py"), str(out)], capture_output=True, check=False
    )
    assert done.returncode == -signal.SIGKILL, done.stderr


def interrupted(out: Path) -> None:
    def leave(played: int, *_: int) -> None:
        if played == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ThreadPoolExecutor(1) as threads:
        sweep(tiny_match(), 8, seed=4, executor=threads, out=out, progress=leave)


@pytest.mark.parametrize("ended", [killed, interrupted])
def test_after_an_interruption_it_ends_with_the_same_table(
    tmp_path: Path, ended: Callable[[Path], None]
) -> None:
    cut, whole = tmp_path / "cut.csv", tmp_path / "whole.csv"
    ended(cut)
    before = read_results(cut)
    assert len(before) == 3
    played: list[int] = []
    with ThreadPoolExecutor(1) as threads:
        match = tiny_match()
        sweep(match, 8, seed=4, executor=threads, out=cut, progress=lambda count, *_: played.append(count))
        sweep(match, 8, seed=4, executor=threads, out=whole)
    assert played == [4, 5, 6, 7, 8]
    assert cut.read_bytes() == whole.read_bytes()


def test_a_finished_sweep_is_not_played_again_and_can_be_made_longer(tmp_path: Path) -> None:
    out = tmp_path / "r.csv"
    first = sweep(tiny_match(), 2, executor=AtOnce(), out=out)
    assert_same(sweep(tiny_match(), 2, executor=ThreadPoolExecutor(1), out=out), first)
    assert_same(sweep(tiny_match(), 3, executor=AtOnce(), out=out)[:2], first)
    assert_same(sweep(tiny_match(), 1, executor=AtOnce(), out=out), first[:1])
    assert len(read_results(out)) == 3


def test_only_the_matches_that_are_wanted_are_counted(tmp_path: Path) -> None:
    out = tmp_path / "r.csv"
    sweep(tiny_match(), 4, executor=AtOnce(), out=out)
    header, _, *others = out.read_text("utf-8").splitlines(keepends=True)
    out.write_text("".join([header, *others]), encoding="utf-8")
    seen: list[tuple[int, int, int]] = []
    sweep(tiny_match(), 2, executor=AtOnce(), out=out, progress=lambda *counts: seen.append(counts))
    assert seen == [(2, 2, 0)]


def test_another_program_does_not_go_on_in_the_file(tmp_path: Path) -> None:
    out = tmp_path / "r.csv"
    sweep(tiny_match(), 1, executor=AtOnce(), out=out)
    with pytest.raises(ConfigError, match="another text of the program"):
        sweep(tiny_match("mission = print"), 1, executor=AtOnce(), out=out)


def test_the_goal_is_where_the_nominal_robot_ends() -> None:
    match = with_nominal_end(tiny_match())
    rows = sweep(match, 3, executor=AtOnce())
    assert all(row["position_error"] < 0.05 and row["status"] == "ok" for row in rows)
    strict = sweep(match.ending_at((1.0, 0.0, 0.0)), 2, executor=AtOnce())
    assert [row["reason"] for row in strict] == ["ended more than 0.05 m off"] * 2


class Dying(Executor):
    """Its workers die of each call."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_exception(BrokenExecutor())
        return future


def test_a_program_that_ends_its_process_is_said_to_do_so_on_the_nominal_robot() -> None:
    """It ended the sweep with it, without a word and with status 0."""
    with pytest.raises(ConfigError, match="on the nominal robot already: it ends its process"):
        with_nominal_end(tiny_match(), Crew(Dying, 1))
    assert with_nominal_end(tiny_match(), Crew(AtOnce, 1)) == with_nominal_end(tiny_match())


def test_a_number_of_runs_is_asked_for() -> None:
    with pytest.raises(ConfigError, match="runs is 0"):
        sweep(tiny_match(), 0)
    with pytest.raises(ConfigError, match=r"runs is 10{20}: allowed are numbers from 1 to 10000000"):
        sweep(tiny_match(), 10**20)


def test_a_seed_is_not_negative(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="seed is -1: allowed are whole numbers from 0"):
        sweep(tiny_match(), 1, seed=-1, out=tmp_path / "r.csv")
    assert not list(tmp_path.iterdir())
