"""Every number the paper prints follows from its tables, to the last printed digit."""

import pytest

from raccoon.model.paper import (
    FIGURES,
    MOTORS,
    TABLE_VOLTAGE,
    Figure,
    PaperMotor,
    motor_speed,
    tophat_reading,
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
