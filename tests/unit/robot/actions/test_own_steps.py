"""Actions and conditions of a program's own: what is no step and no test is refused and named."""

from collections.abc import AsyncGenerator, Callable
from typing import Any

import pytest

from raccoon import Action, Condition, Robot, drive, open_robot, parallel, race, seq, straight, wait
from raccoon.robot.actions.steps import Steps
from robots import CONFIG, simulated_port


def _no_steps(robot: Robot) -> None:
    robot.drive.velocity(0.1)


async def _async(robot: Robot) -> None:
    robot.drive.velocity(0.1)


async def _async_steps(robot: Robot) -> AsyncGenerator[None]:
    yield


def _actions(robot: Robot) -> Any:
    yield straight(0.1)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (_no_steps, "action 'mine': _no_steps returns None instead of steps: .*do\\(function\\)"),
        (_async, "action 'mine': _async returns <coroutine .*write def instead of async def"),
        (_async_steps, "_async_steps returns <async_generator .*write def instead of async def"),
        (lambda _: straight(0.1), r"returns <Action straight 0.1 m> instead of steps: .*\.start\(robot\)"),
        (_actions, "the steps of _actions yield <Action straight 0.1 m>, but what is yielded is not run"),
        (3, r"action 'mine': start is 3: it must be a function\(robot\) that yields"),
    ],
)
@pytest.mark.parametrize("around", [seq, parallel, race, lambda action: action.timeout(1.0)])
def test_what_is_no_step_is_refused(start: Any, said: str, around: Any) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises(TypeError, match=said):
            robot.run(around(Action("mine", start)))
        assert not any(robot.outputs.duty)


class _Ten(Action[int]):
    def __init__(self) -> None:  # and not that of Action
        self.ticks = 10

    def start(self, robot: Robot) -> Steps[int]:
        first = robot.ticks
        while robot.ticks < first + self.ticks:
            yield
        return self.ticks


class _Late(Condition):
    def __init__(self, at: float) -> None:
        self.at = at

    def start(self, robot: Robot) -> Callable[[], bool]:
        return lambda: robot.time >= self.at


def test_classes_of_a_programs_own_need_nothing_but_start() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        assert robot.run(seq(_Ten(), wait(0.01)))[0] == 10
        robot.run(drive(0.1).until(_Late(0.2)))
        robot.run(drive(0.1).until(~_Late(0.9) & _Late(0.1)))
        assert 0.2 <= robot.time < 0.25


def test_a_start_that_gives_no_test_is_refused() -> None:
    wrong: Any = Condition("late", lambda robot: robot.time > 0.5)  # type: ignore[arg-type, return-value]
    with (
        open_robot(CONFIG, port=simulated_port()) as robot,
        pytest.raises(TypeError, match="condition 'late': its start returns False: it must return a test"),
    ):
        robot.run(drive(0.1).until(wrong))
