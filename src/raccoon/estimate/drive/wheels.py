"""Conversion of a controller's counters and back-EMF words to wheel speeds and angles (the only place for
it).

A motor's counter is the integral of its back-EMF, so both share one scale (`raccoon.model.bemf.counts_scale`)
and one offset in counts, read at standstill, which adds offset · time to the counter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.config import BemfModel, RobotConfig
from raccoon.core.readings import MOTOR_PORTS, Device, Fault, Inputs
from raccoon.model.bemf import counter_lag, counts_scale

SAMPLE_TIME_S = 0.005
"""s between two samples of the back-EMF, whose noise is independent."""
MAX_WHEEL_SPEED = 60.0
"""rad/s, bound on the speed of a wheel of such a robot: a faster counter has jumped, a faster back-EMF is
wrong."""
MAX_TICKS = 2.0**63
"""Bound on a counter: it has 64 bits."""
MAX_TIME_S = 1e12
"""s, bound on a valid time (30 000 years)."""
LONGEST_GAP_S = 3600.0
"""s; a longer gap counts as this one: after either, the pose is unknown."""

_JUMP_FAULTS = (Fault.POSITION_JUMP, Fault.RESET)


@dataclass(slots=True)
class WheelReading:
    """One cycle of both wheels, at their nominal scale.

    left_speed, right_speed: rad/s as filtered by the board, so late by its filter's time constant.
    left_angle, right_angle: rad since the last cycle with a counter. None: no such reading in this cycle.
    dt: s since the last cycle, at most LONGEST_GAP_S; 0 in the first one and if time stood still or ran back
    (then nothing else is set).
    left_jumped, right_jumped: the counter moved further than a wheel can; its reading is left out.
    not_a_number: a word was NaN, infinite or beyond the range of its port, and is left out.
    left_absurd, right_absurd: the back-EMF is above MAX_WHEEL_SPEED, and is left out.
    left_blind, right_blind: the back-EMF reads 0, possibly while the wheel creeps: the device has a dead
    zone.
    """

    left_speed: float | None = None
    right_speed: float | None = None
    left_angle: float | None = None
    right_angle: float | None = None
    dt: float = 0.0
    left_jumped: bool = False
    right_jumped: bool = False
    not_a_number: bool = False
    left_absurd: bool = False
    right_absurd: bool = False
    left_blind: bool = False
    right_blind: bool = False


def lag_seconds(robot: RobotConfig, device: Device) -> float:
    """s by which back-EMF and counter are behind the wheel: from robot.toml's filter time constant if it
    differs from the default, else from the device."""
    own = robot.model.bemf.filter_time_constant
    if own == BemfModel().filter_time_constant and device.bemf_lag is not None:
        return device.bemf_lag
    return counter_lag(own.value, SAMPLE_TIME_S)


def resting_counts(robot: RobotConfig, port: int) -> float:
    """Back-EMF counts of the motor on `port` at standstill, with the board's sign."""
    own = robot.motor(port).bemf_offset
    return (robot.model.bemf.offset if own is None else own).value


def all_resting_counts(robot: RobotConfig) -> list[float]:
    """The resting counts of every motor port, in order."""
    return [resting_counts(robot, port) for port in range(MOTOR_PORTS)]


def known_offset_speeds(robot: RobotConfig, device: Device) -> tuple[float, float]:
    """rad/s that robot.toml's resting counts of the left and right wheel stand for."""
    left, right = (
        (-1.0 if robot.wheel_motor(side).inverted else 1.0)
        * resting_counts(robot, getattr(robot.drive, side))
        * counts_scale(robot, side, device)
        for side in ("left", "right")
    )
    return left, right


class _WheelPort:
    """Conversion of one motor port's words to SI units."""

    __slots__ = (
        "_device",
        "_offset",
        "_robot",
        "_scale",
        "_side",
        "_tick",
        "absurd",
        "jumped",
        "last_ticks",
        "port",
        "seconds_since_counter",
    )

    def __init__(self, robot: RobotConfig, side: str) -> None:
        self._robot = robot
        self._side = side
        self.port: int = getattr(robot.drive, side)
        self._offset = resting_counts(robot, self.port)
        self._device: Device | None = None
        self._scale = 0.0
        self._tick = 1.0
        self.last_ticks: float | None = None
        self.seconds_since_counter = 0.0
        self.absurd = self.jumped = False

    def prepare(self, device: Device) -> None:
        sign = -1.0 if self._robot.motor(self.port).inverted else 1.0
        self._device = device
        self._scale = sign * counts_scale(self._robot, self._side, device)
        self._tick = device.position_counts_seconds

    def speed(self, inputs: Inputs) -> float | None:
        counts = inputs.bemf[self.port]
        self.absurd = False
        if counts is None or not math.isfinite(counts):
            return None
        speed = (counts - self._offset) * self._scale
        if not -MAX_WHEEL_SPEED <= speed <= MAX_WHEEL_SPEED:
            self.absurd = True
            return None
        return speed

    def angle(self, inputs: Inputs, dt: float) -> float | None:
        """Angle since the last counter reading, rad; None without a valid one."""
        if inputs.device is not self._device:
            self.prepare(inputs.device)
        self.jumped = False
        self.seconds_since_counter += dt
        ticks = inputs.position[self.port]
        if ticks is None or not -MAX_TICKS <= ticks <= MAX_TICKS:
            return None
        if ticks == self.last_ticks and inputs.faults and Fault.STALE in inputs.faults:
            return None  # a repeated frame: the next one shows the motion of both
        last, since = self.last_ticks, self.seconds_since_counter
        self.last_ticks, self.seconds_since_counter = ticks, 0.0
        if last is None:
            return None
        if since >= LONGEST_GAP_S:
            return None
        moved = (ticks - last) * self._tick * self._scale
        slack = 2.0 * abs(self._tick * self._scale)
        if abs(moved) > MAX_WHEEL_SPEED * since + slack or self._has_jump_fault(inputs):
            self.jumped = True
            return None
        return moved - self._offset * self._scale * since

    def blind(self, inputs: Inputs) -> bool:
        return inputs.bemf[self.port] == 0.0 and inputs.device.bemf_dead_zone > 0.0

    def _has_jump_fault(self, inputs: Inputs) -> bool:
        return bool(inputs.faults) and any(fault in _JUMP_FAULTS for fault in inputs.faults)


class WheelDecoder:
    """Wheel readings of a robot from its controller's raw words.

    Remembers the last counter and time; make a new one for each recording.
    """

    def __init__(self, robot: RobotConfig) -> None:
        self._left = _WheelPort(robot, "left")
        self._right = _WheelPort(robot, "right")
        self._time: float | None = None

    def decode(self, inputs: Inputs) -> WheelReading:
        """The readings of the cycle `inputs`. Never raises for a bad word; it is left out."""
        dt = self._elapsed(inputs.time)
        first = self._left.last_ticks is None and self._right.last_ticks is None
        if dt <= 0.0 and not first:
            return WheelReading()
        left, right = self._left, self._right
        left_angle, right_angle = left.angle(inputs, dt), right.angle(inputs, dt)
        reading = WheelReading(left.speed(inputs), right.speed(inputs), left_angle, right_angle, dt)
        reading.left_jumped, reading.right_jumped = left.jumped, right.jumped
        reading.left_absurd, reading.right_absurd = left.absurd, right.absurd
        reading.left_blind, reading.right_blind = left.blind(inputs), right.blind(inputs)
        reading.not_a_number = _has_bad_word(inputs, left.port) or _has_bad_word(inputs, right.port)
        return reading

    def _elapsed(self, time: float) -> float:
        if not -MAX_TIME_S <= time <= MAX_TIME_S:
            return 0.0
        last, self._time = self._time, time
        return 0.0 if last is None else min(max(time - last, 0.0), LONGEST_GAP_S)


def _has_bad_word(inputs: Inputs, port: int) -> bool:
    bemf, position = inputs.bemf[port], inputs.position[port]
    return (bemf is not None and not math.isfinite(bemf)) or (
        position is not None and not -MAX_TICKS <= position <= MAX_TICKS
    )
