"""Driving to places and along paths, judged by the robot's true pose."""

import inspect
import math
from collections.abc import Callable
from typing import Any, Literal

import pytest

from raccoon import MotionTimeout, align_on_line, arc, deg, seq, straight, turn, turn_to
from raccoon.robot.motions.goals import pivot
from raccoon.robot.motions.paths import drive_to, follow_path
from robots import run

WHEEL: Any = "middle"


@pytest.mark.parametrize("backwards", [False, True])
def test_drive_to_ends_at_the_pose(backwards: bool) -> None:
    result, end, _ = run(drive_to(0.25, 0.15, deg(90), backwards=backwards))
    assert (end.x, end.y) == pytest.approx((0.25, 0.15), abs=0.004)
    assert math.degrees(math.remainder(end.heading, math.tau)) == pytest.approx(90.0, abs=0.6)
    assert abs(result.along) < 0.002


def test_drive_to_where_it_is_only_turns() -> None:
    _, end, _ = run(drive_to(0.0, 0.0, deg(-45)))
    assert math.hypot(end.x, end.y) < 0.004
    assert math.degrees(end.heading) == pytest.approx(-45.0, abs=0.6)


def test_a_path_is_followed_through_its_rounded_corners() -> None:
    points = [(0.15, 0.0), (0.15, 0.2), (0.3, 0.2)]
    result, end, robot = run(follow_path(points, rounding=0.1))
    assert (end.x, end.y) == pytest.approx((0.3, 0.2), abs=0.004)
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.6)
    assert robot.plan.x == pytest.approx(0.3)
    assert abs(result.across) < 0.002


def test_a_path_is_followed_with_the_back_first() -> None:
    points = [(-0.15, 0.0), (-0.15, -0.2), (-0.3, -0.2)]
    result, end, robot = run(seq(straight(0.05), follow_path(points, rounding=0.1, backwards=True)))
    assert (end.x, end.y) == pytest.approx((-0.3, -0.2), abs=0.004)
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.6)
    assert robot.plan.heading == pytest.approx(0.0, abs=1e-9)
    assert abs(result[1].across) < 0.002
    _, end, robot = run(follow_path([(0.1, 0.0), (0.1, 0.1)], backwards=True))  # it turns around first
    assert (end.x, end.y) == pytest.approx((0.1, 0.1), abs=0.006)
    assert math.degrees(math.remainder(end.heading, math.tau)) == pytest.approx(-90.0, abs=1.0)
    assert math.hypot(robot.plan.x - robot.pose.x, robot.plan.y - robot.pose.y) < 0.002


def test_the_turn_of_a_path_counts_and_has_the_same_time() -> None:
    result, _, _ = run(follow_path([(0.0, 0.1)]))
    alone, _, _ = run(straight(0.1))
    assert result.duration > alone.duration + 0.8
    with pytest.raises(MotionTimeout, match=r"turn not done after 0.3 s"):
        run(follow_path([(0.0, 0.1)], timeout=0.3))


@pytest.mark.parametrize(
    "motion",
    [straight, turn, turn_to, arc, pivot, drive_to, follow_path, align_on_line],
    ids=lambda motion: motion.__name__,
)
def test_what_one_motion_takes_its_sisters_take(motion: Callable[..., object]) -> None:
    takes = inspect.signature(motion).parameters
    for name in ("tolerance", "timeout"):
        assert takes[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert takes[name].default is None
    assert "backwards" in takes or motion not in (drive_to, follow_path, arc)


def test_only_a_corner_is_driven_slowly_and_not_the_whole_path() -> None:
    """0.69 m of straights at 0.15 m/s and 0.15 m of arcs, of 25 mm, at a quarter of it: 4.6 and 4.0 s."""
    result, end, _ = run(follow_path([(0.5, 0.0), (0.15, 0.1), (0.7, 0.1)], speed=0.15))
    assert (end.x, end.y) == pytest.approx((0.7, 0.1), abs=0.006)
    assert result.duration < 11.0


def test_a_path_begins_with_the_first_point_at_which_the_robot_is_not() -> None:
    near = [(0.1, 0.0), (0.101, 0.002)]
    parts = straight(0.1), follow_path(near[:1]), follow_path([*near, (0.25, 0.0)])
    (_, there, onward), end, _ = run(seq(*parts))
    assert there.duration == 0.0
    assert (end.x, end.y, end.heading) == pytest.approx((0.25, 0.0, 0.0), abs=0.01)
    assert onward.duration < 1.7  # it did not turn to a point 2 mm away


def test_a_robot_that_comes_from_where_the_path_leads_stops_and_turns() -> None:
    """Where it is, nobody knows when the path is made: in the middle of a match that must be no error."""
    result, end, robot = run(follow_path([(0.3, 0.0), (0.3, 0.0), (0.1, 0.01), (0.1, 0.2)]))
    assert (end.x, end.y) == pytest.approx((0.1, 0.2), abs=0.01)
    assert math.degrees(math.remainder(end.heading, math.tau)) == pytest.approx(90.0, abs=1.0)
    assert (robot.plan.x, robot.plan.y) == pytest.approx((0.1, 0.2))
    assert abs(result.along) < 0.002
    assert result.duration > 5.0


def test_the_same_point_twice_is_one() -> None:
    _, end, _ = run(follow_path([(0.2, 0.0), (0.2, 0.0)]))
    assert (end.x, end.y) == pytest.approx((0.2, 0.0), abs=0.004)


@pytest.mark.parametrize(("angle_deg", "wheel"), [(90, "left"), (90, "right"), (-60, "left")])
def test_pivot_keeps_one_wheel_where_it_is(angle_deg: float, wheel: Literal["left", "right"]) -> None:
    _, end, robot = run(pivot(deg(angle_deg), wheel))
    side = robot.drive.half_track * (1 if wheel == "left" else -1)
    at = (end.x - side * math.sin(end.heading), end.y + side * math.cos(end.heading))
    assert at == pytest.approx((0.0, side), abs=0.004)
    assert math.degrees(end.heading) == pytest.approx(angle_deg, abs=0.8)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: drive_to(math.nan, 0.0), "x is nan"),
        (lambda: pivot(1.0, WHEEL), "wheel is 'middle'"),
        (lambda: follow_path([]), "points is empty"),
        (lambda: follow_path([(0.1, 0.0), (0.4, 0.0), (0.1, 0.001)]), r"turns back at \(0.4, 0\)"),
        (lambda: follow_path([(0.1, math.inf), (0.2, 0.0)]), r"point \(0.1, inf\)"),
        (lambda: follow_path([(0.1, 0.0)], rounding=0.0), "rounding is 0.0"),
    ],
)
def test_nonsense_is_refused_before_anything_moves(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
