"""Jerk-limited profiles."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.control.profile import ProfileState, SCurve, Trapezoid, profile

POSITIVE = st.floats(0.05, 5.0)


@given(st.floats(-2.0, 2.0), POSITIVE, POSITIVE, st.floats(0.5, 50.0))
def test_it_arrives_and_keeps_every_limit(d: float, speed: float, gain: float, jerk: float) -> None:
    curve = SCurve(d, speed, gain, jerk)
    steps = 400
    dt = curve.duration / steps
    before = curve.at(0.0)
    for step in range(1, steps + 1):
        now = curve.at(step * dt - 1e-12)
        assert abs(now.velocity) <= speed * (1 + 1e-9) + 1e-9
        assert abs(now.acceleration) <= gain * (1 + 1e-9) + 1e-9
        assert abs(now.acceleration - before.acceleration) <= jerk * dt * (1 + 1e-6) + 1e-6
        mean = 0.5 * (before.acceleration + now.acceleration)
        assert abs(now.velocity - before.velocity - mean * dt) <= 0.5 * jerk * dt * dt + 1e-6
        before = now
    assert before.position == pytest.approx(d, abs=1e-6)
    assert before.velocity == pytest.approx(0.0, abs=1e-6)
    assert curve.at(curve.duration + 1.0) == ProfileState(d, 0.0, 0.0)


@given(st.floats(0.05, 2.0), POSITIVE, POSITIVE, st.floats(0.5, 50.0), st.floats(0.02, 0.98))
def test_its_place_is_the_integral_of_its_speed(
    d: float, speed: float, gain: float, jerk: float, part: float
) -> None:
    """Which a difference over 2 h tells but for j h^2 / 6."""
    curve = SCurve(d, speed, gain, jerk)
    time, h = part * curve.duration, 1e-4 * curve.duration
    before, here, after = (curve.at(time + each) for each in (-h, 0.0, h))
    assert (after.position - before.position) / (2.0 * h) == pytest.approx(here.velocity, abs=jerk * h * h)


def test_with_a_huge_jerk_it_is_the_trapezoid() -> None:
    curve, trapezoid = SCurve(1.0, 0.2, 0.5, 1e6), Trapezoid(1.0, 0.2, 0.5)
    assert curve.duration == pytest.approx(trapezoid.duration, rel=1e-4)
    for time in (0.1, 0.7, 3.0, 5.0):
        assert curve.at(time).position == pytest.approx(trapezoid.at(time).position, abs=1e-4)


def test_profile_chooses_by_the_jerk() -> None:
    assert isinstance(profile(1.0, 0.2, 0.5), Trapezoid)
    assert isinstance(profile(1.0, 0.2, 0.5, 4.0), SCurve)
    with pytest.raises(ValueError, match="jerk is nan"):
        SCurve(1.0, 0.2, 0.5, math.nan)
