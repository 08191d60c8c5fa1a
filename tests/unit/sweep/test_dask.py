"""A real scheduler with workers in other processes, one of which is killed in the middle of it."""

import gc
import os
import signal
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from raccoon.core.errors import ConfigError
from raccoon.sweep.execute import run_all
from raccoon.sweep.workers import dask_crew
from sweep_calls import kills_its_worker_once


def test_a_killed_worker_loses_nothing_and_nothing_counts_twice(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        workers = set(client.run(os.getpid).values())
        assert len({*workers, os.getpid()}) == 3
        with dask_crew(cluster.scheduler_address) as crew:
            found = list(run_all(partial(kills_its_worker_once, str(tmp_path)), range(8), crew, int))
        assert len(workers & set(client.run(os.getpid).values())) == 1
    assert sorted(found) == [(number, number**2) for number in range(8)]


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
