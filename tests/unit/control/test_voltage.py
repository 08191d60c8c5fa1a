"""The paper's voltage scaling, and the speed that the weakest battery can give."""

import math

import pytest

from raccoon.control.feedforward import WheelModel
from raccoon.control.voltage import SpeedBudget, VoltageScaling
from raccoon.model.paper import COMPETITION_VOLTAGE, TESTING_VOLTAGE

WHEEL = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)


def test_the_paper_s_factor_and_its_limit() -> None:
    scaling = VoltageScaling(COMPETITION_VOLTAGE)
    full = scaling.scale_duty(1.0, TESTING_VOLTAGE)
    assert round(full.factor, 3) == 1.148
    assert full.duty == 1.0
    assert full.saturated
    assert scaling.scale_duty(-1.0, TESTING_VOLTAGE).duty == -1.0
    assert scaling.scale_duty(0.0, TESTING_VOLTAGE).missing == 0.0
    assert full.missing == pytest.approx(1.0 - TESTING_VOLTAGE / COMPETITION_VOLTAGE)
    most = scaling.scale_duty(0.8, TESTING_VOLTAGE)
    assert most.duty == pytest.approx(0.8 * 7.0 / 6.1)
    assert not most.saturated


@pytest.mark.parametrize("voltage", [None, 0.0, 2.0, float("nan"), float("inf")])
def test_an_impossible_battery_scales_by_one(voltage: float | None) -> None:
    assert VoltageScaling(7.0).scale_duty(-0.5, voltage).duty == -0.5


def test_nonsense_is_refused() -> None:
    for reference in (1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match=rf"reference is {reference} V"):
            VoltageScaling(reference)
    for duty in (1.5, -1.5, math.nan):
        with pytest.raises(ValueError, match=rf"duty is {duty}"):
            VoltageScaling(7.0).scale_duty(duty, 6.6)


def test_the_budget_s_speed_needs_exactly_the_budget_s_voltage() -> None:
    budget = SpeedBudget(weakest=6.1, internal_resistance=0.1, reserve=0.05)
    speed = budget.top_wheel_speed(WHEEL, acceleration=10.0)
    current = (WHEEL.inertia * 10.0 + WHEEL.viscous * speed + WHEEL.coulomb) / WHEEL.back_emf_constant
    at_motor = (6.1 - 2.0 * 0.1 * current) * 0.95
    assert WHEEL.voltage(speed, 10.0) == pytest.approx(at_motor)


def test_a_weaker_battery_a_harder_start_and_a_dead_one_are_slower() -> None:
    assert SpeedBudget(6.1).top_wheel_speed(WHEEL) < SpeedBudget(7.0).top_wheel_speed(WHEEL)
    assert SpeedBudget(6.1).top_wheel_speed(WHEEL, 20.0) < SpeedBudget(6.1).top_wheel_speed(WHEEL)
    assert SpeedBudget(0.1).top_wheel_speed(WHEEL) == 0.0
