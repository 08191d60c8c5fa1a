"""Profiles keep their limits, end where they must, and are as fast as can be."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from raccoon.control.profile import ProfileState, Trapezoid, profile

LIMITS = st.tuples(st.floats(-3.0, 3.0), st.floats(0.01, 2.0), st.floats(0.05, 10.0), st.floats(0.05, 10.0))


def test_closed_form_of_a_trapezoid() -> None:
    profile = Trapezoid(1.0, 0.5, 1.0, 2.0)
    # up 0.5 s / 0.125 m, down 0.25 s / 0.0625 m, the rest at 0.5 m/s
    assert profile.duration == pytest.approx(0.5 + 0.25 + (1.0 - 0.1875) / 0.5)
    assert profile.at(0.25).position == pytest.approx(0.5 * 0.25**2)
    assert profile.at(1.0).velocity == 0.5
    assert profile.at(profile.duration - 0.1).velocity == pytest.approx(0.2)
    assert [profile.at(time).acceleration for time in (0.25, 1.0, profile.duration - 0.1)] == [1.0, 0.0, -2.0]


def test_closed_form_of_a_triangle() -> None:
    profile = Trapezoid(-0.1, 5.0, 1.0)
    assert profile.duration == pytest.approx(2.0 * math.sqrt(0.1))
    assert profile.at(profile.duration / 2).velocity == pytest.approx(-math.sqrt(0.1))
    assert [profile.at(share * profile.duration).acceleration for share in (0.4, 0.6)] == [-1.0, 1.0]


@given(LIMITS)
@example((5e-324, 1.0, 1.0, 0.25))  # too short for any speed, and over at once
def test_keeps_its_limits_and_ends_on_the_mark(limits: tuple[float, float, float, float]) -> None:
    distance, speed, up, down = limits
    profile = Trapezoid(distance, speed, up, down)
    for step in range(101):
        state = profile.at(profile.duration * step / 100.0)
        assert abs(state.velocity) <= speed * (1 + 1e-9)
        assert -1e-9 <= state.position * math.copysign(1.0, distance) <= abs(distance) + 1e-9
        assert abs(state.acceleration) <= max(up, down)
    assert profile.at(profile.duration + 1.0) == ProfileState(distance, 0.0, 0.0)
    assert profile.at(-1.0) == ProfileState(0.0, 0.0, 0.0)


@given(LIMITS, st.floats(0.01, 0.99))
def test_velocity_is_the_slope_of_position(limits: tuple[float, float, float, float], share: float) -> None:
    profile = Trapezoid(*limits)
    time, step = profile.duration * share, profile.duration * 1e-5
    if step == 0.0:
        return
    slope = (profile.at(time + step).position - profile.at(time - step).position) / (2.0 * step)
    assert slope == pytest.approx(profile.at(time).velocity, abs=1e-3 * limits[1] + 1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((math.nan, 1.0, 1.0), "distance is nan"),
        ((1.0, 0.0, 1.0), "speed is 0.0: it must be above 0"),
        ((1.0, 1.0, -1.0), "acceleration is -1.0"),
        ((1.0, 1.0, 1.0, math.inf), "deceleration is inf"),
    ],
)
def test_impossible_limits_are_refused(arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Trapezoid(*arguments)


@pytest.mark.parametrize("jerk", [0.0, 2.0])
def test_a_profile_over_another_distance_keeps_its_limits(jerk: float) -> None:
    """Also where its own distance is too short to reach them."""
    for distance in (0.01, -0.4):
        other = profile(distance, 0.2, 0.4, jerk).over(-0.5)
        again = profile(-0.5, 0.2, 0.4, jerk)
        assert other.duration == again.duration
        assert other.at(0.7) == again.at(0.7)
