"""The measured facts and worked numbers of "Hardware and Ambient Variability in Botball Robots".

Tables I to III are data; every number the text works out is a `Figure` that computes it from them, so that a
test can hold the computation to the last printed digit.

One printed step does not follow from the numbers beside it: 7.0 V - 0.2 A * 0.05 ohm is 6.99 V, and the text
prints 6.95 V (and 6.05 V for 6.1 V), a drop of 0.05 V, and goes on from there. The printed drop is kept here,
since every later figure rests on it; it is what two motors at 0.2 A lose in 0.125 ohm, the resistance that
was measured on another fleet (0.12 ohm).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperMotor:
    """One row of Table I, measured running free at 6.6 V.

    speed rad/s, current A, armature_resistance ohm, back_emf_constant V/(rad/s), all at the wheel shaft.
    """

    name: str
    speed: float
    current: float
    armature_resistance: float
    back_emf_constant: float

    @property
    def friction_torque(self) -> float:
        """N m that the free-running motor works against: K_E I (K_T equals K_E in SI)."""
        return self.back_emf_constant * self.current


TABLE_VOLTAGE = 6.6
MOTORS = (
    PaperMotor("Motor 1", 5.731, 0.150, 1.7, 1.107),
    PaperMotor("Motor 2", 5.815, 0.160, 2.0, 1.080),
    PaperMotor("Motor 3", 5.973, 0.250, 1.7, 1.034),
)

TESTING_VOLTAGE = 6.1
COMPETITION_VOLTAGE = 7.0
VOLTAGE_DROP = 0.05  # as printed; see the module's text
AVERAGE_CURRENT = 0.2
ASSUMED_RESISTANCE = 2.0
ASSUMED_BACK_EMF_CONSTANT = 1.0


@dataclass(frozen=True, slots=True)
class TophatReading:
    """One cell pair of Tables II and III: 12-bit counts over white and over black.

    generation: "old" (EE-SB5) or "new" (EE-SF5). height: m above the floor. light: "normal" or "sun".
    """

    generation: str
    height: float
    light: str
    white: int
    black: int

    @property
    def contrast(self) -> int:
        """Counts between black and white."""
        return self.black - self.white


TOPHAT_READINGS = (
    TophatReading("old", 0.007, "normal", 180, 2930),
    TophatReading("old", 0.007, "sun", 50, 170),
    TophatReading("new", 0.007, "normal", 1270, 3800),
    TophatReading("new", 0.007, "sun", 140, 250),
    TophatReading("old", 0.023, "normal", 1830, 3810),
    TophatReading("old", 0.023, "sun", 50, 130),
    TophatReading("new", 0.023, "normal", 3440, 4030),
    TophatReading("new", 0.023, "sun", 130, 220),
)


def tophat_reading(generation: str, height: float, light: str) -> TophatReading:
    """The cell pair for a sensor generation, height (m) and light; KeyError where the paper has none."""
    for reading in TOPHAT_READINGS:
        if (reading.generation, reading.height, reading.light) == (generation, height, light):
            return reading
    raise KeyError((generation, height, light))


def motor_speed(voltage: float, current: float, resistance: float, back_emf_constant: float) -> float:
    """Rad/s of a DC motor at steady state: w = (U - I R_A) / K_E, from U = R I + K_E w with dI/dt = 0."""
    return (voltage - current * resistance) / back_emf_constant


def battery_speeds() -> tuple[float, float]:
    """Rad/s with the half-empty and with the fresh battery."""
    half_empty, fresh = (
        motor_speed(voltage - VOLTAGE_DROP, AVERAGE_CURRENT, ASSUMED_RESISTANCE, ASSUMED_BACK_EMF_CONSTANT)
        for voltage in (TESTING_VOLTAGE, COMPETITION_VOLTAGE)
    )
    return half_empty, fresh


def battery_speed_ratio() -> float:
    """Speed with a fresh battery over speed with a half-empty one: what a time-based distance gains."""
    half_empty, fresh = battery_speeds()
    return fresh / half_empty


def _resistance_speeds() -> tuple[float, float]:
    resistances = [motor.armature_resistance for motor in MOTORS]
    least, most = min(resistances), max(resistances)
    return motor_speed(6.6, 0.2, least, 1.08), motor_speed(6.6, 0.2, most, 1.08)


def _constant_speeds() -> tuple[float, float]:
    constants = [motor.back_emf_constant for motor in MOTORS]
    least, most = min(constants), max(constants)
    return motor_speed(6.6, 0.2, 1.8, least), motor_speed(6.6, 0.2, 1.8, most)


def extreme_motor_speeds() -> tuple[float, float]:
    """Rad/s of the fastest (3) and the slowest (1) measured motor at 6.6 V, from their own currents."""
    slow, fast = (
        motor_speed(TABLE_VOLTAGE, motor.current, motor.armature_resistance, motor.back_emf_constant)
        for motor in (MOTORS[0], MOTORS[2])
    )
    return fast, slow


def _difference(pair: tuple[float, float]) -> float:
    return pair[0] - pair[1]


def _percent(pair: tuple[float, float]) -> float:
    return 100.0 * (pair[0] - pair[1]) / pair[1]


def _back_emf_constant(index: int) -> float:
    motor = MOTORS[index]
    return (TABLE_VOLTAGE - motor.current * motor.armature_resistance) / motor.speed


def _contrast(generation: str, height: float, light: str) -> Callable[[], float]:
    return lambda: tophat_reading(generation, height, light).contrast


@dataclass(frozen=True, slots=True)
class Figure:
    """A number the paper prints, and how it follows from the tables.

    printed: the digits as they stand in the text. compute: the number, unrounded.
    """

    name: str
    printed: str
    unit: str
    compute: Callable[[], float]

    @property
    def reproduced(self) -> str:
        """The computed number with as many decimals as are printed."""
        decimals = len(self.printed.partition(".")[2])
        return f"{self.compute():.{decimals}f}"


FIGURES = (
    Figure(
        "voltage of a fresh battery over a half-empty one",
        "14.8",
        "%",
        lambda: _percent((COMPETITION_VOLTAGE, TESTING_VOLTAGE)),
    ),
    Figure("motor voltage, competition", "6.95", "V", lambda: COMPETITION_VOLTAGE - VOLTAGE_DROP),
    Figure("motor voltage, testing", "6.05", "V", lambda: TESTING_VOLTAGE - VOLTAGE_DROP),
    Figure("speed, testing", "5.65", "rad/s", lambda: battery_speeds()[0]),
    Figure("speed, competition", "6.55", "rad/s", lambda: battery_speeds()[1]),
    Figure("speed gained by a fresh battery", "0.9", "rad/s", lambda: -_difference(battery_speeds())),
    Figure("speed gained by a fresh battery", "15.9", "%", lambda: 100.0 * (battery_speed_ratio() - 1.0)),
    Figure("distance instead of 15 cm", "17.39", "cm", lambda: 15.0 * battery_speed_ratio()),
    Figure("K_E of motor 1", "1.107", "V/(rad/s)", lambda: _back_emf_constant(0)),
    Figure("K_E of motor 2", "1.080", "V/(rad/s)", lambda: _back_emf_constant(1)),
    Figure("K_E of motor 3", "1.034", "V/(rad/s)", lambda: _back_emf_constant(2)),
    Figure("speed at least R_A", "5.796", "rad/s", lambda: _resistance_speeds()[0]),
    Figure("speed at most R_A", "5.741", "rad/s", lambda: _resistance_speeds()[1]),
    Figure(
        "difference by R_A",
        "0.055",
        "rad/s",
        lambda: round(_resistance_speeds()[0], 3) - round(_resistance_speeds()[1], 3),
    ),
    Figure("difference by R_A", "1", "%", lambda: _percent(_resistance_speeds())),
    Figure("speed at least K_E", "6.035", "rad/s", lambda: _constant_speeds()[0]),
    Figure("speed at most K_E", "5.637", "rad/s", lambda: _constant_speeds()[1]),
    Figure("difference by K_E", "0.398", "rad/s", lambda: _difference(_constant_speeds())),
    Figure("difference by K_E", "7.1", "%", lambda: _percent(_constant_speeds())),
    Figure(
        "spread of K_E",
        "0.073",
        "V/(rad/s)",
        lambda: MOTORS[0].back_emf_constant - MOTORS[2].back_emf_constant,
    ),
    Figure("speed of motor 1", "5.732", "rad/s", lambda: extreme_motor_speeds()[1]),
    Figure("speed of motor 3", "5.972", "rad/s", lambda: extreme_motor_speeds()[0]),
    Figure("motor 3 over motor 1", "0.24", "rad/s", lambda: _difference(extreme_motor_speeds())),
    Figure("motor 3 over motor 1", "4.2", "%", lambda: _percent(extreme_motor_speeds())),
    Figure("voltage scaling k", "1.148", "", lambda: COMPETITION_VOLTAGE / TESTING_VOLTAGE),
    Figure(
        "new over old tophat, white, 7 mm, normal light",
        "1090",
        "counts",
        lambda: tophat_reading("new", 0.007, "normal").white - tophat_reading("old", 0.007, "normal").white,
    ),
    Figure(
        "old tophat, 7 mm, normal light: black over white",
        "2750",
        "counts",
        _contrast("old", 0.007, "normal"),
    ),
    Figure("old tophat, 7 mm, direct sun: black over white", "120", "counts", _contrast("old", 0.007, "sun")),
)
