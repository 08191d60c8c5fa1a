"""The type of conditions: something that can become true, composed with `&`, `|` and `~`.

A condition is a recipe like an action: its reference (a time, a place, a heading) is taken when the action
starts.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from raccoon.core.port import Bystander, bystander_of
from raccoon.robot.actions.limits import check_kind

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

Test = Callable[[], bool]
Check = Callable[["Robot"], object]
"""Raises an error if something cannot be used on a robot, before it is used."""
JOIN = "; when(lambda robot: ...) makes a condition of any test"


class Condition:
    """Something that can become true. Compose with `&`, `|` and `~`.

    name: for messages. start: called when the action starts; makes the test that is called once a tick.
    opposed: makes the test that `~` negates, for conditions whose `start` ignores what holds already. check:
    raises an error for anything that is known to be wrong on this robot, such as a name that robot.toml does
    not have. asks: what a program that waits for this condition alone needs from the bystander of a simulated
    robot.
    """

    name = "a condition of your own"
    _check: Check | None = None
    _start_negated: Callable[[Robot], Test] | None = None
    _ask_simulation: Callable[[Bystander], None] | None = None

    def __init__(
        self,
        name: str,
        start: Callable[[Robot], Test],
        *,
        opposed: Callable[[Robot], Test] | None = None,
        check: Check | None = None,
        asks: Callable[[Bystander], None] | None = None,
    ) -> None:
        if not callable(start):
            raise TypeError(
                f"condition '{name}': start is {start!r}: it must be a function(robot) that returns a test"
            )
        self.name = name
        self._start = start
        self._start_negated = opposed
        self._check = check
        self._ask_simulation = asks

    def check(self, robot: Robot) -> None:
        """Raise an error if this condition cannot be tested on `robot`, such as for a name that robot.toml
        does not have."""
        if self._check is not None:
            self._check(robot)

    def start(self, robot: Robot) -> Test:
        """The test for one run of an action. Raises TypeError if the condition has none."""
        test: object = self._start(robot)
        if not callable(test):
            raise TypeError(
                f"condition '{self.name}': its start returns {test!r}: it must return a test, a function "
                "that is called once a tick; for a plain test write when(lambda robot: ...)"
            )
        return test

    def ask(self, robot: Robot) -> None:
        """Ask the bystander of a simulated robot to make the condition true."""
        if self._ask_simulation is not None and (somebody := bystander_of(robot.port)) is not None:
            self._ask_simulation(somebody)

    def start_negated(self, robot: Robot) -> Test:
        """The test that `~` negates, for one run of an action."""
        return (self._start_negated or self.start)(robot)

    def __and__(self, other: Condition) -> Condition:
        check_kind(other, Condition, "&", JOIN)
        return _combine(self, other, f"({self.name} and {other.name})", all)

    def __or__(self, other: Condition) -> Condition:
        check_kind(other, Condition, "|", JOIN)
        return _combine(self, other, f"({self.name} or {other.name})", any)

    def __invert__(self) -> Condition:
        def inverted(test: Test) -> Test:
            return lambda: not test()

        return Condition(
            f"not {self.name}",
            lambda robot: inverted(self.start_negated(robot)),
            opposed=lambda robot: inverted(self.start(robot)),
            check=self.check,
        )

    def __bool__(self) -> bool:
        raise TypeError(
            f"condition '{self.name}' is neither true nor false: combine conditions with & | ~, not "
            "and/or/not"
        )

    def __repr__(self) -> str:
        return f"<Condition {self.name}>"


def checked_truth(told: object, name: str) -> bool:
    """The truth of what a test of the condition `name` returned where that is not a bool. Raises TypeError
    for a function, which was not called and would count as true at once."""
    if inspect.isroutine(told):
        raise TypeError(f"condition '{name}': its test returns {told.__name__} without calling it")
    return bool(told)


def _combine(
    first: Condition, second: Condition, name: str, combine: Callable[[tuple[bool, bool]], bool]
) -> Condition:
    def joined(one: Test, other: Test) -> Test:
        # Both are asked every tick, so that a condition with a memory (over_line) sees all of the drive.
        return lambda: combine((one(), other()))

    return Condition(
        name,
        lambda robot: joined(first.start(robot), second.start(robot)),
        opposed=lambda robot: joined(first.start_negated(robot), second.start_negated(robot)),
        check=check_all(first, second),
    )


class Checked(Protocol):
    """An action or a condition."""

    def check(self, robot: Robot) -> None: ...


def check_all(*parts: Checked) -> Check:
    """The combined check of something that is composed of these parts."""

    def check(robot: Robot) -> None:
        for part in parts:
            part.check(robot)

    return check
