"""Workers that play matches: processes on this computer, or a Dask cluster."""

from __future__ import annotations

import gc
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_one
from multiprocessing.resource_tracker import ensure_running
from typing import Any

from raccoon.core.cpu_count import usable_cores
from raccoon.core.errors import ConfigError
from raccoon.core.extras import install
from raccoon.sweep.execute import Crew

CALLS_PER_WORKER = 2
"""Calls handed out per worker: one to run, one to continue with."""
THREADS = "OMP_NUM_THREADS"
"""Environment variable with the number of threads for linear algebra; the simulator keeps to it."""


class _Processes(ProcessPoolExecutor):
    """Workers ignore Ctrl-C from their start on: one that is still loading would print its own traceback. A
    process is started by a call that finds no idle one, and inherits the signals that are blocked
    meanwhile."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        with _without_ctrl_c():
            return super().submit(fn, *args, **kwargs)


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Threads and processes that start inside the block never receive Ctrl-C, which is for the sweep."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def process_crew(workers: int | None) -> Iterator[Crew]:
    """Processes on this computer, by default one per core. Raises ConfigError.

    At the end of the block they end at once, whatever they are doing: a running call may take minutes, and a
    thread that a program left behind may run for ever.
    """
    count = _checked_count(workers, usable_cores())
    spawn = multiprocessing.get_context("spawn")
    ends, held = spawn.Pipe(duplex=False)

    def pool() -> Executor:
        return _Processes(count, spawn, initializer=_begin_worker, initargs=(ends,))

    crew = Crew(pool, CALLS_PER_WORKER * count)
    try:
        with _one_thread_each() if count > 1 else nullcontext():
            yield crew
    finally:
        held.close()
        crew.close()
        ends.close()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Limit processes that start inside the block to one thread: a second would only wait for the other
    workers. A user's own setting stays."""
    if THREADS in os.environ:
        yield
        return
    os.environ[THREADS] = "1"
    try:
        yield
    finally:
        del os.environ[THREADS]


@contextmanager
def dask_crew(scheduler: str | None, workers: int | None = None) -> Iterator[Crew]:
    """The workers of a Dask scheduler, by default of one that is started on this computer.

    workers: number of processes to start, or with a given scheduler the number of matches to keep running (by
    default for the threads it has). Raises ConfigError if Dask is missing or no scheduler answers.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise ConfigError(f"--executor dask needs Dask: {install('cluster')}") from None
    if scheduler is None:
        count = _checked_count(workers, usable_cores())
        ensure_running()  # where it has to begin first, it lets the thread that needs it hear again
        with (
            _without_ctrl_c()
        ):  # the thread that starts the workers, and those in place of dead ones, begins here
            local = LocalCluster(
                n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
            )
        with local as cluster, Client(cluster) as client:
            yield Crew(_executor(client), CALLS_PER_WORKER * count)
        return
    client = failed = None
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError, TimeoutError) as error:
        failed = str(error)
    if client is None:
        # The half-made client closes itself when it is collected, which takes a lock of Dask's for all
        # clients: now, and not at a moment at which that lock is held.
        gc.collect()
        raise ConfigError(f"scheduler {scheduler!r}: it does not answer: {failed}")
    with client:
        count = _checked_count(workers, max(1, sum(client.nthreads().values())))
        yield Crew(_executor(client), CALLS_PER_WORKER * count)


def _executor(client: object) -> Executor:
    # Not pure: Dask would hand out the old result of a call that it takes for the same.
    executor: Executor = client.get_executor(pure=False)  # type: ignore[attr-defined]
    return executor


def _checked_count(workers: int | None, usual: int) -> int:
    if workers is None:
        return usual
    if not 1 <= workers <= 4096:
        raise ConfigError(f"workers is {workers}: allowed are numbers from 1 to 4096")
    return workers


def _begin_worker(ends: Connection) -> None:
    """Prepare a worker: it ignores Ctrl-C, which is for the sweep, and does not outlive a sweep that is
    killed. ends: closed at the other side, by the sweep or by its death, when the worker must end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def follow() -> None:
        wait_for_one([ends])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
