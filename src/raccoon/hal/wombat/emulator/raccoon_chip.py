"""The co-processor with RaccoonOS 17 or 21: a timer that measures one motor after the other, and a main
loop."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

from raccoon.core.readings import ANALOG_PORTS, GRAVITY, MOTOR_PORTS, SERVO_PORTS
from raccoon.hal.wombat.emulator.board import ANALOG_NOISE, Board
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import Drive
from raccoon.hal.wombat.emulator.raccoon_motors import RaccoonMotors
from raccoon.hal.wombat.firmware.devices import RACCOON_BEMF_RATE_HZ, RACCOON_POLARITY
from raccoon.hal.wombat.firmware.raccoon.commands import ServoMode, Shutdown
from raccoon.hal.wombat.firmware.raccoon.wire import BUTTON, DATA_LENGTH, FRAME_LENGTH

SLOT_SECONDS = {"shipped": 1.0 / (RACCOON_BEMF_RATE_HZ * MOTOR_PORTS), "published": 1250e-6}
"""Duration of one motor's slot, s: as measured on robots, and as in the source."""
COAST_SECONDS = 544e-6
"""Duration of coasting for a measurement, s: 500 us for the current to decay and 44 us of conversion."""
ANALOG_SECONDS = 1 / 250
IMU_SECONDS = 1 / 50
ACCEL_RANGE = 2.0 * GRAVITY
"""Range of each axis of the accelerometer, m/s2, as this firmware sets it."""
ANALOG_AVERAGED = 50
SHUTDOWN_OFFSET = 5

_HEAD = struct.Struct("<BI4i4iB6hhH")
_SERVOS = struct.Struct("<B4H")
_SERVOS_OFFSET = {17: 41, 21: 53}
_IMU = struct.Struct("<3fb3fb3fb3fb3fb4fbff6f")


class RaccoonChip:
    """The buffers of the link and the interrupts and main loop that fill them."""

    def __init__(self, board: Board, faults: Faults, version: int, build: str) -> None:
        self._board = board
        self._faults = faults
        self._version = version
        self._slot = SLOT_SECONDS[build]
        self.frame_length = FRAME_LENGTH[version]
        self._padding = bytes(self.frame_length - DATA_LENGTH)
        self.reset()

    def reset(self) -> None:
        """State after power-on: counters, clock, heading and commands at 0."""
        self.motors = RaccoonMotors(self._version)
        self.servo_us: tuple[int | None, ...] = (None,) * SERVO_PORTS
        self._clock = 0.0
        self._stamp = 0
        self._digital = 0
        self._heading = 0.0
        self._next_analog = self._next_imu = 0.0
        self._analog = [0] * ANALOG_PORTS
        self._battery = 0
        self._volt_seconds = self._seconds = 0.0  # battery voltage: integral since its last word
        self._imu = _IMU.pack(*(0,) * 33)
        self._measured = [0.0] * MOTOR_PORTS
        self._turn = 0  # motor to be measured next
        self._next: Callable[[], float] = self._begin
        self._remaining = self._next()
        self._motor_words = self._read_motors()

    def image(self) -> bytes:
        """The frame that the next transfer sends."""
        bemf, position, done = self._motor_words
        version = self._version + 1 if self._faults.wrong_version else self._version
        head = _HEAD.pack(
            version, self._stamp, *bemf, *position, done, *self._analog, self._battery, self._digital
        )
        return head + self._imu + self._padding

    def accept(self, frame: bytes) -> None:
        """Process one complete frame at once, whatever its version; then store the time of the clock."""
        understood = frame[0] == self._version and not self._faults.wrong_version
        self.motors.accept(frame, understood)
        self._move_servos(frame, understood)
        self._stamp = int(self._clock * 1e6) & 0xFFFF_FFFF
        button = int(self._board.state.button) << BUTTON
        self._digital = self._board.digital_bits() | button

    def _move_servos(self, frame: bytes, understood: bool) -> None:
        modes, *pulses = _SERVOS.unpack_from(frame, _SERVOS_OFFSET[self._version])
        if understood and frame[SHUTDOWN_OFFSET] & Shutdown.SERVOS:
            modes = 0
        self.servo_us = tuple(
            pulse if modes >> 2 * port & 3 == ServoMode.ENABLED else None for port, pulse in enumerate(pulses)
        )

    def advance(self, seconds: float) -> None:
        """Run the interrupts for `seconds`, and the main loop unless it hangs."""
        self._remaining -= seconds
        while self._remaining <= 0.0:
            self._remaining += self._next()

    # The parts of one motor's slot: each returns its duration, s, and sets the next part. If one raises
    # (Ctrl-C), it is repeated.

    def _begin(self) -> float:
        if self.motors.bemf_disabled or self.motors.stopped:
            return self._drive_on(self._slot)
        seconds = self._pass(COAST_SECONDS, coasting=self._turn)
        self._next = self._measuring
        return seconds

    def _measuring(self) -> float:
        self._measure(self._turn)
        return self._drive_on(self._slot - COAST_SECONDS)

    def _drive_on(self, seconds: float) -> float:
        self._control(self._turn)
        self._pass(seconds, coasting=None)
        self._next = self._end
        return seconds

    def _end(self) -> float:
        if not self._faults.frozen:
            self._main_loop()
        self._next = self._begin
        self._turn = (self._turn + 1) % MOTOR_PORTS
        return self._begin()

    def _pass(self, seconds: float, *, coasting: int | None) -> float:
        self._clock += seconds
        # The wire's positive direction is the plant's negative one.
        drives: tuple[Drive, ...] = tuple(
            None if port == coasting or motor.drive is None else RACCOON_POLARITY * motor.drive
            for port, motor in enumerate(self.motors.motors)
        )
        self._board.advance(seconds, drives)
        self._volt_seconds += seconds * self._board.state.battery_voltage
        self._seconds += seconds
        self._heading += self._board.state.gyro[2] * seconds
        return seconds

    def _measure(self, port: int) -> None:
        raw = RACCOON_POLARITY * self._board.bemf(port) + self._faults.bemf_offset[port]
        elapsed = self._clock - self._measured[port]
        self._measured[port] = self._clock
        self.motors.motors[port].measure(raw, elapsed)

    def _control(self, port: int) -> None:
        if self._version >= 21:
            self.motors.control(port, MOTOR_PORTS * self._slot)
            return
        for each in range(MOTOR_PORTS):  # version 17 runs all four after every conversion
            self.motors.control(each, self._slot)

    def _main_loop(self) -> None:
        self._motor_words = self._read_motors()
        # (The seconds are 0 if Ctrl-C interrupted the loop after this block and the loop is repeated.)
        if self._clock >= self._next_analog and self._seconds > 0.0:
            self._next_analog += ANALOG_SECONDS
            deviation = ANALOG_NOISE / math.sqrt(ANALOG_AVERAGED)
            self._analog = [self._board.analog(port, deviation) for port in range(ANALOG_PORTS)]
            # The mean of all conversions since: it sags by the mean current, which includes motors' pauses.
            self._battery = self._board.battery(self._volt_seconds / self._seconds)
            self._volt_seconds = self._seconds = 0.0
        if self._clock >= self._next_imu:
            self._next_imu += IMU_SECONDS
            self._read_imu()

    def _read_motors(self) -> tuple[list[int], list[int], int]:
        motors = self.motors.motors
        done = sum(motor.done << port for port, motor in enumerate(motors))
        return [int(motor.bemf) for motor in motors], [motor.position for motor in motors], done

    def _read_imu(self) -> None:
        if self._faults.imu_frozen:
            return
        if self._faults.imu_missing is not None:
            self._imu = bytes(_IMU.size)
            return
        gyro = tuple(math.degrees(rate) for rate in self._world(self._board.gyro()))
        x, y, z = (max(-ACCEL_RANGE, min(ACCEL_RANGE, force)) for force in self._board.accel())
        accel = self._world((x, y, z))
        linear = (accel[0] / GRAVITY, accel[1] / GRAVITY, accel[2] / GRAVITY - 1.0)
        quaternion = (math.cos(self._heading / 2), 0.0, 0.0, math.sin(self._heading / 2))
        clockwise_deg = -math.degrees(self._heading) % 360.0
        temperature = self._board.state.temperature
        still = (0.0, 0.0, 0.0)
        self._imu = _IMU.pack(
            *(*gyro, 3, *accel, 3, *still, 0, *linear, 3, *still, 3),
            *(*quaternion, 3, clockwise_deg, temperature),
            *(0.0,) * 6,  # odometry needs a kinematics configuration
        )

    def _world(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = vector
        cos, sin = math.cos(self._heading), math.sin(self._heading)
        return cos * x - sin * y, sin * x + cos * y, z

    @property
    def powered(self) -> bool:
        """Whether any motor is driven, apart from the pauses for measuring."""
        return any(motor.drive for motor in self.motors.motors)
