"""Back-EMF filter, counters and controllers of RaccoonOS, motor by motor, with the wire's polarity."""

from __future__ import annotations

import math
import struct

from raccoon.core.readings import MOTOR_PORTS
from raccoon.hal.wombat.emulator.plant import Drive
from raccoon.hal.wombat.firmware.raccoon.commands import FULL_PWM, Mode, Shutdown, Update

FILTER = 0.2
MAX_BEMF = 2000.0
"""Largest filtered back-EMF that is accepted, counts."""
DEAD_ZONE = 25.0
"""Back-EMF below which version 21 reports 0, counts."""
KP = 1.22
KI_PER_CALL, KI_PER_SECOND = 0.045, 9.0
CLAMP = 399.0
MOVE_FLOOR, MOVE_GAIN, MOVE_STEP, MOVE_TOLERANCE, MOVE_LIMIT = 15, 20, 150, 40, 300


class RaccoonMotor:
    """One motor. bemf: counts. drive: state of its driver. done: whether its position goal is reached."""

    def __init__(self, version: int) -> None:
        self._newer = version >= 21
        self._raw: list[float] = [0.0, 0.0, 0.0]
        self._count = 0.0
        self._ema = 0.0
        self.bemf = 0.0
        self._mode = int(Mode.OFF)
        self._integral = 0.0
        self._speed = 0.0
        self.done = False
        self.drive: Drive = None
        self.kp, self.ki, self.kd = KP, KI_PER_SECOND if self._newer else KI_PER_CALL, 0.0
        self._error = 0.0
        self.bemf_offset = 0.0

    @property
    def position(self) -> int:
        """The counter as in the frame: whole ticks that wrap at 32 bits."""
        return (math.trunc(self._count) + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000

    def clear(self) -> None:
        """Set the counter to 0."""
        self._count = 0.0

    def measure(self, raw: float, seconds: float) -> None:
        """Process one conversion `raw` (counts), `seconds` after the last: median of 3, EMA, range, and the
        counter.

        Beyond the range both back-EMF and counter stay constant.
        """
        self._raw = [*self._raw[1:], raw]
        self._ema += FILTER * (sorted(self._raw)[1] - self._ema)
        if abs(self._ema) > MAX_BEMF:
            return
        if not self._newer:
            self.bemf = self._ema
            self._count += self._ema
            return
        value = self._ema - self.bemf_offset
        self.bemf = 0.0 if abs(value) < DEAD_ZONE else value
        self._count += self.bemf * seconds

    def control(self, mode: int, target: int, goal: int, seconds: float) -> None:
        """Determine the driver's state from mode, target and goal; `seconds` since the last call."""
        if mode != self._mode:
            self._mode, self.done, self._integral, self._speed, self._error = mode, False, 0.0, 0.0, 0.0
        if mode == Mode.PWM:
            self.drive = max(-FULL_PWM, min(FULL_PWM, target)) / FULL_PWM
        elif mode in (Mode.SPEED, Mode.CHASSIS):
            self._speed_control(target, seconds)
        elif mode == Mode.POSITION:
            self._move(target, goal, seconds)
        else:
            self.drive = 0.0 if mode == Mode.BRAKE else None

    def _speed_control(self, target: float, seconds: float) -> None:
        error = target - self.bemf
        step = self.ki * error * (seconds if self._newer else 1.0)
        self._integral = max(-CLAMP, min(CLAMP, self._integral + step))
        output = self.kp * error + self._integral + self.kd * (error - self._error)
        self._error = error
        self.drive = max(-CLAMP, min(CLAMP, output)) / FULL_PWM

    def _move(self, limit: int, goal: int, seconds: float) -> None:
        error = goal - self.position
        if self.done or abs(error) <= MOVE_TOLERANCE:
            self.done, self.drive = True, 0.0
            return
        cap = limit if limit > 0 else MOVE_LIMIT
        speed = min(max(math.isqrt(MOVE_GAIN * abs(error)), MOVE_FLOOR), cap)
        wanted = math.copysign(speed, error)
        self._speed += max(-MOVE_STEP, min(MOVE_STEP, wanted - self._speed))
        self._speed_control(self._speed, seconds)


_HEAD = struct.Struct("<BIBH4i")
_GOALS = struct.Struct("<4i")
_GAINS = struct.Struct("<12f")


class RaccoonMotors:
    """The four motors and the command frame in memory that controls them; offsets follow the version."""

    def __init__(self, version: int) -> None:
        self._version = version
        shift = 12 if version >= 21 else 0
        self._goal_offset = 24 + shift
        self._reset_offset = 40 + shift
        self._gain_offset = 70 + shift
        self._tail_offset = 136 + shift
        self._forward: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0),) * MOTOR_PORTS
        self.motors = [RaccoonMotor(version) for _ in range(MOTOR_PORTS)]
        self.stopped = False
        self.bemf_disabled = False
        self._modes = 0
        self._targets: tuple[int, ...] = (0,) * MOTOR_PORTS
        self._goals: tuple[int, ...] = (0,) * MOTOR_PORTS

    def accept(self, frame: bytes, version_matches: bool) -> None:
        """Process a frame. With a wrong version its one-shot parts and its shutdown are ignored, but not its
        motor commands."""
        _, updates, shutdown, self._modes, *targets = _HEAD.unpack_from(frame)
        self._targets = tuple(targets)
        self._goals = _GOALS.unpack_from(frame, self._goal_offset)
        if version_matches:
            self.stopped = bool(shutdown & Shutdown.MOTORS)
            self._update(frame, updates)
        if self._version >= 21 and self._modes & 7 == Mode.CHASSIS:
            self._targets = self._wheel_targets(frame)

    def _update(self, frame: bytes, updates: int) -> None:
        if updates & Update.VELOCITY_PID:
            gains = _GAINS.unpack_from(frame, self._gain_offset)
            for port, motor in enumerate(self.motors):
                motor.kp, motor.ki, motor.kd = gains[3 * port : 3 * port + 3]
        if updates & Update.KINEMATICS:
            self._forward = self._forward_matrix(frame)
        if updates & Update.POSITION_RESET:
            for port, motor in enumerate(self.motors):
                if frame[self._reset_offset] >> port & 1:
                    motor.clear()
        if self._version >= 21 and updates & Update.FEATURES:
            self.bemf_disabled = bool(frame[276] & 1)

    def _forward_matrix(self, frame: bytes) -> tuple[tuple[float, float, float], ...]:
        """Counts of each wheel per vx, vy and wz; also sets the offsets."""
        at = self._tail_offset + 48
        ticks_to_rad = struct.unpack_from("<4f", frame, at)
        at += 16
        if self._version >= 21:
            for motor, offset in zip(self.motors, struct.unpack_from("<4f", frame, at), strict=True):
                motor.bemf_offset = offset
            at += 16
        rows = struct.iter_unpack("<3f", frame[at : at + 48])
        return tuple(
            (vx / scale, vy / scale, wz / scale) if scale else (0.0, 0.0, 0.0)
            for (vx, vy, wz), scale in zip(rows, ticks_to_rad, strict=True)
        )

    def _wheel_targets(self, frame: bytes) -> tuple[int, ...]:
        velocity = struct.unpack_from("<3f", frame, 24)
        return tuple(round(sum(a * v for a, v in zip(row, velocity, strict=True))) for row in self._forward)

    def control(self, port: int, seconds: float) -> None:
        """One control pass of the motor on `port`, `seconds` after the last."""
        motor = self.motors[port]
        if self.stopped:
            motor.drive = None
            return
        motor.control(self._modes >> 3 * port & 7, self._targets[port], self._goals[port], seconds)
