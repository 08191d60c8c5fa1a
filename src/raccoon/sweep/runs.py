"""A sweep: many matches, each from its own seed, into one table."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import AbstractContextManager, closing, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from raccoon.core.errors import ConfigError
from raccoon.sweep.execute import Crew, run_all
from raccoon.sweep.match import Match, columns, crashed_row, nominal_end, play, seed_of
from raccoon.sweep.results import Results, Row, check_table
from raccoon.sweep.workers import CALLS_PER_WORKER, process_crew

MAX_RUNS = 10_000_000
Progress = Callable[[int, int, int], None]
"""Called with the numbers of matches played, wanted and failed."""


def sweep(
    match: Match,
    runs: int,
    *,
    seed: int = 0,
    executor: Executor | AbstractContextManager[Crew] | None = None,
    workers: int | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Play runs 0 to runs - 1 of a match and return their rows in that order.

    The seed of each run follows from `seed` and its number, so a row depends neither on the executor nor on
    the order. executor: any concurrent.futures executor (it stays open), a crew of `sweep.workers`, or None
    for processes on this computer. workers: the number of these processes, or of matches that your executor
    plays at once. out: a .csv or .parquet that gets each row as its match ends. If it has rows of this sweep
    already, they are kept and only the others are played; rows of another sweep are a ConfigError.
    """
    check_sweep(runs, seed, out)
    crew = _open_crew(executor, workers)
    if out is None:
        unwritten = _RowsInMemory()
        _play_missing(unwritten, match, seed, runs, crew, progress)
        return [unwritten.rows[run] for run in range(runs)]
    with closing(Results(out, columns(match), description(match, seed))) as results:
        _play_missing(results, match.ending_at(results.about["end"]), seed, runs, crew, progress)
        results.finish()
        return [results.rows[run] for run in range(runs)]


def check_sweep(runs: int, seed: int, out: str | Path | None) -> None:
    """Raise ConfigError for a number of runs, a seed or a table that is not allowed, before any work."""
    if not 1 <= runs <= MAX_RUNS:
        raise ConfigError(f"runs is {runs}: allowed are numbers from 1 to {MAX_RUNS}")
    seed_of(seed, 0)
    if out is not None:
        check_table(Path(out))


class _RowsInMemory:
    """Rows by run without a file."""

    def __init__(self) -> None:
        self.rows: dict[int, Row] = {}

    def add(self, row: Row) -> None:
        self.rows[row["run"]] = row


def _play_missing(
    kept: Results | _RowsInMemory,
    match: Match,
    seed: int,
    runs: int,
    opened: AbstractContextManager[Crew],
    progress: Progress | None,
) -> None:
    missing = [run for run in range(runs) if run not in kept.rows]
    if not missing:
        return
    # A file may hold more matches than are wanted now.
    played = runs - len(missing)
    failed = sum(row["status"] != "ok" for run, row in kept.rows.items() if run < runs)
    with opened as crew:
        for _, row in run_all(
            partial(_play_run, match, seed), missing, crew, partial(_lost_run, match, seed)
        ):
            kept.add(row)
            played += 1
            failed += row["status"] != "ok"
            if progress is not None:
                progress(played, runs, failed)


def _open_crew(
    executor: Executor | AbstractContextManager[Crew] | None, workers: int | None
) -> AbstractContextManager[Crew]:
    if executor is None:
        return process_crew(workers)
    if isinstance(executor, Executor):
        return nullcontext(Crew(executor, CALLS_PER_WORKER * (workers or _worker_count(executor))))
    return executor


def _worker_count(executor: Executor) -> int:
    """The number of calls that an executor runs at once, as far as it says so."""
    size = getattr(executor, "_max_workers", None)
    return size if isinstance(size, int) and size > 0 else 4


def _play_run(match: Match, seed: int, run: int) -> Row:
    return play(match, run, seed_of(seed, run))


def _lost_run(match: Match, seed: int, run: int) -> Row:
    return crashed_row(match, run, seed_of(seed, run))


def description(match: Match, seed: int) -> dict[str, Any]:
    """The description that a table must match to be continued, as JSON."""
    model = match.model
    return {
        "program": match.program.name,
        "text of the program": match.program.digest,
        "robot": _digest(match.robot),
        **({} if model is None else {"model": _digest((model.robot, model.effects, model.chain))}),
        "table": _digest(match.world),
        "start": list(match.start),
        "sensors": [repr(match.chain), match.imu_rate_hz],
        "seed": seed,
        "factors": [[each.name, each.low, each.high, each.normal] for each in match.factors],
        "limits": [match.within, match.within_angle, match.seconds],
        "end": None if match.end is None else list(match.end),
    }


def _digest(what: object) -> str:
    return hashlib.sha256(repr(what).encode()).hexdigest()


def with_nominal_end(match: Match, crew: Crew | None = None) -> Match:
    """The match with the nominal robot's end as its goal. Raises ConfigError. crew: where that robot plays;
    None means this process, which a program that ends its process then ends too."""
    if crew is None:
        return match.ending_at(nominal_end(match))
    ((_, end),) = run_all(partial(_play_nominal, match), (0,), crew, partial(_nominal_crashed, match))
    return match.ending_at(end)


def _play_nominal(match: Match, _: int) -> tuple[float, float, float]:
    return nominal_end(match)


def _nominal_crashed(match: Match, _: int) -> NoReturn:
    raise ConfigError(
        f"{match.program.name} fails on the nominal robot already: it ends its process (os._exit, a bare "
        "except in an endless loop, or a library that crashed)"
    )
