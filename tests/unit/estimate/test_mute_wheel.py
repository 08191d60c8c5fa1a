"""A motor at fault whose wheel reads nothing: a dead converter, an open plug or fuse, or a blocked wheel."""

from dataclasses import replace

import pytest

from drive_traces import drive
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Fault, Inputs, Status
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry

AT, NOTICED = 2.5, 2.52
ARM_DUTY = 0.5


def driven(
    velocity: float, turn_rate: float, *, faulty: bool = True, dead: int | None = None, arm: float = 0.0
) -> tuple[DriveEstimate, Inputs]:
    """The end of a drive in which, from `AT` on, the port tells of a motor at fault.

    dead: the motor port that reads nothing from then on, while its wheel turns. arm: duty of a third motor.
    """
    odometry, kept = Odometry(RobotConfig()), 0.0
    for inputs, given in drive([(1.5, 0.0, 0.0), (2.5, velocity, turn_rate), (1.0, 0.0, 0.0)]):
        if dead is not None:
            bemf, position = list(inputs.bemf), list(inputs.position)
            if inputs.time >= AT:
                bemf[dead], position[dead] = 0.0, kept
            kept = position[dead] or 0.0
            inputs = replace(inputs, bemf=tuple(bemf), position=tuple(position))
        if faulty and inputs.time >= NOTICED and any(given.duty):
            inputs = replace(inputs, faults=(Fault.MOTOR_FAULT,))
        estimate = odometry.update(inputs, replace(given, duty=(*given.duty[:2], arm, 0.0)))
    return estimate, inputs


@pytest.mark.parametrize("dead", [0, 1])
@pytest.mark.parametrize(
    ("velocity", "turn_rate"), [(0.18, 0.0), (-0.18, 0.0), (0.15, 0.4)], ids=["ahead", "back", "arc"]
)
def test_a_converter_that_dies_while_its_motor_runs_on_costs_centimetres_and_is_said(
    dead: int, velocity: float, turn_rate: float
) -> None:
    estimate, inputs = driven(velocity, turn_rate, dead=dead)
    truth = inputs.truth
    assert truth is not None
    assert abs(estimate.x - truth.x) < 0.02
    assert abs(estimate.y - truth.y) < 0.02
    assert abs(estimate.heading - truth.heading) < 0.02
    # Nobody knows whether the other wheel span: that stays after the motor is off.
    assert estimate.status is Status.UNCERTAIN
    assert max(estimate.x_std, estimate.y_std) > 0.1


def test_a_wheel_that_is_blocked_and_turned_about_is_no_doubt_of_the_way() -> None:
    half_a_track = RobotConfig().model.drive.track_width.value / 2
    estimate, inputs = driven(0.8 * half_a_track, 0.8)
    truth = inputs.truth
    assert truth is not None
    assert abs(estimate.x - truth.x) < 0.01
    assert abs(estimate.y - truth.y) < 0.01
    assert max(estimate.x_std, estimate.y_std) < 0.03


def test_an_arm_at_its_end_says_nothing_of_the_wheels() -> None:
    estimate, _ = driven(0.18, 0.0, arm=ARM_DUTY)
    unharmed, _ = driven(0.18, 0.0, faulty=False)
    assert estimate.x_std == pytest.approx(unharmed.x_std, rel=0.01)
