"""Calibration of the drive from one straight drive along a tape: both motors' radians per tick and offsets.

The tape gives the distance of the robot's middle, the gyro its turn; so each wheel's distance is known::

    left way  = s - turn * track width / 2        right way = s + turn * track width / 2
    radians per tick = way / wheel radius / ticks             s = the arc over the taped chord

The tape determines the common scale, the gyro the ratio of the motors. An error of the track width or of the
gyro's scale is multiplied by the turn, so it vanishes on a nearly straight drive. The recording begins and
ends at rest: the rest before gives both motors' offsets and the gyro's bias; from rest to rest the lag of the
board's filter cancels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import fmean, pstdev

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs
from raccoon.estimate.drive.prior import known_offset_std, track_std
from raccoon.estimate.drive.wheels import WheelDecoder
from raccoon.estimate.drive_calibration.motors import MotorsCalibration
from raccoon.estimate.drive_calibration.plausibility import (
    check_plausible,
    describe_surprises,
    expected_distance,
)
from raccoon.estimate.drive_calibration.resting import MOVING_COUNTS, resting_offset
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.bemf import counts_scale

SHORTEST_M = 0.2
"""m; for shorter drives the tape's error is above 1 %."""
MAX_TURN = math.radians(30.0)
SLIP_NOISE = 0.0005
"""m, standard deviation of a wheel's travel after one metre; grows with its square root."""


@dataclass(frozen=True, slots=True)
class StraightCalibration(MotorsCalibration):
    """Results of a taped straight drive.

    turn: rad that the robot turned on the way. remarks: surprising results, in words.
    """

    turn: float
    expected: float
    remarks: tuple[str, ...] = ()


def calibrate_straight(
    robot: RobotConfig,
    inputs: Sequence[Inputs],
    distance: float,
    *,
    distance_std: float = 0.002,
    turn: float | None = None,
    turn_std: float = 0.005,
) -> StraightCalibration:
    """Both motors' radians per tick from a straight drive (all its cycles, from rest to rest).

    distance: m by tape between the two resting places, negative for a drive backwards. turn: rad on the way
    (counter-clockwise positive), if measured otherwise than by the gyro; turn_std: rad, of either.

    Raises CalibrationError, with a remedy, if the drive is too short, turned too far, does not begin and end
    at rest, has no counters or no gyro (and no `turn`), or if the result is implausible.
    """
    _require(abs(distance) >= SHORTEST_M, f"{distance} m were driven: at least {SHORTEST_M} m are needed")
    _require(
        math.isfinite(distance) and 0.0 < distance_std < 0.5 * abs(distance),
        f"distance_std is {distance_std} m: it must be above 0 and below half of the {distance:g} m driven",
    )
    rest = count_resting_cycles(robot, inputs)
    offsets = [resting_bemf(inputs[:rest], port) for port in (robot.drive.left, robot.drive.right)]
    bias = resting_gyro(inputs[:rest])
    if turn is None:
        turn = gyro_turn(robot, inputs, bias)
    _require(
        abs(turn) <= MAX_TURN,
        f"the robot turned by {math.degrees(turn):.1f} degrees on the way: drive straighter (30 are allowed)",
    )
    half = 0.5 * turn
    way = distance * (half / math.sin(half) if abs(half) > 1e-9 else 1.0)
    drive = robot.model.drive
    values = []
    for side, sign, offset in (("left", -1.0, offsets[0]), ("right", 1.0, offsets[1])):
        ticks, ticks_std = count_ticks(robot, inputs, side, offset)
        _require(
            abs(ticks) > ticks_std,
            f"the {side} wheel (motor port {getattr(robot.drive, side)}) did not turn: is this the recording "
            "of the drive, and the port right in robot.toml?",
        )
        side_way = way + sign * half * drive.track_width.value
        value = side_way / drive.wheel_radius.value / ticks
        relative = math.sqrt(
            (distance_std / distance) ** 2
            + (0.5 * turn_std * drive.track_width.value / side_way) ** 2
            + (half * track_std(robot, OdometrySettings()) * drive.track_width.value / side_way) ** 2
            + SLIP_NOISE**2 / abs(side_way)
            + (ticks_std / ticks) ** 2
        )
        values.append(_with_battery_voltage(robot, side, inputs, Measured(value, abs(value) * relative)))
    return StraightCalibration(
        left=values[0],
        right=values[1],
        left_offset=offsets[0],
        right_offset=offsets[1],
        turn=turn,
        expected=expected_distance(robot, inputs[0].device, values, distance),
        remarks=describe_surprises(robot, inputs[0].device, values, distance),
    )


def _require(met: bool, otherwise: str) -> None:
    if not met:
        raise CalibrationError(otherwise)


def count_resting_cycles(robot: RobotConfig, inputs: Sequence[Inputs]) -> int:
    """Number of cycles before the first wheel moves."""
    _require(len(inputs) > 10, f"the recording has {len(inputs)} cycles: nothing to calibrate from")
    ports = (robot.drive.left, robot.drive.right)
    first = {port: _first_words(inputs, port) for port in ports}
    for number, cycle in enumerate(inputs):
        for port in ports:
            bemf, position = cycle.bemf[port], cycle.position[port]
            start_bemf, start_position = first[port]
            if bemf is not None and start_bemf is not None:
                if abs(bemf - start_bemf) > MOVING_COUNTS:
                    return number
            elif position is not None and start_position is not None and abs(position - start_position) > 5.0:
                return number
    return len(inputs)


def _first_words(inputs: Sequence[Inputs], port: int) -> tuple[float | None, float | None]:
    """Resting back-EMF (mean of the first readings) and first counter reading of a port."""
    bemf = [word for cycle in inputs[:20] if (word := cycle.bemf[port]) is not None]
    position = [word for cycle in inputs[:20] if (word := cycle.position[port]) is not None]
    return (fmean(bemf) if bemf else None), (position[0] if position else None)


def resting_bemf(rest: Sequence[Inputs], port: int) -> Measured | None:
    """`resting_offset` of a port."""
    words = [word for cycle in rest[: max(len(rest) - 10, 0)] if (word := cycle.bemf[port]) is not None]
    return resting_offset(words, rest[0].device.bemf_dead_zone) if words else None


def resting_gyro(rest: Sequence[Inputs]) -> Measured | None:
    """Gyro bias, rad/s; None for fewer than 10 readings."""
    rates = [rate for cycle in rest[: max(len(rest) - 10, 0)] if (rate := cycle.turn_rate) is not None]
    if len(rates) < 10:
        return None
    return Measured(fmean(rates), max(pstdev(rates), 1e-4) / math.sqrt(len(rates)))


def gyro_turn(robot: RobotConfig, inputs: Sequence[Inputs], bias: Measured | None) -> float:
    """rad that the robot turned by its gyro, at the scale of robot.toml. Raises CalibrationError without a
    gyro or a rest for its bias."""
    _require(bias is not None, "no gyro reading at rest before the drive: wait 1 s first, or give the turn")
    assert bias is not None
    turn = 0.0
    last: tuple[float, float] | None = None
    for cycle in inputs:
        rate = cycle.turn_rate
        if rate is None:
            continue
        if last is not None:
            turn += 0.5 * (rate + last[1]) * (cycle.time - last[0])
        last = cycle.time, rate
    assert last is not None
    return (turn - bias.value * (last[0] - inputs[0].time)) / robot.model.imu.gyro_scale.value


def count_ticks(
    robot: RobotConfig, inputs: Sequence[Inputs], side: str, offset: Measured | None
) -> tuple[float, float]:
    """Ticks of a wheel over the drive without its offset's part, forward positive, and their standard
    deviation."""
    port: int = getattr(robot.drive, side)
    motor = robot.motor(port)
    if offset is not None:
        robot = replace(robot, motors={**robot.motors, port: replace(motor, bemf_offset=offset)})
    device = inputs[0].device
    decoder = WheelDecoder(robot)
    readings = [decoder.decode(cycle) for cycle in inputs]
    angles = [angle for reading in readings if (angle := getattr(reading, f"{side}_angle")) is not None]
    _require(
        len(angles) > 10, f"the counter of the {side} motor (port {port}) has no readings in the recording"
    )
    speeds = [speed for reading in readings[-10:] if (speed := getattr(reading, f"{side}_speed")) is not None]
    scale = counts_scale(robot, side, device)
    moving = bool(speeds) and abs(fmean(speeds)) > MOVING_COUNTS * scale
    _require(not moving, f"the {side} wheel still turns at the end of the recording: record until it rests")
    seconds = inputs[-1].time - inputs[0].time
    known = known_offset_std(robot, side) if offset is None else offset.std
    offset_std = robot.model.bemf.offset.std if known is None else known
    # One tick at either end, and the offset times the duration.
    ticks_std = math.hypot(1.0, offset_std * seconds / device.position_counts_seconds)
    return sum(angles) / (scale * device.position_counts_seconds), ticks_std


def _with_battery_voltage(
    robot: RobotConfig, side: str, inputs: Sequence[Inputs], value: Measured
) -> Measured:
    """The value with the battery voltage at its measurement. Raises CalibrationError for an impossible
    value."""
    check_plausible(robot, side, inputs[0].device, value, "distance, its direction")
    voltages = [volts for cycle in inputs if (volts := cycle.battery_voltage) is not None]
    return replace(value, battery_voltage=fmean(voltages) if voltages else None)
