"""Sections of a robot.toml: the robot's parts, ports, signs, calibrations and motions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from raccoon.core.errors import ConfigError
from raccoon.core.readings import ANALOG_PORTS, DIGITAL_PORTS, MOTOR_PORTS, SERVO_PORTS, SERVO_PULSE_US
from raccoon.core.schema import (
    BATTERY_VOLTAGE,
    Bounds,
    Measured,
    measured,
    named,
    number,
    optional,
    port,
    switch,
    word,
)

REAL_CONTROLLERS = ("wombat", "wombat-raccoon", "create")
"""Controllers that run in real time."""
SIMULATED_ONE = " (simulated)"
"""Suffix of a simulated robot's name in stores of measurements; no real robot has it."""
CONTROLLERS = (*REAL_CONTROLLERS, "sim", "emulator", "emulator-raccoon")
_PORT_HINTS = {
    "replay": "a recording is played by raccoon.replay(recording, program), or raccoon replay RECORDING"
}

# Bounds that any robot of this size is far within: they catch mistakes of units.
SPEED = Bounds(0.001, 3.0)
"""m/s, of the robot; a larger number is a speed in cm/s."""
RATE = Bounds(0.001, 20.0)
"""rad/s, of the robot or of a mechanism; a larger number is a rate in degrees."""
ACCELERATION = Bounds(0.001, 10_000.0)
JERK = Bounds(0.001, 1e6, or_zero=True)
TOLERANCE = Bounds(1e-6, 10.0)
DISTANCE_TOLERANCE, HEADING_TOLERANCE = Bounds(1e-6, 0.1), Bounds(1e-6, 0.3)
"""m and rad; a larger tolerance is one in mm or degrees."""


CYCLE_RATE = Bounds(20.0, 500.0)
"""Hz. In a longer cycle a wheel's speed changes by more than the speed loop and the odometry can follow: a
motor's time constant is 30 ms."""


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """`[controller]`: the controller that the program uses."""

    port: str = word("wombat", "what the program talks to", CONTROLLERS, _PORT_HINTS)
    rate_hz: float = number(200.0, "Hz", "cycles a second", CYCLE_RATE)
    device: str = word("", "path of a serial port or SPI device; empty: the usual one of this controller")
    counter_rate_hz: float = number(
        0.0,
        "Hz",
        "measured update rate of a Wombat's counters; 0: the usual one of its firmware",
        Bounds(50.0, 1000.0, or_zero=True),
    )


@dataclass(frozen=True, slots=True)
class BatteryConfig:
    """`[battery]`: the pack, and the voltages a match is planned for."""

    chemistry: str = word("lifepo4", "chemistry of the cells", ("lifepo4", "lipo", "nimh"))
    cells: float = number(2.0, "", "number of cells in series", Bounds(1.0, 12.0))
    weakest: float = number(
        6.1,
        "V",
        "lowest voltage of a match: motions are planned no faster than it can drive",
        BATTERY_VOLTAGE,
    )
    tuned_at: Measured | None = optional(
        "V", "resting voltage at which the program was tuned", BATTERY_VOLTAGE
    )


@dataclass(frozen=True, slots=True)
class DriveConfig:
    """`[drive]`: the two driven wheels."""

    left: int = port(0, "motor port of the left wheel", MOTOR_PORTS)
    right: int = port(1, "motor port of the right wheel", MOTOR_PORTS)


@dataclass(frozen=True, slots=True)
class BodyConfig:
    """`[body]`: the box that collides with simulated walls, and how hard it can push."""

    front: float = number(0.09, "m", "from the wheel axis to the flat front", Bounds(0.0, 1.0))
    back: float = number(0.09, "m", "from the wheel axis to the flat back", Bounds(0.0, 1.0))
    width: float = number(0.18, "m", "from the left side to the right", Bounds(0.01, 2.0))
    mass: float = number(3.0, "kg", "of the robot", Bounds(0.05, 50.0))
    grip: float = number(
        0.9,
        "",
        "largest push of both tyres before they spin, divided by the robot's weight",
        Bounds(0.01, 5.0),
    )


@dataclass(frozen=True, slots=True)
class MotorConfig:
    """`[motor.N]`: wiring and calibration of one motor port."""

    inverted: bool = switch(False, "true if positive duty turns the wheel backwards")
    radians_per_tick: Measured | None = optional(
        "rad",
        "wheel angle of one tick of the position counter; derived from the model when absent",
        # Ticks are 0.004 rad and far less with the two firmwares, 0.012 with a Create; a coarse encoder has
        # 90 per turn. The same in degrees (0.2) is beyond the bound, and so are ticks per radian.
        Bounds(1e-8, 0.1),
    )
    bemf_offset: Measured | None = optional("counts", "back-EMF reading at standstill", Bounds(-400.0, 400.0))
    power_factor: Measured = measured(
        1.0, 0.0, "", "static compensation k: the duty of this motor is multiplied by it", Bounds(0.5, 1.5)
    )
    static_voltage: Measured | None = optional(
        "V",
        "voltage against friction, the same at any speed; derived from the model when absent",
        Bounds(0.0, 30.0),
    )
    speed_voltage: Measured | None = optional(
        "V/(rad/s)",
        "voltage per unit of wheel speed; derived from the model when absent",
        Bounds(0.001, 100.0),
    )
    acceleration_voltage: Measured | None = optional(
        "V/(rad/s2)",
        "voltage per unit of wheel acceleration; derived from the model when absent",
        Bounds(1e-6, 100.0),
    )

    def before_model(self) -> dict[str, tuple[str, ...]]:
        """The given calibrations, each with the keys of [model] that it replaces: a program of the robot
        ignores those."""
        return {key: keys for key, keys in _BEFORE_MODEL.items() if getattr(self, key) is not None}


_BEFORE_MODEL: Mapping[str, tuple[str, ...]] = {
    "radians_per_tick": ("motor.back_emf_constant",),
    "bemf_offset": ("bemf.offset",),
    "static_voltage": ("friction.coulomb",),
    "speed_voltage": ("motor.back_emf_constant", "friction.viscous"),
    "acceleration_voltage": ("drive.inertia_straight",),
}


@dataclass(frozen=True, slots=True)
class TophatConfig:
    """`[tophat.NAME]`: one reflectance sensor and its position."""

    analog: int = port(0, "analog port", ANALOG_PORTS)
    forward: float = number(0.11, "m", "ahead of the wheel axis", Bounds(-1.0, 1.0))
    left: float = number(0.0, "m", "to the left of the middle", Bounds(-1.0, 1.0))


def _open_range(low: Measured | None, high: Measured | None) -> tuple[float, float]:
    """The range between two values; infinite on a side without one."""
    return -math.inf if low is None else low.value, math.inf if high is None else high.value


BOX_SIDES = ("front", "back", "left", "right")
"""Sides of the robot's box."""
PART_END = Bounds(-1.0, 1.0)


@dataclass(frozen=True, slots=True)
class BumperConfig:
    """`[bumper.NAME]`: one switch, and the part of the box that presses it in simulation."""

    digital: int = port(0, "digital port", DIGITAL_PORTS)
    side: str = word("front", "side of [body] that presses it in simulation", BOX_SIDES)
    begin: Measured | None = optional(
        "m",
        "start of the part that presses it: to the left of the middle (negative: right of it), or on the left"
        " and right side ahead of the wheel axis; start of the side when absent",
        PART_END,
    )
    end: Measured | None = optional("m", "end of that part, measured in the same way", PART_END)

    def __post_init__(self) -> None:
        low, high = self.part
        if low >= high:
            raise ConfigError(f"begin = {low:g}: it must be below end = {high:g}")

    @property
    def part(self) -> tuple[float, float]:
        """Range along its side, m to the left or forwards, in which it is pressed."""
        return _open_range(self.begin, self.end)

    def check_on(self, body: BodyConfig, where: str) -> None:
        """Raise ConfigError if no part of this side of the box can press it."""
        half = 0.5 * body.width
        side_low, side_high = (-half, half) if self.side in ("front", "back") else (-body.back, body.front)
        low, high = self.part
        if low >= side_high or high <= side_low:
            key, value = ("begin", low) if low >= side_high else ("end", high)
            raise ConfigError(
                f"{where}.{key} = {value:g}: the part is beyond the {self.side} side of [body], which goes"
                f" from {side_low:g} to {side_high:g} m"
            )


PULSE_BOUNDS = Bounds(float(SERVO_PULSE_US[0]), float(SERVO_PULSE_US[1]))


@dataclass(frozen=True, slots=True)
class ServoConfig:
    """`[servo.NAME]`: one servo, its mechanical range and its named positions."""

    port: int = port(0, "servo port", SERVO_PORTS)
    lowest_us: float = number(PULSE_BOUNDS.low, "us", "shortest pulse the mechanism stands", PULSE_BOUNDS)
    highest_us: float = number(PULSE_BOUNDS.high, "us", "longest pulse the mechanism stands", PULSE_BOUNDS)
    speed_us: float = number(
        3000.0, "us/s", "how fast the loaded servo turns, as change of pulse", Bounds(1.0, 1e6)
    )
    positions_us: Mapping[str, float] = named("us", "names for pulses, such as { open = 1200 }", PULSE_BOUNDS)

    def __post_init__(self) -> None:
        if self.lowest_us >= self.highest_us:
            raise ConfigError(
                f"lowest_us = {self.lowest_us:g}: it must be below highest_us = {self.highest_us:g}"
            )
        for name, pulse in self.positions_us.items():
            if not self.lowest_us <= pulse <= self.highest_us:
                raise ConfigError(
                    f"positions_us.{name} = {pulse:g}: allowed are numbers from {self.lowest_us:g} to"
                    f" {self.highest_us:g} us"
                )


STOP_BELOW, STOP_ABOVE = Bounds(-1e5, 0.0), Bounds(0.0, 1e5)


@dataclass(frozen=True, slots=True)
class MechanismConfig:
    """`[mechanism.NAME]`: an arm or a gripper on a motor of its own, besides the drive."""

    motor: int = port(2, "motor port", MOTOR_PORTS)
    speed: float = number(3.0, "rad/s", "of moves", RATE)
    acceleration: float = number(20.0, "rad/s2", "of moves", ACCELERATION)
    inertia: float = number(0.01, "kg m2", "that the motor feels", Bounds(1e-6, 100.0))
    tolerance: float = number(0.03, "rad", "a move ends this near its goal", TOLERANCE)
    turns: float = number(
        1.0,
        "turns",
        "full turns in each direction that a program may ask for; more for a winch",
        Bounds(0.01, 1e4),
    )
    lowest_stop: Measured | None = optional(
        "rad", "backward end stop in simulation, relative to the start; none when absent", STOP_BELOW
    )
    highest_stop: Measured | None = optional(
        "rad",
        "forward end stop in simulation; a program can home against either (spin until blocked)",
        STOP_ABOVE,
    )

    @property
    def stops(self) -> tuple[float, float]:
        """rad, end stops of the simulated mechanism, relative to its start."""
        return _open_range(self.lowest_stop, self.highest_stop)


@dataclass(frozen=True, slots=True)
class MotionConfig:
    """`[motion]`: default speeds of motions, and their tolerances."""

    speed: float = number(0.15, "m/s", "of straight motions", SPEED)
    acceleration: float = number(0.4, "m/s2", "of straight motions", ACCELERATION)
    turn_rate: float = number(1.5, "rad/s", "of turns", RATE)
    turn_acceleration: float = number(6.0, "rad/s2", "of turns", ACCELERATION)
    jerk: float = number(0.0, "m/s3", "of straight motions; 0 is no limit", JERK)
    turn_jerk: float = number(0.0, "rad/s3", "of turns; 0 is no limit", JERK)
    distance_tolerance: float = number(
        0.001, "m", "a straight motion ends this near its goal", DISTANCE_TOLERANCE
    )
    heading_tolerance: float = number(0.002, "rad", "a turn ends this near its goal", HEADING_TOLERANCE)
