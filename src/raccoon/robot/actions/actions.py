"""Actions: things a robot does over time, and how they are put together.

An action is a recipe. Running it makes a generator that yields once a tick; its return value is the action's
result. While it is suspended the robot reads, estimates and drives; when it is closed, for whatever reason,
its `finally` stops what it started.

Before any of it runs, the whole of a recipe is checked against robot.toml: a name in its last step that is
not there is said before the first one moves.
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
    """Something to run on a robot: `robot.run(action)`.

    name: for messages and the trace. start: makes the generator that does it. check: raises what is known to
    be wrong with it on this robot before it starts, such as a name that robot.toml does not have. An action
    can be run again and again; every run starts afresh.
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
        """Raise what is wrong with this action, and with all that it is made of, on `robot` (ConfigError,
        ValueError). What only a function makes (`do`, `then`) is checked when it is there."""
        if self._check is not None:
            self._check(robot)

    def start(self, robot: Robot) -> Steps[T_co]:
        """A generator that does the action on `robot`, one tick a step. Raises what `check` does."""
        self.mark_run()
        self.check(robot)
        return checked_steps(self._start(robot), self.name, self._start)

    def until(self, condition: Condition) -> Action[T_co | None]:
        """This action, ended as soon as `condition` holds. The result is None where it was ended."""
        check_kind(condition, Condition, f"{self.name}: until()", JOIN)

        def steps(robot: Robot) -> Steps[T_co | None]:
            holds = condition.start(robot)
            done = yield from run_while(self.start(robot), lambda: not holds())
            return None if done is None else done[0]

        return Action(f"{self.name} until {condition.name}", steps, check_all(self, condition))

    def timeout(self, seconds: float) -> Action[T_co]:
        """This action, with MotionTimeout if it has not ended by itself after `seconds` s."""
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
        """This action, or `otherwise` where it is not done after `seconds` s, or gives up (MotionTimeout)."""
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
        """This action, then the one that `following` makes of its result."""
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
            raise AttributeError(f"action '{self.name}' has no {name}: it is done with robot.run(...)")

    def __bool__(self) -> bool:
        raise TypeError(f"action '{self.name}' is neither true nor false: it is done with robot.run(...)")

    if not TYPE_CHECKING:  # a type checker knows that there is nothing to go through

        def __iter__(self):
            raise TypeError(
                f"action '{self.name}' is nothing to go through: in steps of your own write "
                "yield from action.start(robot), elsewhere seq(...) and robot.run(...)"
            )

    def __repr__(self) -> str:
        return f"<Action {self.name}>"


@overload
def seq(*actions: Action[MotionResult]) -> Action[list[MotionResult]]: ...
@overload
def seq(*actions: Action[Any]) -> Action[list[Any]]: ...
def seq(*actions: Action[Any]) -> Action[list[Any]]:
    """One after the other; the result is the list of their results."""
    check_actions("seq", actions)

    def steps(robot: Robot) -> Steps[list[Any]]:
        results = []
        for action in actions:
            results.append((yield from action.start(robot)))
        return results

    return Action(_names("seq", actions), steps, check_all(*actions))


def repeat(action: Action[Any], times: int | None = None) -> Action[None]:
    """`action` again and again, for ever or `times` times."""
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
    """All at once, until every one has ended; the result is the list of their results.

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
    """All at once, until the first has ended; the others are stopped.

    The result is (index of the first, its result).
    """
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
    """Start `action` and go on at once; it runs beside whatever follows until it ends or the program does."""
    check_actions("background", (action,))

    def steps(robot: Robot) -> Steps[None]:
        robot.add_background(action)
        yield from ()

    return Action(f"background {action.name}", steps, action.check)


def wait(seconds: float) -> Action[None]:
    """Let `seconds` s pass. The robot goes on reading meanwhile, which `time.sleep` would keep it from."""
    check_wait(seconds)

    def steps(robot: Robot) -> Steps[None]:
        start = robot.time
        while robot.time - start < seconds:
            yield

    return Action(f"wait {seconds:g} s", steps)


def wait_for(condition: Condition) -> Action[None]:
    """Let time pass until `condition` holds."""
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
    """Raise TypeError where something is no action: a list of them, a function that was not called."""
    for action in actions:
        hint = f": write {kind}(*actions) for a list" if isinstance(action, list | tuple) else ""
        check_kind(action, Action, f"{kind}()", hint)


def _names(kind: str, actions: tuple[Action[Any], ...]) -> str:
    return f"{kind}({', '.join(action.name for action in actions)})"
