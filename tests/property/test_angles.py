"""Angles keep their direction, whatever number of turns they carry."""

import math

from hypothesis import given
from hypothesis import strategies as st

from raccoon.model.angles import difference, wrapped

ANGLES = st.floats(-1e6, 1e6)


@given(ANGLES)
def test_wrapped_angle_is_in_its_half_open_turn_and_the_same_direction(angle: float) -> None:
    result = wrapped(angle)
    assert -math.pi <= result < math.pi
    assert math.isclose(math.cos(result), math.cos(angle), abs_tol=1e-8)
    assert math.isclose(math.sin(result), math.sin(angle), abs_tol=1e-8)


@given(ANGLES)
def test_wrapping_twice_is_wrapping_once(angle: float) -> None:
    once = wrapped(angle)
    assert abs(difference(wrapped(once), once)) < 1e-9


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_difference_added_again_gives_the_target(target: float, origin: float) -> None:
    assert abs(difference(origin + difference(target, origin), target)) < 1e-9
