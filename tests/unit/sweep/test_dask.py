"""A real scheduler with workers in other processes, one of which is killed in the middle of it."""

import gc
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from raccoon.core.errors import ConfigError
from raccoon.sweep.results import read_results
from raccoon.sweep.runs import sweep
from raccoon.sweep.workers import dask_crew
from sweep_work import tiny_match

RUNS = 16


def test_a_killed_worker_loses_nothing_and_nothing_counts_twice(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = list(client.run(os.getpid).values())
        assert len({*workers, os.getpid()}) == 3
        played = []

        def kill_one(count: int, _total: int, _failed: int) -> None:
            played.append(count)
            if count == 3:
                os.kill(workers[0], signal.SIGKILL)

        crew = dask_crew(cluster.scheduler_address)
        rows = sweep(tiny_match(), RUNS, seed=4, executor=crew, out=tmp_path / "r.csv", progress=kill_one)
        assert workers[0] not in client.run(os.getpid).values()
    assert played == list(range(1, RUNS + 1))
    with ThreadPoolExecutor(1) as threads:
        others = sweep(tiny_match(), RUNS, seed=4, executor=threads, out=tmp_path / "other.csv")
    assert repr(rows) == repr(others)  # NaN is as NaN
    assert [row["run"] for row in read_results(tmp_path / "r.csv")] == list(range(RUNS))
    assert (tmp_path / "r.csv").read_bytes() == (tmp_path / "other.csv").read_bytes()


def test_workers_that_are_started_here_hear_no_interruption() -> None:
    """Each of them answered Ctrl-C, which is for the sweep, with a traceback of its own."""
    pytest.importorskip("distributed")
    with dask_crew(None, 1) as crew:
        held = crew.executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result()
    assert signal.SIGINT in held
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_an_address_that_is_none_is_refused_and_no_half_made_client_is_left() -> None:
    client = pytest.importorskip("distributed").Client
    before = _living(client)  # other tests', still closing
    with pytest.raises(ConfigError, match=r"scheduler 'nowhere:x'") as caught, dask_crew("nowhere:x"):
        pass
    assert caught.value.__context__ is None  # which would hold it
    left = [each for each in _living(client) if not any(each is other for other in before)]
    assert [each.status for each in left if each.status != "closed"] == []


def _living(kind: type[Any]) -> list[Any]:
    """What there is of a class; by its type, since `isinstance` asks the referent of a dead weak proxy."""
    return [each for each in gc.get_objects() if issubclass(type(each), kind)]
