"""Places on the floor, by points that are known in another way."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.model.drive import arc_end
from raccoon.model.pose import Pose

PLACE = st.floats(-3.0, 3.0)
HEADING = st.floats(-7.0, 7.0)


def test_ahead_is_along_the_heading_and_left_is_a_quarter_turn_further() -> None:
    facing_up = Pose(1.0, 2.0, 0.5 * math.pi)
    there = facing_up.ahead(0.3)
    assert (there.x, there.y, there.heading) == pytest.approx((1.0, 2.3, 0.5 * math.pi))
    assert facing_up.offset_of(0.9, 2.5) == pytest.approx((0.5, 0.1))


@given(PLACE, PLACE, HEADING, PLACE, PLACE)
def test_a_point_of_its_frame_is_found_in_it_again(
    x: float, y: float, heading: float, ahead: float, left: float
) -> None:
    pose = Pose(x, y, heading)
    point = pose.ahead(ahead).turned(0.5 * math.pi).ahead(left)
    assert pose.offset_of(point.x, point.y) == pytest.approx((ahead, left), abs=1e-9)


@given(PLACE, PLACE, HEADING, st.floats(0.05, 2.0), st.sampled_from([-1.0, 1.0]), st.floats(-6.0, 6.0))
def test_an_arc_ends_where_wheels_on_it_do(
    x: float, y: float, heading: float, radius: float, side: float, angle: float
) -> None:
    """By its centre, to the left of the robot where the radius is above 0, and by its chord."""
    there = Pose(x, y, heading).along_arc(side * radius, angle)
    wanted = arc_end(x, y, heading, side * radius * angle, angle)
    assert (there.x, there.y, there.heading) == pytest.approx(wanted, abs=1e-9)
