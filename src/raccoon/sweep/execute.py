"""Many calls on an executor: every number gets exactly one result, whatever happens to the workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import TypeVar

Result = TypeVar("Result")
Work = Callable[[int], Result]
MAX_TRIES = 2
"""How many times a call may crash its worker, alone, before it is given up."""


class Crew:
    """An executor, and a replacement after its workers died if it can be opened anew.

    executor: an open one, or a function that opens one. window: how many calls are handed to it at once. Only
    an executor that was opened here is closed here.
    """

    def __init__(self, executor: Executor | Callable[[], Executor], window: int) -> None:
        if window < 1:
            raise ValueError(f"window is {window}: allowed are whole numbers from 1")
        self._open = None if isinstance(executor, Executor) else executor
        self.window = window
        self.executor = executor if isinstance(executor, Executor) else executor()

    def renew(self) -> None:
        """Open a new executor in place of a broken one. Raises BrokenExecutor if none can be opened."""
        if self._open is None:
            raise BrokenExecutor(
                "the given executor broke; open another and run the sweep again: it continues where it"
                " stopped"
            )
        self.executor.shutdown(wait=False, cancel_futures=True)
        self.executor = self._open()

    def close(self) -> None:
        """Close the executor if it was opened here."""
        if self._open is not None:
            self.executor.shutdown(wait=True, cancel_futures=True)


def run_all(
    work: Work[Result],
    numbers: Iterable[int],
    crew: Crew,
    failed_result: Callable[[int], Result],
) -> Iterator[tuple[int, Result]]:
    """Yield (number, result) of every number, in the order of completion.

    A call whose worker died is repeated. When a pool breaks, any of the running calls can be the cause, so
    they are repeated one at a time; a number that then crashes its worker `MAX_TRIES` times gets what
    `failed_result` returns. Errors that a call raises are passed on, and so is a broken executor that cannot
    be opened anew.
    """
    waiting = deque(numbers)
    suspects: deque[int] = deque()
    while waiting or suspects:
        if suspects:
            number = suspects.popleft()
            yield number, _run_alone(work, number, crew, failed_result)
        else:
            yield from _run_concurrently(work, waiting, suspects, crew)


def _run_concurrently(
    work: Work[Result], waiting: deque[int], suspects: deque[int], crew: Crew
) -> Iterator[tuple[int, Result]]:
    """Run the calls of `waiting` until it is empty or the pool breaks; then all running ones are suspects."""
    running: dict[Future[Result], int] = {}
    try:
        while waiting or running:
            _submit_waiting(work, waiting, running, crew)
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                if _lost_worker(future):
                    suspects.append(running.pop(future))
                else:
                    result = future.result()
                    yield running.pop(future), result
    except BrokenExecutor:
        yield from _collect_finished(running, suspects)
        crew.renew()
    finally:
        for future in running:
            future.cancel()


def _submit_waiting(
    work: Work[Result], waiting: deque[int], running: dict[Future[Result], int], crew: Crew
) -> None:
    while waiting and len(running) < crew.window:
        running[crew.executor.submit(work, waiting[0])] = waiting[0]
        waiting.popleft()


def _collect_finished(
    running: dict[Future[Result], int], suspects: deque[int]
) -> Iterator[tuple[int, Result]]:
    """Results that arrived before the pool broke; the other calls must be repeated."""
    for future, number in running.items():
        if future.done() and not future.cancelled() and future.exception() is None:
            yield number, future.result()
        else:
            suspects.append(number)


def _run_alone(work: Work[Result], number: int, crew: Crew, failed_result: Callable[[int], Result]) -> Result:
    for _ in range(MAX_TRIES):
        try:
            future = crew.executor.submit(work, number)
            wait((future,))
            if not _lost_worker(future):
                return future.result()
        except BrokenExecutor:
            crew.renew()
    return failed_result(number)


def _lost_worker(future: Future[Result]) -> bool:
    """Whether a finished call failed because its worker died, while the executor itself goes on."""
    if future.cancelled():
        return False
    # Dask's error by name: importing it to ask would need the package. It comes after several deaths.
    return any(kind.__name__ == "KilledWorker" for kind in type(future.exception()).__mro__)
