"""Every number the paper prints follows from its tables, to the last printed digit."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from raccoon.model.paper import (
    COMPETITION_VOLTAGE,
    MOTORS,
    TABLE_VOLTAGE,
    TESTING_VOLTAGE,
    VOLTAGE_DROP,
    PaperMotor,
    battery_speed_ratio,
    battery_speeds,
    extreme_motor_speeds,
    motor_speed,
    tophat_reading,
)


def _resistance_speeds() -> tuple[float, float]:
    resistances = [motor.armature_resistance for motor in MOTORS]
    least, most = min(resistances), max(resistances)
    return motor_speed(6.6, 0.2, least, 1.08), motor_speed(6.6, 0.2, most, 1.08)


def _constant_speeds() -> tuple[float, float]:
    constants = [motor.back_emf_constant for motor in MOTORS]
    least, most = min(constants), max(constants)
    return motor_speed(6.6, 0.2, 1.8, least), motor_speed(6.6, 0.2, 1.8, most)


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


@pytest.mark.parametrize("figure", FIGURES, ids=lambda each: f"{each.name} [{each.unit}]")
def test_printed_figures_are_reproduced(figure: Figure) -> None:
    assert figure.reproduced == figure.printed


@pytest.mark.parametrize("motor", MOTORS, ids=lambda motor: motor.name)
def test_table_one_is_consistent_with_the_motor_equation(motor: PaperMotor) -> None:
    speed = motor_speed(TABLE_VOLTAGE, motor.current, motor.armature_resistance, motor.back_emf_constant)
    assert speed == pytest.approx(motor.speed, abs=0.002)  # K_E is printed to 0.001


def test_friction_torque_of_the_measured_motors() -> None:
    assert [round(motor.friction_torque, 2) for motor in MOTORS] == [0.17, 0.17, 0.26]


def test_tables_two_and_three() -> None:
    assert tophat_reading("old", 0.007, "normal").white == 180
    assert tophat_reading("old", 0.023, "normal").white == 1830
    assert tophat_reading("new", 0.007, "normal").white == 1270
    assert tophat_reading("new", 0.023, "normal").white == 3440
    assert tophat_reading("new", 0.023, "normal").black == 4030
    with pytest.raises(KeyError):
        tophat_reading("new", 0.010, "normal")
