"""A motor at fault whose wheel reads nothing: a dead converter, an open plug or fuse, or a blocked wheel."""

import math
from dataclasses import replace

import pytest

from drive_traces import drive
from raccoon import blocked, open_robot, spin
from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.core.readings import SIMULATOR, Fault, Inputs, Outputs, Status
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry
from raccoon.robot.emulated import open_emulated

AT, NOTICED = 2.5, 2.52
ARM_DUTY = 0.5


def driven(
    velocity: float, turn_rate: float, *, faulty: bool = True, dead: tuple[int, ...] = (), arm: float = 0.0
) -> tuple[DriveEstimate, Inputs]:
    """The end of a drive in which, from `AT` on, the port tells of a motor at fault.

    dead: the motor ports that read nothing from then on, while their wheels turn. arm: duty of a third motor.
    """
    odometry, kept = Odometry(RobotConfig()), [0.0, 0.0]
    for inputs, given in drive([(1.5, 0.0, 0.0), (2.5, velocity, turn_rate), (1.0, 0.0, 0.0)]):
        bemf, position = list(inputs.bemf), list(inputs.position)
        for port in dead:
            if inputs.time >= AT:
                bemf[port], position[port] = 0.0, kept[port]
            kept[port] = position[port] or 0.0
        inputs = replace(inputs, bemf=tuple(bemf), position=tuple(position))
        if faulty and inputs.time >= NOTICED and any(given.duty):
            inputs = replace(inputs, faults=(Fault.MOTOR_FAULT,))
        left, right = (math.copysign(duty, velocity) for duty in given.duty[:2])
        estimate = odometry.update(inputs, replace(given, duty=(left, right, arm, 0.0)))
    return estimate, inputs


@pytest.mark.parametrize("dead", [0, 1])
@pytest.mark.parametrize(
    ("velocity", "turn_rate"), [(0.18, 0.0), (-0.18, 0.0), (0.15, 0.4)], ids=["ahead", "back", "arc"]
)
def test_a_converter_that_dies_while_its_motor_runs_on_costs_centimetres_and_is_said(
    dead: int, velocity: float, turn_rate: float
) -> None:
    estimate, inputs = driven(velocity, turn_rate, dead=(dead,))
    truth = inputs.truth
    assert truth is not None
    assert abs(estimate.x - truth.x) < 0.02
    assert abs(estimate.y - truth.y) < 0.02
    assert abs(estimate.heading - truth.heading) < 0.02
    # Nobody knows whether the other wheel span: that stays after the motor is off.
    assert estimate.status is Status.UNCERTAIN
    assert max(estimate.x_std, estimate.y_std) > 0.1


def test_two_wheels_that_read_nothing_stand_or_have_rolled_out() -> None:
    """Two motors that die at once are a robot that something blocks, or one that rolls on for a moment."""
    estimate, _ = driven(0.18, 0.0, dead=(0, 1))
    assert 0.18 * 0.2 < estimate.x_std < 0.18 * 0.4 + 0.02
    assert estimate.y_std < 0.02


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


@pytest.mark.parametrize(
    ("duty", "arm", "volts", "told"),
    [
        (0.8, 0.0, 0.0, True),
        (0.8, ARM_DUTY, 0.0, True),
        (-0.8, ARM_DUTY, 0.0, True),
        (0.8, ARM_DUTY, 1.5, True),  # less than a free motor's
        (0.8, ARM_DUTY, -3.5, True),  # pushed back
        (0.8, ARM_DUTY, None, True),
        (None, ARM_DUTY, 3.5, True),  # nobody says what drives it
        (0.8, ARM_DUTY, 3.5, False),
        (-0.8, ARM_DUTY, -3.5, False),
        (0.0, ARM_DUTY, 0.0, False),
        (0.1, ARM_DUTY, 0.0, False),
    ],
)
@pytest.mark.parametrize("side", [0, 1])
def test_a_motor_fault_is_a_doubt_where_it_may_be_that_of_a_wheel(
    side: int, duty: float | None, arm: float, volts: float | None, told: bool
) -> None:
    """duty, volts: of one wheel, the other one is at rest (None: not known, not read)."""
    odometry, word = Odometry(RobotConfig()), None if volts is None else volts / SIMULATOR.bemf_volts
    bemf = (0.0, word, 0.0, 0.0) if side else (word, 0.0, 0.0, 0.0)
    given = duty or 0.0
    outputs = Outputs((0.0, given, arm, 0.0) if side else (given, 0.0, arm, 0.0))
    command = None if duty is None else outputs
    for time in (1.0, 1.01):
        inputs = Inputs(time, SIMULATOR, bemf, gyro=(0.0, 0.0, time), faults=(Fault.MOTOR_FAULT,))
        estimate = odometry.update(inputs, command)
    assert ("port: motor_fault" in estimate.reasons) is told


def test_an_arm_homed_against_its_stop_is_no_doubt_about_the_pose() -> None:
    """The next straight had the fault among its remarks."""
    config = RobotConfig(mechanisms={"arm": MechanismConfig(motor=3)})
    port = open_emulated(config)
    port._link._board._plant.free_motors[3].stops = (-0.1, 1.0)  # type: ignore[attr-defined]
    with open_robot(config, port=port) as robot:
        robot.run(spin("arm", -1.5).until(blocked("arm")).timeout(3.0))
        assert port.fault_counts[Fault.MOTOR_FAULT] > 0
        assert (robot.estimate.status, robot.estimate.reasons) == (Status.OK, ())
