"""Paths of straight pieces with rounded corners."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.control.path import Path, split_at_reversals

CORNER = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]


def test_a_corner_is_rounded_and_the_end_is_the_last_point() -> None:
    path = Path(CORNER, rounding=0.2)
    assert path.length == pytest.approx(0.8 + 0.2 * math.pi / 2.0 + 0.8)
    assert (path.at(path.length).pose.x, path.at(path.length).pose.y) == pytest.approx((1.0, 1.0))
    assert path.at(path.length).pose.heading == pytest.approx(math.pi / 2.0)
    assert max(piece.curvature for piece in path.pieces) == pytest.approx(5.0)
    middle = path.at(0.8 + 0.1 * math.pi / 2.0)
    assert middle.pose.heading == pytest.approx(math.pi / 4.0)
    assert middle.curvature == pytest.approx(5.0)


def test_two_points_are_a_straight_line() -> None:
    path = Path([(0.2, 0.1), (0.2, -0.4)])
    assert path.length == pytest.approx(0.5)
    assert path.start.heading == pytest.approx(-0.5 * math.pi)
    assert (path.at(0.1).pose.x, path.at(0.1).pose.y) == pytest.approx((0.2, 0.0))


def test_a_rounding_that_does_not_fit_is_made_smaller() -> None:
    """Half of the shorter of its two sides is there for each corner."""
    path = Path([(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (1.0, 0.1)], rounding=1.0)
    assert [piece.curvature for piece in path.pieces if piece.curvature] == pytest.approx([20.0, -20.0])
    assert (path.at(path.length).pose.x, path.at(path.length).pose.y) == pytest.approx((1.0, 0.1))


def test_a_slight_kink_after_half_a_turn_keeps_the_heading_unwrapped() -> None:
    back = [(-0.1, 0.3), (-0.1333333, 0.2333333), (-0.2, 0.1)]  # in a line but for the last digit
    path = Path([(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5), *back], rounding=0.1)
    assert path.at(path.length).pose.heading == pytest.approx(math.pi + math.atan(2.0), abs=1e-5)


@given(st.lists(st.tuples(st.floats(0.0, 0.3), st.floats(-0.5, 0.5)), min_size=2, max_size=6))
def test_it_is_continuous_and_nearest_finds_its_own_points(bends: list[tuple[float, float]]) -> None:
    points, x = [(0.0, 0.0)], 0.0
    for ahead, y in bends:
        x += ahead + 0.1
        points.append((x, y))
    path = Path(points, rounding=0.05)
    before = path.at(0.0).pose
    for step in range(1, 51):
        way = path.length * step / 50.0
        here = path.at(way).pose
        assert math.dist((before.x, before.y), (here.x, here.y)) <= path.length / 50.0 + 1e-9
        assert path.nearest(here.x, here.y, way - 0.002) == pytest.approx(way, abs=1e-3)
        before = here
    assert (before.x, before.y) == pytest.approx(points[-1], abs=1e-6)


def test_legs_end_where_the_path_turns_back() -> None:
    there, back = (1.0, 0.0), (0.0, 0.01)
    assert split_at_reversals([*CORNER, CORNER[-1]]) == [CORNER]
    assert split_at_reversals([(0.0, 0.0), there, back, (0.0, 1.0)]) == [
        [(0.0, 0.0), there],
        [there, back, (0.0, 1.0)],
    ]
    assert split_at_reversals([there, back, there, back]) == [[there, back], [back, there], [there, back]]


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="1 different points"):
        Path([(0.1, 0.1), (0.1, 0.1)])
    for aside in (0.01, -0.01):
        with pytest.raises(ValueError, match="turns back at"):
            Path([(0.0, 0.0), (1.0, 0.0), (0.0, aside)])
    for rounding in (0.0, -0.1, math.inf, math.nan):
        with pytest.raises(ValueError, match=f"rounding is {rounding} m"):
            Path(CORNER, rounding)
    for point in ((math.nan, 0.1), (0.1, math.inf)):
        with pytest.raises(ValueError, match="both numbers must be finite"):
            Path([(0.0, 0.0), point])
