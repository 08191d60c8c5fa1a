"""Actions in sequence and how long each took: `seq`, `mission`, `timed`, and the action that `run` is given.

The recording and the report of a match contain begin and end of each step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, overload

from raccoon.robot.actions.actions import Action, Steps, check_actions
from raccoon.robot.actions.condition import check_all
from raccoon.robot.deadline import MatchOver

if TYPE_CHECKING:
    from raccoon.robot.motions.pacing import MotionResult
    from raccoon.robot.robot import Robot

T = TypeVar("T")
MAX_UNNAMED_STEPS = 200
"""Steps after which only named ones are recorded: a loop that runs a short action again and again would bury
the rest."""


@dataclass(frozen=True, slots=True)
class StepTime:
    """One named step: when it began and ended, s since the start of the match; ended: "done", or why not."""

    name: str
    begin: float
    end: float
    ended: str

    @property
    def label(self) -> str:
        """Its name, and why it ended if it was not done."""
        return self.name if self.ended == "done" else f"{self.name}: {self.ended}"

    @property
    def seconds(self) -> float:
        """Its duration, s."""
        return self.end - self.begin


class TimedStep(Action[T]):
    """An action whose duration is recorded."""


class Sequence(Action[list[Any]]):
    """Actions in sequence. parts: these actions."""

    def __init__(self, name: str, parts: tuple[Action[Any], ...]) -> None:
        super().__init__(name, lambda robot: _in_turn(robot, parts, _start), check_all(*parts))
        self.parts = parts


def _start(robot: Robot, action: Action[T]) -> Steps[T]:
    return action.start(robot)


def _in_turn(
    robot: Robot, parts: tuple[Action[Any], ...], start: Callable[[Robot, Action[Any]], Steps[Any]]
) -> Steps[list[Any]]:
    results = []
    for each in parts:
        results.append((yield from start(robot, each)))
    return results


def start_in_steps(robot: Robot, action: Action[Any]) -> Steps[Any]:
    """A generator that does an action as `action.start` does, and records it as a step; of a sequence each
    part."""
    if isinstance(action, TimedStep) or len(robot.steps) >= MAX_UNNAMED_STEPS:
        return action.start(robot)
    if not isinstance(action, Sequence):
        return timed(action).start(robot)
    action.mark_run()
    action.check(robot)
    return _in_turn(robot, action.parts, start_in_steps)


def timed(action: Action[T], name: str | None = None) -> Action[T]:
    """The action as a named step: its begin, end and duration go into the recording and the match report."""
    check_actions("timed", (action,))
    label = action.name if name is None else name

    def steps(robot: Robot) -> Steps[T]:
        begin, end, ended = robot.time, 0.0, "stopped"
        robot.note(f"step begins: {label}")
        try:
            result = yield from action.start(robot)
            ended = "done"
            return result
        except GeneratorExit:
            raise
        except BaseException as error:
            ended = f"{type(error).__name__}: {error}"
            if isinstance(error, MatchOver) and robot.deadline is not None:
                end = robot.deadline  # the alarm comes later than the last reading
            raise
        finally:
            end = max(end, robot.time)
            robot.steps.append(StepTime(label, begin, end, ended))
            robot.note(f"step ends: {label}: {ended} after {end - begin:.3f} s")

    return TimedStep(label, steps, action.check)


@overload
def mission(*actions: Action[MotionResult]) -> Action[list[MotionResult]]: ...
@overload
def mission(*actions: Action[Any]) -> Action[list[Any]]: ...
def mission(*actions: Action[Any]) -> Action[list[Any]]:
    """Actions in sequence like `seq`, each as a timed step."""
    check_actions("mission", actions)
    steps = tuple(each if isinstance(each, TimedStep) else timed(each) for each in actions)
    return Sequence(f"mission of {len(actions)} steps", steps)


@overload
def seq(*actions: Action[MotionResult]) -> Action[list[MotionResult]]: ...
@overload
def seq(*actions: Action[Any]) -> Action[list[Any]]: ...
def seq(*actions: Action[Any]) -> Action[list[Any]]:
    """Actions in sequence; the result is the list of their results."""
    check_actions("seq", actions)
    return Sequence(f"seq({', '.join(action.name for action in actions)})", actions)
