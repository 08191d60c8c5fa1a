"""The steps of an action: a generator that yields nothing, once a tick, and whose value is its result."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Generator
from typing import Any, TypeVar

T = TypeVar("T")
Steps = Generator[None, None, T]


def checked_steps(steps: Steps[T], name: str, start: Callable[..., object]) -> Steps[T]:
    """The generator that `start` of the action `name` returned. Raises TypeError if it returned anything
    else."""
    given: object = steps
    if inspect.isgenerator(given):
        return steps
    hint = (
        "it must be a function that yields once a tick; for a function that returns at once "
        "write do(function)"
    )
    if inspect.iscoroutine(given) or inspect.isasyncgen(given):
        if inspect.iscoroutine(given):
            given.close()
        hint = "write def instead of async def, and yield once a tick instead of await"
    elif hasattr(given, "start"):
        hint = "return its steps, .start(robot), or return it from the function of a do()"
    function = getattr(start, "__name__", "its start")
    raise TypeError(f"action '{name}': {function} returns {given!r} instead of steps: {hint}")


def advance(steps: Steps[Any]) -> None:
    """One tick of an action's generator. Raises StopIteration at its end, and TypeError if it yields a value,
    which nobody would use."""
    given: object = next(steps)
    if given is not None:
        yields: Any = steps
        while inspect.isgenerator(inner := yields.gi_yieldfrom):
            yields = inner
        raise TypeError(
            f"the steps of {yields.__name__} yield {given!r}, but what is yielded is not run: write a bare "
            "yield to wait for the next tick, and yield from action.start(robot) to run an action"
        )


def close(steps: Steps[Any]) -> None:
    """Close an action's generator. If it catches that and goes on, it is reported, without hiding another
    error."""
    try:
        steps.close()
    except RuntimeError as error:
        if "ignored GeneratorExit" not in str(error):
            raise
        import logging

        said = (
            "the steps of an action go on after they were ended: a bare except catches that; write "
            "except Exception"
        )
        logging.getLogger("raccoon").warning(said)


def run_while(steps: Steps[T], goes_on: Callable[[], bool]) -> Steps[tuple[T] | None]:
    """Run `steps` while `goes_on` is true before each of their ticks; their result, or None if they were
    ended."""
    try:
        while goes_on():
            try:
                advance(steps)
            except StopIteration as end:
                return (end.value,)
            yield
        return None
    finally:
        close(steps)
