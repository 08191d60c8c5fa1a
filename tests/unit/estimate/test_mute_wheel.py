"""A motor at fault whose wheel reads nothing: a dead converter, an open plug or fuse, or a blocked wheel."""

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


def reasons(
    duty: float, bemf: float, *, arm: float = 0.0, begun: float = 1.0, known: bool = True, cycles: int = 10
) -> tuple[str, ...]:
    """Of a robot whose port tells of a motor at fault for so many of the last 10 cycles of 10 ms.

    duty: of both wheels, for `begun` s until then (known: whether anybody says so). bemf: counts that the
    right one reads then, and the left one 500. arm: duty of another motor until the fault has gone.
    """
    odometry = Odometry(RobotConfig())
    for cycle in range(-110, 11):
        fault, driven = 0 < cycle <= cycles, duty if 0.01 * cycle > -begun else 0.0
        beside = arm if cycle <= cycles else 0.0
        words = (500.0, bemf, 0.0, 0.0) if driven else (0.0,) * 4
        gyro = (0.0, 0.0, float(cycle % 2))
        faults = (Fault.MOTOR_FAULT,) if fault else ()
        inputs = Inputs(2.0 + 0.01 * cycle, SIMULATOR, words, gyro=gyro, faults=faults)
        odometry.update(inputs, Outputs((driven, driven, beside, 0.0)) if known else None)
    return odometry.estimate.reasons


@pytest.mark.parametrize(
    ("bemf", "given", "told"),
    [
        (0.0, {"duty": 0.8}, True),
        (0.0, {"duty": 0.8, "arm": ARM_DUTY}, True),
        (0.0, {"duty": 0.8, "known": False}, True),
        (150.0, {"duty": 0.8}, True),  # slower than its power makes it, and nobody else can be
        (500.0, {"duty": 0.8, "arm": ARM_DUTY}, False),
        (500.0, {"duty": 0.8, "arm": ARM_DUTY, "cycles": 5}, False),
        (500.0, {"duty": 0.8, "arm": ARM_DUTY, "cycles": 6}, False),
        (0.0, {"duty": 0.0, "arm": ARM_DUTY}, False),
        (0.0, {"duty": 0.8, "arm": ARM_DUTY, "begun": 0.1}, False),  # it may just start
    ],
)
def test_a_motor_fault_is_a_doubt_where_it_may_be_of_a_wheel(
    bemf: float, given: dict[str, float], told: bool
) -> None:
    assert ("port: motor_fault" in reasons(bemf=bemf, **given)) is told  # type: ignore[arg-type]


def test_an_arm_homed_against_its_stop_is_no_doubt_about_the_pose() -> None:
    """The next straight had the fault among its remarks."""
    config = RobotConfig(mechanisms={"arm": MechanismConfig(motor=3)})
    port = open_emulated(config)
    port._link._board._plant.free_motors[3].stops = (-0.1, 1.0)  # type: ignore[attr-defined]
    with open_robot(config, port=port) as robot:
        robot.run(spin("arm", -1.5).until(blocked("arm")).timeout(3.0))
        assert port.fault_counts[Fault.MOTOR_FAULT] > 0
        assert (robot.estimate.status, robot.estimate.reasons) == (Status.OK, ())
