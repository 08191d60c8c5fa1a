"""The measurements and derived numbers of "Hardware and Ambient Variability in Botball Robots".

Tables I to III are data; the numbers that the text derives from them follow, and a test compares each that it
prints to the last digit.

One printed step does not follow from the numbers beside it: 7.0 V - 0.2 A * 0.05 ohm is 6.99 V, but the text
prints 6.95 V (and 6.05 V for 6.1 V), a drop of 0.05 V, and continues from there. The printed drop is kept
here because every later figure depends on it; it is what two motors at 0.2 A lose in 0.125 ohm, the
resistance that was measured on another fleet (0.12 ohm).
"""

from __future__ import annotations

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
        """Friction torque of the free-running motor, N m: K_E I (K_T equals K_E in SI)."""
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
        """Difference of black and white, counts."""
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
    """The cell pair for a sensor generation, height (m) and light; KeyError if the paper has none."""
    for reading in TOPHAT_READINGS:
        if (reading.generation, reading.height, reading.light) == (generation, height, light):
            return reading
    raise KeyError((generation, height, light))


def motor_speed(voltage: float, current: float, resistance: float, back_emf_constant: float) -> float:
    """Speed of a DC motor at steady state, rad/s: w = (U - I R_A) / K_E, from U = R I + K_E w with dI/dt =
    0."""
    return (voltage - current * resistance) / back_emf_constant


def battery_speeds() -> tuple[float, float]:
    """Speed with the half-empty and with the fresh battery, rad/s."""
    half_empty, fresh = (
        motor_speed(voltage - VOLTAGE_DROP, AVERAGE_CURRENT, ASSUMED_RESISTANCE, ASSUMED_BACK_EMF_CONSTANT)
        for voltage in (TESTING_VOLTAGE, COMPETITION_VOLTAGE)
    )
    return half_empty, fresh


def battery_speed_ratio() -> float:
    """Speed with a fresh battery over that with a half-empty one: the factor by which a time-based distance
    grows."""
    half_empty, fresh = battery_speeds()
    return fresh / half_empty


def extreme_motor_speeds() -> tuple[float, float]:
    """Speeds of the fastest (3) and the slowest (1) measured motor at 6.6 V, rad/s, from their own
    currents."""
    slow, fast = (
        motor_speed(TABLE_VOLTAGE, motor.current, motor.armature_resistance, motor.back_emf_constant)
        for motor in (MOTORS[0], MOTORS[2])
    )
    return fast, slow
