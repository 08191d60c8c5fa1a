"""Wheels that are not read for a while: nobody knows how fast they turn, until they tell how far."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from raccoon import (
    Action,
    MotionTimeout,
    Robot,
    RobotConfig,
    align_on_wall,
    drive,
    move,
    open_robot,
    straight,
    turn,
    wait,
    when,
)
from raccoon.core.config import MechanismConfig
from raccoon.core.readings import MOTOR_PORTS, NO_ANALOG, NO_DIGITAL, Fault, Inputs, Outputs, Words
from robots import CONFIG, InterceptingPort, simulated_port

BEGIN = 1.5
ARM = RobotConfig(motors=CONFIG.motors, mechanisms={"arm": MechanismConfig(motor=2)})
NOTHING: Words = (None,) * MOTOR_PORTS


def dead(inputs: Inputs) -> Inputs:
    """A link that carries nothing up, while commands go down."""
    return replace(
        inputs, bemf=NOTHING, position=NOTHING, gyro=None, accel=None, analog=NO_ANALOG, digital=NO_DIGITAL,
        battery=None, faults=(Fault.LINK_DEAD,), extra=None,
    )  # fmt: skip


def wheels(inputs: Inputs) -> Inputs:
    """The same with a gyro of its own."""
    return replace(inputs, bemf=NOTHING, position=NOTHING, faults=(Fault.LINK_DEAD,))


def left(inputs: Inputs) -> Inputs:
    return replace(inputs, bemf=(None, *inputs.bemf[1:]), position=(None, *inputs.position[1:]))


def encoders(inputs: Inputs) -> Inputs:
    """A base that has nothing but encoders."""
    return replace(inputs, bemf=NOTHING, gyro=None, accel=None)


class Silent(InterceptingPort):
    """The simulated robot, of which `silence` hides something from BEGIN on."""

    def __init__(
        self,
        silence: Callable[[Inputs], Inputs],
        seconds: float,
        base: Callable[[Inputs], Inputs] = lambda inputs: inputs,
    ) -> None:
        super().__init__(simulated_port(config=ARM), seen=self._heard)
        self._base, self._silence, self._end = base, silence, BEGIN + seconds
        self._time = 0.0
        self.power: list[tuple[float, float]] = []
        """s, and the largest duty of any motor, with its sign."""

    def _heard(self, inputs: Inputs) -> Inputs:
        inputs = self._base(inputs)
        self._time = inputs.time
        return self._silence(inputs) if BEGIN < self._time < self._end else inputs

    def write(self, outputs: Outputs) -> None:
        self.power.append((self._time, max(outputs.duty, key=abs)))
        super().write(outputs)

    def duties(self, begin: float, end: float) -> list[float]:
        return [duty for time, duty in self.power if begin <= time < end]


@pytest.mark.parametrize(
    ("action", "silence"),
    [
        (straight(0.5), dead),
        (straight(0.5), left),
        (drive(0.15), wheels),
        (drive(0.15), left),
        (turn(3.0), dead),
        (turn(3.0), left),
    ],
)
def test_wheels_that_are_not_read_get_no_more_power_than_before(
    action: Action[object], silence: Callable[[Inputs], Inputs]
) -> None:
    port = Silent(silence, 0.4)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(action.until(when(lambda here: here.time > BEGIN + 0.39)))
    before = max(map(abs, port.duties(BEGIN - 0.1, BEGIN)))
    assert 0.5 < before < 0.85
    assert max(map(abs, port.duties(BEGIN, BEGIN + 0.4))) < before + 0.05


@pytest.mark.parametrize("silence", [dead, left])
def test_wheels_that_stay_silent_end_a_motion(silence: Callable[[Inputs], Inputs]) -> None:
    port = Silent(silence, 5.0)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        with pytest.raises(MotionTimeout, match=r"left .*the left wheel is silent"):
            robot.run(straight(1.0))
        assert robot.time < BEGIN + 1.0


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (align_on_wall(0.05, timeout=1.0), "no wall after 1 s: port: link_dead; the left wheel is silent"),
        (move("arm", 6.0), r"arm .*; its back-EMF is not read"),
    ],
    ids=repr,
)
def test_an_error_of_what_is_not_read_names_that_and_no_wall_or_end_stop(
    action: Action[object], said: str
) -> None:
    with open_robot(ARM, port=Silent(dead, 5.0)) as robot:
        robot.run(wait(BEGIN - 0.5))
        with pytest.raises(MotionTimeout, match=said):
            robot.run(action)


@pytest.mark.parametrize("seconds", [0.15, 0.45])
@pytest.mark.parametrize("silence", [dead, wheels, left])
def test_where_wheels_turned_unread_is_known_when_they_are_read_again(
    silence: Callable[[Inputs], Inputs], seconds: float
) -> None:
    port = Silent(silence, seconds)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(straight(0.35))
        robot.run(wait(0.2))
        assert robot.inputs is not None
        truth, here = robot.inputs.truth, robot.estimate
    assert truth is not None
    assert math.hypot(truth.x - here.x, truth.y - here.y) < 0.004
    assert min(port.duties(BEGIN, BEGIN + seconds + 0.3)) > 0.3  # and it is not torn back


@pytest.mark.parametrize("silence", [dead, wheels])
def test_while_no_wheel_is_read_the_place_is_as_unsure_as_they_may_have_gone_on(
    silence: Callable[[Inputs], Inputs],
) -> None:
    port = Silent(silence, 0.45)
    off = []

    def watched(robot: Robot) -> bool:
        here, inputs = robot.estimate, robot.inputs
        assert inputs is not None
        assert inputs.truth is not None
        apart = math.hypot(inputs.truth.x - here.x, inputs.truth.y - here.y)
        off.append(apart / math.hypot(here.x_std, here.y_std))
        return False

    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(straight(0.5).until(when(watched)))
    assert max(off) < 3.0


@pytest.mark.parametrize("into", [0.02, 0.1])
def test_an_arm_that_is_not_read_is_driven_no_faster_than_before(into: float) -> None:
    port = Silent(dead, 0.3)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(BEGIN - into))
        robot.run(move("arm", 2.0))
        assert robot.mechanism("arm").angle == pytest.approx(2.0, abs=0.05)
    assert max(map(abs, port.duties(BEGIN, BEGIN + 0.3))) < 0.75  # its speed takes 0.55


def test_wheels_that_are_not_read_are_no_wall() -> None:
    port = Silent(wheels, 0.45)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(BEGIN - 0.5))
        with pytest.raises(MotionTimeout, match="no wall after 1 s"):
            robot.run(align_on_wall(0.06, timeout=1.0))


def test_encoders_that_are_read_again_show_how_fast_the_wheels_went() -> None:
    port = Silent(dead, 0.3, encoders)
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(straight(0.5))
    before = max(port.duties(BEGIN - 0.2, BEGIN))
    assert max(port.duties(BEGIN, BEGIN + 0.5)) < before + 0.05  # not as if they had stood
