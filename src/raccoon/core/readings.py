"""Data of a port: one `Inputs` per cycle from the robot, one `Outputs` per cycle to it.

`Inputs` holds the device's raw words and the `Device` that defines their meaning, so a recording stays valid
if a conversion was wrong. Signs of axes are the same for every port (docs/quantities.md); signs of wiring
belong to robot.toml.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

MOTOR_PORTS = 4
SERVO_PORTS = 4
SERVO_PULSE_US = (600, 2400)
"""us, shortest and longest pulse of a controller."""
ANALOG_PORTS = 6
DIGITAL_PORTS = 10
ANALOG_FULL_SCALE = 4095
"""Counts, largest reading of any controller's analog port."""
ANALOG_BOTTOM, ANALOG_TOP = 4.0, 4083.0
"""Counts at and beyond which a reading is at an end of the converter's range: rising, a stock filter stops at
4086."""

Words = tuple[float | None, ...]
"""One word per port; None if the port has no (new) reading."""
Flags = tuple[bool | None, ...]
NO_ANALOG: Words = (None,) * ANALOG_PORTS
NO_DIGITAL: Flags = (None,) * DIGITAL_PORTS
Vector = tuple[float, float, float]


class Status(StrEnum):
    """Reliability of an estimate. Uncertainty is a value, not an exception."""

    OK = "ok"
    UNCERTAIN = "uncertain"
    INVALID = "invalid"


class Fault(StrEnum):
    """Faults of a cycle that a port can detect."""

    LINK_DEAD = "link_dead"
    """The frame carried no data; every word is None."""
    STALE = "stale"
    """The controller repeats its words; its main loop may be frozen."""
    RESET = "reset"
    """The controller restarted: positions jumped and commands were lost."""
    POSITION_JUMP = "position_jump"
    """A position does not continue the last one."""
    TORN = "torn"
    """A word was read while the controller wrote it; it was read again or left out."""
    MISALIGNED = "misaligned"
    """The frame was shifted and had to be aligned again."""
    IMU_FROZEN = "imu_frozen"
    """The IMU repeats its words or is missing; they are left out."""
    IMU_IMPLAUSIBLE = "imu_implausible"
    """The IMU reports impossible values, or lies on its side; its words are left out."""
    COMMAND_LOST = "command_lost"
    """A command did not arrive; it was sent again."""
    OVERRUN = "overrun"
    """The cycle came later than its deadline."""
    BROWN_OUT = "brown_out"
    """The battery is so low that the controller may restart."""
    MOTOR_FAULT = "motor_fault"
    """A driven motor gives no back-EMF: stalled, unplugged or its fuse tripped."""
    BEMF_INVALID = "bemf_invalid"
    """A back-EMF reading cannot be right: an offset at rest, or beyond the range that the controller
    measures."""
    BEMF_FROZEN = "bemf_frozen"
    """The back-EMF of a turning motor has been the same for `BEMF_FROZEN_SECONDS`, which no motor gives: its
    converter has stopped. The words of that motor are left out."""
    ANALOG_SATURATED = "analog_saturated"
    """A watched analog port is at the end of its range."""
    SENSOR_LOST = "sensor_lost"
    """An added sensor (I2C, USB) does not answer; its words are missing."""


BEMF_FROZEN_SECONDS = 0.3
"""s. The quietest converter, with a noise of 3 counts, repeats a word for up to 0.2 s after the filters of
the firmwares, once in an hour of driving; real motors are far noisier."""


@dataclass(frozen=True, slots=True)
class Device:
    """Meaning of a device's words. A word times its scale is in SI units.

    position_counts_seconds: back-EMF counts times seconds in one tick of a position counter.
    bemf_lag: s by which filtered back-EMF and the counters that sum it are behind the motor: the present
    angle is that of the counter plus `bemf_lag` times the back-EMF. None if the device does not know it; then
    model.bemf.filter_time_constant of robot.toml is used, as it is whenever robot.toml gives one.
    bemf_dead_zone: counts; motion with a smaller back-EMF may be reported as 0, and not be counted.
    bemf_range: counts beyond which a motor's back-EMF and counter stand still; None if there is no such
    limit.
    driven_share: part of the time in which a motor under a duty is powered; in the rest it coasts, and its
    back-EMF is read.
    """

    name: str
    bemf_volts: float
    position_counts_seconds: float
    gyro_rad_s: float
    accel_m_s2: float
    battery_volts: float
    analog_full_scale: int = ANALOG_FULL_SCALE
    bemf_lag: float | None = None
    bemf_dead_zone: float = 0.0
    driven_share: float = 1.0
    bemf_range: float | None = None


@dataclass(frozen=True, slots=True)
class Truth:
    """Pose of the robot by a reference system (simulator, motion capture, calibration board).

    x, y in m, heading in rad (unwrapped); surface: black (True) or white under each analog port. Estimators
    never read it.
    """

    x: float
    y: float
    heading: float
    surface: Flags = ()


@dataclass(frozen=True, slots=True)
class Inputs:
    """One cycle of readings, in raw words.

    time: s, monotonic, by the port's own clock. bemf: filtered back-EMF counts per motor port.
    position: counter ticks per motor port, unwrapped to 64 bits by the port.
    gyro, accel: x forward, y left, z up, counter-clockwise positive; accel is specific force (at rest +1 g on
    z).
    analog: ADC counts. digital: True is pressed. battery: ADC counts. None: absent, or no new reading in this
    cycle.
    extra: further channels of a recording or an added sensor, in SI, by trace column name; "button" is 1
    while the Wombat's own button is pressed.
    """

    time: float
    device: Device
    bemf: Words = (None,) * MOTOR_PORTS
    position: Words = (None,) * MOTOR_PORTS
    gyro: Vector | None = None
    accel: Vector | None = None
    analog: Words = NO_ANALOG
    digital: Flags = NO_DIGITAL
    battery: float | None = None
    faults: tuple[Fault, ...] = ()
    truth: Truth | None = None
    extra: Mapping[str, float] | None = None

    @property
    def battery_voltage(self) -> float | None:
        """V; None if there is no reading."""
        return None if self.battery is None else self.battery * self.device.battery_volts

    @property
    def turn_rate(self) -> float | None:
        """rad/s about the vertical axis by the gyro, counter-clockwise positive; None if there is no
        reading."""
        return None if self.gyro is None else self.gyro[2] * self.device.gyro_rad_s


class _Draft:
    """`Inputs` during construction: the same layout, not yet frozen."""

    __slots__ = Inputs.__slots__


def quick_inputs(
    time: float,
    device: Device,
    bemf: Words,
    position: Words,
    gyro: Vector | None,
    accel: Vector | None,
    analog: Words,
    digital: Flags,
    battery: float | None,
    faults: tuple[Fault, ...],
    extra: Mapping[str, float] | None,
) -> Inputs:
    """`Inputs` for the loop on the robot, from a port that knows every field except the truth.

    The constructor of a frozen dataclass costs as much as the rest of reading a frame; this makes the same
    object at a fifth of that.
    """
    draft: Any = _Draft()
    draft.time = time
    draft.device = device
    draft.bemf = bemf
    draft.position = position
    draft.gyro = gyro
    draft.accel = accel
    draft.analog = analog
    draft.digital = digital
    draft.battery = battery
    draft.faults = faults
    draft.truth = None
    draft.extra = extra
    draft.__class__ = Inputs
    made: Inputs = draft
    return made


@dataclass(frozen=True, slots=True)
class Outputs:
    """The complete command of one cycle.

    duty: -1..1 per motor port, before any wiring sign. brake: short-circuit the motor while its duty is 0.
    servo_us: pulse in microseconds (600..2400); None switches the servo off.

    Raises ValueError for a duty that is not a number in -1..1, a pulse outside its range, or another number
    of them than there are ports.
    """

    duty: tuple[float, ...] = (0.0,) * MOTOR_PORTS
    brake: tuple[bool, ...] = (False,) * MOTOR_PORTS
    servo_us: tuple[int | None, ...] = (None,) * SERVO_PORTS

    def __post_init__(self) -> None:
        if not len(self.duty) == len(self.brake) == MOTOR_PORTS or len(self.servo_us) != SERVO_PORTS:
            given = f"{len(self.duty)} duties, {len(self.brake)} brakes and {len(self.servo_us)} servos"
            raise ValueError(f"{given} were given: there are {MOTOR_PORTS} motors and {SERVO_PORTS} servos")
        for port, duty in enumerate(self.duty):
            if not -1.0 <= duty <= 1.0:
                raise ValueError(f"duty of motor {port} is {duty}: allowed are numbers from -1 to 1")
        for port, pulse in enumerate(self.servo_us):
            low, high = SERVO_PULSE_US
            if pulse is not None and not low <= pulse <= high:
                raise ValueError(f"pulse of servo {port} is {pulse} us: allowed are {low} to {high}")


STOP = Outputs()
"""All motors coast, all servos off."""

GRAVITY = 9.80665
"""m/s2, standard gravity: the unit of accelerometers."""

# The Wombat's terminal voltage reaches a 12-bit, 3.3 V converter through 2.2 of 9.0 kOhm.
BEMF_VOLTS_PER_COUNT = 3.3 / 4096 * 9.0 / 2.2
# 100k / 10k divider in front of the same converter.
BATTERY_VOLTS_PER_COUNT = 3.3 * 11 / 4096
STOCK_COASTS, RACCOON_COASTS = 0.24, 0.1
"""Share of the time in which a motor coasts for the measurement of its back-EMF: all motors at once on the
stock firmware, 500 us of 5 ms on RaccoonOS."""

SIMULATOR = Device(
    name="simulator",
    bemf_volts=BEMF_VOLTS_PER_COUNT,
    position_counts_seconds=1.0,
    gyro_rad_s=3.141592653589793 / 180 / 16.4,
    accel_m_s2=GRAVITY / 8192,
    battery_volts=BATTERY_VOLTS_PER_COUNT,
)
"""The simulated controller: RaccoonOS counters, the stock IMU registers. (A simulated one with another chain
has a longer name.)"""

SI_WORDS = Device(
    name="si",
    bemf_volts=BEMF_VOLTS_PER_COUNT,
    position_counts_seconds=1.0,
    gyro_rad_s=1.0,
    accel_m_s2=1.0,
    battery_volts=1.0,
)
"""A recording in the units of the CSV interchange format."""
