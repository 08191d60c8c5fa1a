"""Actions: what a robot does over time, and how actions are composed.

An action is a recipe. Running it makes a generator that yields once a tick; its return value is the action's
result. While the generator is suspended, the robot reads, estimates and drives; when it is closed, for
whatever reason, its `finally` stops what it started. The whole recipe is checked against robot.toml before
any of it runs, so a wrong name in its last step is reported before the first step moves.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from raccoon.core.config import REAL_CONTROLLERS
from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.condition import JOIN, Check, Condition, check_all
from raccoon.robot.actions.limits import check_function, check_kind, check_limit, check_number, check_wait
from raccoon.robot.actions.must_run import MustRun
from raccoon.robot.actions.steps import Steps as Steps
from raccoon.robot.actions.steps import advance, checked_steps, close, run_while
from raccoon.robot.remarks import EndlessRemark

if TYPE_CHECKING:
    from raccoon.robot.motions.pacing import MotionResult
    from raccoon.robot.robot import Robot

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
U = TypeVar("U")


class Action(MustRun, Generic[T_co]):
    """A recipe to run on a robot: `robot.run(action)`.

    name: for messages and the trace. start: makes the generator that carries the action out. check: raises an
    error for anything that is known to be wrong with it on this robot before it starts, such as a name that
    robot.toml does not have. An action can be run any number of times; every run starts afresh.
    """

    name = "an action of your own"
    _check: Check | None = None

    def __init__(self, name: str, start: Callable[[Robot], Steps[T_co]], check: Check | None = None) -> None:
        super().__init__()
        if not callable(start):
            raise TypeError(f"action '{name}': start is {start!r}: it must be a function(robot) that yields")
        self.name = name
        self._start, self._check = start, check

    def check(self, robot: Robot) -> None:
        """Raise ConfigError or ValueError if this action, or any action it is composed of, cannot run on
        `robot`. What a function makes only when it is called (`do`, `then`) is checked at that time."""
        if self._check is not None:
            self._check(robot)

    def start(self, robot: Robot) -> Steps[T_co]:
        """The generator that carries the action out on `robot`, one tick a step. Raises the errors of
        `check`."""
        self.mark_run()
        self.check(robot)
        return checked_steps(self._start(robot), self.name, self._start)

    def until(self, condition: Condition) -> Action[T_co | None]:
        """This action, ended as soon as `condition` holds. Its result is None if the condition ended it."""
        check_kind(condition, Condition, f"{self.name}: until()", JOIN)

        def steps(robot: Robot) -> Steps[T_co | None]:
            holds = condition.start(robot)
            done = yield from run_while(self.start(robot), lambda: not holds())
            return None if done is None else done[0]

        return Action(f"{self.name} until {condition.name}", steps, check_all(self, condition))

    def timeout(self, seconds: float) -> Action[T_co]:
        """This action; raises MotionTimeout if it has not ended by itself after `seconds` s."""
        check_limit(seconds=seconds)

        def steps(robot: Robot) -> Steps[T_co]:
            start, why = robot.time, ""

            def in_time() -> bool:
                nonlocal why
                if robot.time - start <= seconds:
                    return True
                why = "; ".join(
                    (robot.drive.describe_state(), *robot.attachments.moving, *robot.blind)
                )  # of now
                return False

            done = yield from run_while(self.start(robot), in_time)
            if done is None:
                raise MotionTimeout(f"{self.name}: not done after {seconds:g} s ({why})")
            return done[0]

        return Action(self.name, steps, self.check)

    def timeout_or(self, seconds: float, otherwise: Action[U]) -> Action[T_co | U]:
        """This action, replaced by `otherwise` if it has not ended after `seconds` s or gives up itself
        (MotionTimeout)."""
        check_kind(otherwise, Action, f"{self.name}: timeout_or()")
        limited = self.timeout(seconds)

        def steps(robot: Robot) -> Steps[T_co | U]:
            try:
                return (yield from limited.start(robot))
            except MotionTimeout as error:
                robot.note(f"{error}: {otherwise.name} instead")
                return (yield from otherwise.start(robot))

        return Action(f"{self.name} or {otherwise.name}", steps, check_all(self, otherwise))

    def then(self, following: Callable[[T_co], Action[U]]) -> Action[U]:
        """This action, followed by the action that `following` makes of its result."""
        check_function(following, f"{self.name}: then()", "result")

        def steps(robot: Robot) -> Steps[U]:
            result = yield from self.start(robot)
            made = following(result)
            check_kind(made, Action, f"{self.name}: from its function then()")
            return (yield from made.start(robot))

        return Action(f"{self.name}, then", steps, self.check)

    if not TYPE_CHECKING:  # a type checker knows that it has nothing else

        def __getattr__(self, name):
            if name.startswith("_"):
                return object.__getattribute__(self, name)
            raise AttributeError(f"action '{self.name}' has no {name}: run it with robot.run(...)")

    def __bool__(self) -> bool:
        raise TypeError(f"action '{self.name}' is neither true nor false: run it with robot.run(...)")

    if not TYPE_CHECKING:  # a type checker knows that there is nothing to go through

        def __iter__(self):
            raise TypeError(
                f"action '{self.name}' cannot be iterated: in steps of your own write yield from "
                "action.start(robot), elsewhere seq(...) and robot.run(...)"
            )

    def __repr__(self) -> str:
        return f"<Action {self.name}>"


def repeat(action: Action[Any], times: int | None = None) -> Action[None]:
    """`action` repeated `times` times, or without end."""
    check_actions("repeat", (action,))
    if times is not None:
        check_number("times", times, "whole, from 0")
    if times is not None and (times < 0 or times % 1 != 0):
        raise ValueError(f"times is {times}: allowed are whole numbers from 0, or None for ever")

    def steps(robot: Robot) -> Steps[None]:
        done = 0
        while times is None or done < times:
            before = robot.ticks
            yield from action.start(robot)
            done += 1
            if robot.ticks == before:  # an action that takes no time must not hang the loop
                yield

    return Action(f"repeat {action.name}", steps, action.check)


@overload
def parallel(*actions: Action[MotionResult]) -> Action[list[MotionResult]]: ...
@overload
def parallel(*actions: Action[Any]) -> Action[list[Any]]: ...
def parallel(*actions: Action[Any]) -> Action[list[Any]]:
    """Actions at the same time until all have ended; the result is the list of their results.

    If one fails, the others are stopped and its error is raised. Only one of them can drive the wheels.
    """
    check_actions("parallel", actions)

    def steps(robot: Robot) -> Steps[list[Any]]:
        results: list[Any] = [None] * len(actions)
        with ExitStack() as cleanly:
            running = {}
            for index, each in enumerate(actions):
                running[index] = each.start(robot)
                cleanly.callback(close, running[index])
            while True:
                for index, body in list(running.items()):
                    try:
                        advance(body)
                    except StopIteration as end:
                        results[index] = end.value
                        del running[index]
                if not running:
                    return results
                yield

    return Action(_names("parallel", actions), steps, check_all(*actions))


@overload
def race(*actions: Action[MotionResult]) -> Action[tuple[int, MotionResult]]: ...
@overload
def race(*actions: Action[Any]) -> Action[tuple[int, Any]]: ...
def race(*actions: Action[Any]) -> Action[tuple[int, Any]]:
    """Actions at the same time until the first has ended; the others are stopped. The result is (index of the
    first, its result)."""
    if not actions:
        raise ValueError("race has no actions: give it at least one")
    check_actions("race", actions)

    def steps(robot: Robot) -> Steps[tuple[int, Any]]:
        with ExitStack() as cleanly:
            bodies = []
            for action in actions:
                bodies.append(action.start(robot))
                cleanly.callback(close, bodies[-1])
            while True:
                for index, body in enumerate(bodies):
                    try:
                        advance(body)
                    except StopIteration as end:
                        return index, end.value
                yield

    return Action(_names("race", actions), steps, check_all(*actions))


def background(action: Action[Any]) -> Action[None]:
    """Start `action` and continue at once. It runs beside the following actions until it ends or the program
    does."""
    check_actions("background", (action,))

    def steps(robot: Robot) -> Steps[None]:
        robot.add_background(action)
        yield from ()

    return Action(f"background {action.name}", steps, action.check)


def wait(seconds: float) -> Action[None]:
    """Wait for `seconds` s. The robot keeps reading meanwhile, which `time.sleep` would prevent."""
    check_wait(seconds)

    def steps(robot: Robot) -> Steps[None]:
        start = robot.time
        while robot.time - start < seconds:
            yield

    return Action(f"wait {seconds:g} s", steps)


def wait_for(condition: Condition) -> Action[None]:
    """Wait until `condition` holds."""
    check_kind(condition, Condition, "wait_for()", JOIN)

    label = f"wait for {condition.name}"

    def steps(robot: Robot) -> Steps[None]:
        condition.ask(robot)
        holds = condition.start(robot)
        # On the table somebody may take as long as that; in simulation nothing comes that was not asked for.
        simulated = robot.config.controller.port not in REAL_CONTROLLERS
        endless = EndlessRemark(robot, label, ".timeout(seconds)") if simulated else None
        while not holds():
            if endless is not None:
                endless.tell()
            yield

    return Action(label, steps, condition.check)


def check_actions(kind: str, actions: tuple[Any, ...]) -> None:
    """Raise TypeError for anything that is not an action, such as a list of actions or a function that was
    not called."""
    for action in actions:
        hint = f": write {kind}(*actions) for a list" if isinstance(action, list | tuple) else ""
        check_kind(action, Action, f"{kind}()", hint)


def _names(kind: str, actions: tuple[Action[Any], ...]) -> str:
    return f"{kind}({', '.join(action.name for action in actions)})"
