import math

import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.model.drive import DriveGeometry, arc_end

GEOMETRY = DriveGeometry(wheel_radius=0.05, track_width=0.2)


def test_a_right_wheel_that_runs_faster_turns_left() -> None:
    assert GEOMETRY.body_motion((0.1 - 0.05) / 0.05, (0.1 + 0.05) / 0.05) == pytest.approx((0.1, 0.5))
    assert GEOMETRY.body_motion((0.13 + 0.07) / 0.05, (0.13 - 0.07) / 0.05) == pytest.approx((0.13, -0.7))


def test_quarter_circle_to_the_left_ends_ahead_and_left() -> None:
    x, y, heading = arc_end(1.0, 2.0, 0.0, 0.3 * math.pi / 2, math.pi / 2)
    assert (x, y, heading) == pytest.approx((1.3, 2.3, math.pi / 2))


def test_tiny_turn_is_as_exact_as_a_large_one() -> None:
    turn = 0.9999e-4
    x, y, _ = arc_end(0.0, 0.0, 0.0, 1.0, turn)
    assert x == pytest.approx(math.sin(turn) / turn, rel=1e-15)
    assert y == pytest.approx((1 - math.cos(turn)) / turn, rel=1e-6)


def test_geometry_of_a_robot_is_that_of_its_model() -> None:
    assert DriveGeometry.from_robot(RobotConfig()) == DriveGeometry(0.0345, 0.16)


@pytest.mark.parametrize("length", [0.0, -0.1, math.nan, math.inf])
def test_a_length_that_is_not_above_zero_is_refused(length: float) -> None:
    with pytest.raises(ConfigError, match="track_width"):
        DriveGeometry(0.05, length)
