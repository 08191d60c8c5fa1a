"""Every call gives one result, whatever becomes of the workers."""

import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from raccoon.core.errors import ConfigError
from raccoon.sweep.execute import Crew, run_all
from raccoon.sweep.workers import process_crew
from sweep_calls import (
    always_kills_its_worker,
    kills_its_worker_once,
    leaves_a_thread,
    sleeps_for_long,
    squared,
)


def nothing(number: int) -> int:
    return -number


class Breaking(Executor):
    """Runs calls at once; the call with `fatal` breaks it for good."""

    opened = 0

    def __init__(self, fatal: int) -> None:
        type(self).opened += 1
        self._fatal = fatal
        self._broken = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self._broken:
            raise BrokenExecutor("broken")
        future: Future[Any] = Future()
        if args[0] == self._fatal:
            self._broken = True
            future.set_exception(BrokenExecutor("broken"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


class KilledWorker(Exception):
    """As Dask's: workers died under a call, and the others go on."""


class Losing(Executor):
    """Runs calls at once; the call with `fatal` takes its worker down each time."""

    def __init__(self, fatal: int) -> None:
        self._fatal, self.asked = fatal, 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if args[0] == self._fatal:
            self.asked += 1
            future.set_exception(KilledWorker("three of them"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def test_on_threads() -> None:
    with ThreadPoolExecutor(3) as threads:
        found = list(run_all(squared, range(50), Crew(threads, 6), nothing))
    assert sorted(found) == [(number, number**2) for number in range(50)]


def test_a_broken_pool_is_replaced_and_only_the_guilty_call_given_up() -> None:
    Breaking.opened = 0
    found = list(run_all(squared, range(10), Crew(lambda: Breaking(4), 3), nothing))
    assert sorted(found) == sorted([(n, n**2) for n in range(10) if n != 4] + [(4, -4)])
    assert Breaking.opened == 4  # at first, after it broke, and after each of two tries alone


def test_a_call_that_takes_workers_down_is_given_up_while_the_others_go_on() -> None:
    executor = Losing(4)
    found = list(run_all(squared, range(10), Crew(executor, 3), nothing))
    assert sorted(found) == sorted([(n, n**2) for n in range(10) if n != 4] + [(4, -4)])
    assert executor.asked == 3  # among others, and twice alone


def test_a_broken_pool_from_outside_is_said_so() -> None:
    seen: list[int] = []
    found = (number for number, _ in run_all(squared, range(10), Crew(Breaking(4), 3), nothing))
    with pytest.raises(BrokenExecutor, match="continues where it stopped"):
        seen.extend(found)
    assert len(seen) == len(set(seen))
    assert 4 not in seen


def test_an_error_of_the_call_comes_through() -> None:
    with ThreadPoolExecutor(2) as threads, pytest.raises(ZeroDivisionError):
        list(run_all(lambda number: 1 // (number - 2), range(5), Crew(threads, 2), nothing))


def test_a_worker_process_that_is_killed_loses_nothing(tmp_path: Path) -> None:
    with process_crew(2) as crew:
        once = list(run_all(partial(kills_its_worker_once, str(tmp_path)), range(8), crew, nothing))
        always = list(run_all(always_kills_its_worker, range(4), crew, nothing))
    assert sorted(once) == [(number, number**2) for number in range(8)]
    assert (tmp_path / "killed").exists()
    assert sorted(always) == [(0, 0), (1, 1), (2, -2), (3, 9)]


def test_what_is_under_way_ends_with_an_interruption(tmp_path: Path) -> None:
    begun = tmp_path / "begun"

    def interrupted() -> None:
        with process_crew(1) as crew:
            crew.executor.submit(sleeps_for_long, str(begun))
            while not begun.exists():
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.time() - begun.stat().st_mtime < 20.0  # of 60


def test_what_a_program_left_running_holds_nobody_up() -> None:
    with process_crew(1) as crew:
        assert sorted(run_all(leaves_a_thread, range(2), crew, nothing)) == [(0, 0), (1, 1)]
        begun = time.monotonic()
    assert time.monotonic() - begun < 20.0  # of 60


def test_numbers_of_workers_are_checked() -> None:
    for count in (0, -1, 5000):
        with pytest.raises(ConfigError, match=f"workers is {count}: allowed"), process_crew(count):
            pass
    with pytest.raises(ValueError, match="window is 0"):
        Crew(lambda: Breaking(0), 0)


def test_a_worker_among_others_has_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with process_crew(2) as crew:
        assert crew.executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert "OMP_NUM_THREADS" not in os.environ
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with process_crew(2) as crew:
        assert crew.executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "3"


def test_a_worker_hears_no_interruption_from_its_start_on() -> None:
    with process_crew(2) as crew:
        asked = [crew.executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()) for _ in range(4)]
        held = [each.result() for each in asked]
    assert all(signal.SIGINT in each for each in held)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
