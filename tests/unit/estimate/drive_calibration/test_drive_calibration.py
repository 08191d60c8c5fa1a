"""A taped straight drive tells both motors' scale and offset, or is refused with what to do."""

import math
from dataclasses import replace
from typing import Any

import pytest

from drive_traces import RADIUS, TRACK, Errors, Segment, drive
from raccoon.core.config import Measured, MotorConfig, RobotConfig, parse_robot
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs, Words
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive_calibration.straight import calibrate_straight

STRAIGHT: list[Segment] = [(1.0, 0.0, 0.0), (3.2, 0.2, 0.0), (1.0, 0.0, 0.0)]
ODD = Errors(scale=(1.035, 0.965), offset_counts=(31.5, -54.9), gyro_bias=0.004)


def recorded(segments: list[Segment], errors: Errors = ODD, **more: Any) -> tuple[list[Inputs], float]:
    """Its cycles, of a robot whose clock began long before, and how far it went, m."""
    cycles = [replace(inputs, time=100.0 + inputs.time) for inputs, _ in drive(segments, errors, **more)]
    truth = cycles[-1].truth
    assert truth is not None
    return cycles, math.hypot(truth.x, truth.y)


def negated(words: Words) -> Words:
    """The left motor wired the other way."""
    assert words[0] is not None
    return (-words[0], *words[1:])


@pytest.mark.parametrize("seed", range(5))
def test_scales_and_offsets_are_found_within_their_deviations(seed: int) -> None:
    cycles, distance = recorded(STRAIGHT, seed=seed)
    found = calibrate_straight(RobotConfig(), cycles, distance, distance_std=0.001)
    nominal = cycles[0].device.bemf_volts / 1.08
    for value, scale in ((found.left, 1.035), (found.right, 0.965)):
        assert value.value == pytest.approx(nominal / scale, abs=4 * value.std)
        assert value.std / value.value < 0.005
    assert found.left_offset is not None
    assert found.right_offset is not None
    assert found.left_offset.value == pytest.approx(31.5, abs=4 * found.left_offset.std)
    assert found.right_offset.value == pytest.approx(-54.9, abs=4 * found.right_offset.std)


@pytest.mark.parametrize(("rate", "gyro_every"), [(0.16, 1), (-0.16, 3)])
def test_a_curved_drive_is_told_apart_by_the_gyro(rate: float, gyro_every: int) -> None:
    """Its arc is 1.1 % longer than the tape, which is its chord."""
    curved: list[Segment] = [(1.0, 0.0, 0.0), (3.2, 0.2, rate), (1.0, 0.0, 0.0)]
    quiet = replace(ODD, bemf_noise_counts=0.0, gyro_noise=0.0, slip_noise=0.0)
    cycles, distance = recorded(curved, quiet, gyro_every=gyro_every)
    found = calibrate_straight(RobotConfig(), cycles, distance)
    nominal = cycles[0].device.bemf_volts / 1.08
    assert found.turn == pytest.approx(3.2 * rate, abs=0.005)
    assert found.left.value == pytest.approx(nominal / 1.035, rel=1e-3)
    assert found.right.value == pytest.approx(nominal / 0.965, rel=1e-3)


def test_an_encoder_tells_by_its_ticks_when_the_robot_stands() -> None:
    """And what nobody knows of its offset adds up over the time of the drive."""
    backwards: list[Segment] = [(1.0, 0.0, 0.0), (3.2, -0.2, 0.1), (1.0, 0.0, 0.0)]
    cycles, distance = recorded(backwards, replace(ODD, offset_counts=(0.0, 0.0)), bemf=False)
    found = calibrate_straight(RobotConfig(), cycles, -distance, distance_std=0.001)
    nominal = cycles[0].device.bemf_volts / 1.08
    assert found.left.value == pytest.approx(nominal / 1.035, abs=4 * found.left.std)
    assert found.turn == pytest.approx(0.32, abs=0.01)  # with the gyro's bias of before
    assert found.left_offset is found.right_offset is None
    unsure = RobotConfig(motors={0: MotorConfig(bemf_offset=Measured(0.0, 100.0))})
    share = 100.0 * 5.2 / ((distance + 0.16 * TRACK) / RADIUS / nominal * 1.035)
    halves = replace(cycles[0].device, position_counts_seconds=0.5)  # as of a counter with twice the ticks
    fine = [
        replace(c, device=halves, position=tuple(None if p is None else 2.0 * p for p in c.position))
        for c in cycles
    ]
    for each in (cycles, fine):
        found = calibrate_straight(unsure, each, -distance)
        assert found.left.std / found.left.value == pytest.approx(share, rel=0.01)


def test_the_gyro_is_read_at_the_scale_that_robot_toml_gives_it() -> None:
    curved: list[Segment] = [(1.0, 0.0, 0.0), (3.2, 0.2, 0.1), (1.0, 0.0, 0.0)]
    plain, distance = recorded(curved)
    cycles, _ = recorded(curved, replace(ODD, gyro_scale=1.1))
    robot = parse_robot({"model": {"imu": {"gyro_scale": {"value": 1.1, "std": 0.001}}}})
    found = calibrate_straight(robot, cycles, distance)
    assert found.turn == pytest.approx(calibrate_straight(RobotConfig(), plain, distance).turn, abs=1e-4)


def test_backwards_and_inverted_is_the_same() -> None:
    backwards: list[Segment] = [(1.0, 0.0, 0.0), (3.2, -0.2, 0.0), (1.0, 0.0, 0.0)]
    cycles, distance = recorded(backwards)
    flipped = [replace(c, bemf=negated(c.bemf), position=negated(c.position)) for c in cycles]
    robot = RobotConfig(motors={0: MotorConfig(inverted=True)})
    found = calibrate_straight(robot, flipped, -distance)
    nominal = cycles[0].device.bemf_volts / 1.08
    assert found.left.value == pytest.approx(nominal / 1.035, rel=0.01)
    unflipped = calibrate_straight(RobotConfig(), cycles, -distance)
    assert unflipped.left.value == pytest.approx(found.left.value)


def test_applied_calibration_drives_the_tape_again() -> None:
    cycles, distance = recorded(STRAIGHT)
    robot = calibrate_straight(RobotConfig(), cycles, distance).applied(RobotConfig())
    odometry = Odometry(robot)
    for inputs, command in drive(STRAIGHT, ODD, seed=7):
        estimate = odometry.update(inputs, command)
    assert inputs.truth is not None
    assert estimate.x == pytest.approx(inputs.truth.x, rel=0.01)
    assert abs(estimate.y - inputs.truth.y) < 0.005


def test_entries_are_keys_of_robot_toml() -> None:
    cycles, distance = recorded(STRAIGHT)
    found = calibrate_straight(RobotConfig(), cycles, distance)
    keys = set(found.entries(RobotConfig()))
    assert keys == {f"motor.{p}.{k}" for p in (0, 1) for k in ("radians_per_tick", "bemf_offset")}


REFUSED: list[tuple[list[Segment], dict[str, Any], dict[str, Any], str]] = [
    ([(1.0, 0.0, 0.0), (0.6, 0.2, 0.0), (1.0, 0.0, 0.0)], {}, {}, "at least 0.2 m"),
    ([(1.0, 0.0, 0.0), (3.2, 0.2, 0.4), (1.0, 0.0, 0.0)], {}, {}, "drive straighter"),
    ([(1.0, 0.0, 0.0), (3.2, 0.2, -0.4), (1.0, 0.0, 0.0)], {}, {}, "by -7.* degrees .*: drive straighter"),
    ([(0.05, 0.0, 0.0)], {}, {"distance": 0.6}, "the recording has 10 cycles"),
    ([(1.0, 0.0, 0.0), (3.2, 0.2, 0.0)], {}, {}, "still turns at the end"),
    ([(1.0, 0.0, 0.0), (3.2, -0.2, 0.0)], {}, {"distance": -0.64}, "still turns at the end"),
    (STRAIGHT, {"gyro_every": 0}, {}, "give the turn"),
    (STRAIGHT, {"counters": False}, {}, "has no readings"),
    ([(5.0, 0.0, 0.0)], {}, {"distance": 0.6}, r"the left wheel \(motor port 0\) did not turn"),
    (STRAIGHT, {}, {"distance": -0.6}, "wrong sign"),
    (STRAIGHT, {}, {"distance": 6.0}, "times the expected"),
    (STRAIGHT, {}, {"distance_std": 0.0}, "distance_std"),
    (STRAIGHT, {}, {"distance_std": 0.4}, "below half of the 0.64"),
]


@pytest.mark.parametrize(("segments", "sensors", "given", "reason"), REFUSED)
def test_a_drive_that_cannot_tell_is_refused(
    segments: list[Segment], sensors: dict[str, Any], given: dict[str, Any], reason: str
) -> None:
    cycles, distance = recorded(segments, **sensors)
    with pytest.raises(CalibrationError, match=reason):
        calibrate_straight(RobotConfig(), cycles, **{"distance": distance, **given})


def test_without_a_gyro_the_turn_can_be_given() -> None:
    cycles, distance = recorded(STRAIGHT, gyro_every=0)
    found = calibrate_straight(RobotConfig(), cycles, distance, turn=0.0)
    assert found.left.value / found.right.value == pytest.approx(0.965 / 1.035, rel=0.02)
    robot = parse_robot({"model": {"drive": {"track_width": {"value": TRACK, "std": 0.1 * TRACK}}}})
    found = calibrate_straight(robot, cycles, distance, turn=0.3, distance_std=0.005, turn_std=0.1)
    for value, way in ((found.left, distance - 0.15 * TRACK), (found.right, distance + 0.15 * TRACK)):
        parts = (0.005 / distance, 0.5 * 0.1 * TRACK / way, 0.15 * 0.1 * TRACK / way)
        assert value.std / value.value == pytest.approx(math.hypot(*parts), rel=0.02)


@pytest.mark.parametrize("share", [0.83, 1.2])
def test_a_tape_that_was_read_wrong_is_said(share: float) -> None:
    cycles, distance = recorded(STRAIGHT)
    assert calibrate_straight(RobotConfig(), cycles, distance).remarks == ()
    known = calibrate_straight(RobotConfig(), cycles, distance).applied(RobotConfig())
    (remark,) = calibrate_straight(known, cycles, share * distance).remarks
    assert "read the tape again" in remark
    assert f"{distance:.3f} m" in remark


def test_a_motor_that_was_changed_is_said() -> None:
    cycles, distance = recorded(STRAIGHT)
    known = calibrate_straight(RobotConfig(), cycles, distance).applied(RobotConfig())
    value = known.motor(0).radians_per_tick
    assert value is not None
    before = replace(known.motor(0), radians_per_tick=replace(value, value=1.1 * value.value))
    (remark,) = calibrate_straight(
        replace(known, motors={**known.motors, 0: before}), cycles, distance
    ).remarks
    assert "the left motor (port 0)" in remark
