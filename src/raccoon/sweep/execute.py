"""Many calls on an executor: every number gets exactly one result, whatever becomes of the workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from typing import TypeVar

Result = TypeVar("Result")
Work = Callable[[int], Result]
TRIES = 2
"""Times that a call may take its worker down, alone, before it is given up."""


class Crew:
    """Gives an executor, and a new one after its workers died.

    open: makes one. window: how many calls are handed to it at once.
    """

    def __init__(self, open_executor: Callable[[], Executor], window: int) -> None:
        if window < 1:
            raise ValueError(f"window is {window}: at least one call must be under way")
        self._open = open_executor
        self.window = window
        self.executor = open_executor()

    def renew(self) -> None:
        """A new executor in place of one that broke."""
        self.executor.shutdown(wait=False, cancel_futures=True)
        self.executor = self._open()

    def close(self) -> None:
        """Give up what is not running yet and let the workers go."""
        self.executor.shutdown(wait=True, cancel_futures=True)


def run_all(
    work: Work[Result],
    numbers: Iterable[int],
    crew: Crew,
    give_up: Callable[[int], Result],
) -> Iterator[tuple[int, Result]]:
    """(number, result) of every number, in the order in which they are done.

    A call whose worker died is made again. When a pool breaks, any of the calls under way can be the cause,
    so they are repeated one at a time; a number that then takes its worker down `TRIES` times gets the
    result of `give_up`. What a call raises by itself comes through.
    """
    waiting = deque(numbers)
    suspects: deque[int] = deque()
    while waiting or suspects:
        if suspects:
            number = suspects.popleft()
            yield number, _alone(work, number, crew, give_up)
        else:
            yield from _together(work, waiting, suspects, crew)


def _together(
    work: Work[Result], waiting: deque[int], suspects: deque[int], crew: Crew
) -> Iterator[tuple[int, Result]]:
    """Work through `waiting` until it is empty or the workers die; then all under way are suspects."""
    running: dict[Future[Result], int] = {}
    try:
        while waiting or running:
            while waiting and len(running) < crew.window:
                running[crew.executor.submit(work, waiting[0])] = waiting[0]
                waiting.popleft()
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                number = running[future]
                result = future.result()
                del running[future]
                yield number, result
    except BaseException as error:
        if not is_loss(error):
            for future in running:
                future.cancel()
            raise
        yield from _survivors(running, suspects)
        crew.renew()


def _survivors(running: dict[Future[Result], int], suspects: deque[int]) -> Iterator[tuple[int, Result]]:
    """Results that arrived before the workers died; the rest must be made again."""
    for future, number in running.items():
        if future.done() and not future.cancelled() and future.exception() is None:
            yield number, future.result()
        else:
            future.cancel()
            suspects.append(number)


def _alone(work: Work[Result], number: int, crew: Crew, give_up: Callable[[int], Result]) -> Result:
    for _ in range(TRIES):
        try:
            return crew.executor.submit(work, number).result()
        except BaseException as error:
            if not is_loss(error):
                raise
            crew.renew()
    return give_up(number)


def is_loss(error: BaseException) -> bool:
    """Whether an error says that a worker died, and not that the call failed."""
    # Dask's error by name: importing it to ask would need the package.
    names = {kind.__name__ for kind in type(error).__mro__}
    return isinstance(error, BrokenExecutor | CancelledError) or bool(
        names & {"KilledWorker", "CancelledError"}
    )
