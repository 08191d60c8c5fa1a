"""Functions of the robot as programs and as steps. A function is called once and may return an action, which
is then run."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar, overload

from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import check_function
from raccoon.robot.actions.steps import run_while

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

T = TypeVar("T")
NOTHING_RUN_HINT = "the program ran nothing on the robot: run an action with robot.run(...)"


def check_program(program: object, where: str) -> None:
    """Raise TypeError where `program` is neither an action nor a function of the robot."""
    if isinstance(program, list | tuple):
        raise TypeError(
            f"{where} takes one action, not a list of them: write seq(*actions) or mission(*actions)"
        )
    if not isinstance(program, Action):
        check_function(program, where, "robot")


def perform(robot: Robot, program: Action[T] | Callable[[Robot], Action[T] | T]) -> T:
    """Run a whole program, an action or a function of the robot, and return its result.

    If the function returns an action, that is run too. Raises TypeError if it returns something that should
    have been called, or a generator that nobody would step through.
    """
    made: Action[T] | T = program if isinstance(program, Action) else _call("the program", program, robot)
    return robot.run(made) if isinstance(made, Action) else made


@overload
def do(function: Callable[[Robot], Action[T]], name: str | None = None) -> Action[T]: ...


@overload
def do(function: Callable[[Robot], T], name: str | None = None) -> Action[T]: ...


def do(function: Callable[[Robot], Any], name: str | None = None) -> Action[Any]:
    """Call a function of the robot once, which takes no time. If it returns an action, that is run then.

    name: of the step in messages and reports; the function's own when None. Raises TypeError for a generator
    function, and if it returns a function or a generator.
    """
    check_function(function, "do()", "robot")

    def steps(robot: Robot) -> Steps[Any]:
        made = _call("the function of do()", function, robot)
        return (yield from made.start(robot)) if isinstance(made, Action) else made

    own = getattr(function, "__name__", "<lambda>")
    return Action(name or ("do" if own == "<lambda>" else f"do {own}"), steps)


def with_look(action: Action[T], look: Callable[[Robot], None], name: str) -> Action[T]:
    """The action, with `look` called before each of its ticks."""

    def steps(robot: Robot) -> Steps[T]:
        def looked() -> bool:
            look(robot)
            return True

        done = yield from run_while(action.start(robot), looked)
        assert done is not None
        return done[0]

    return Action(name, steps, action.check)


def _call(what: str, function: Callable[[Robot], Any], robot: Robot) -> Any:
    """What `function` returns. Raises TypeError if that should have been run or called."""
    made = function(robot)
    if inspect.isgenerator(made) or inspect.iscoroutine(made):
        made.close()
        name = made.__name__
        raise TypeError(
            f"{what} returns what the function {name} yields, which nothing would run: return "
            f"Action('{name}', {name}) instead"
        )
    if inspect.isroutine(made):
        name = made.__name__
        raise TypeError(f"{what} returns the function {name} without calling it: write {name}(...)")
    return made
