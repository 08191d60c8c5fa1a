"""From where a robot is to the velocities that keep it to a line or a turn."""

import math

import pytest

from raccoon.control.motion import limit_slew, line_command, turn_command
from raccoon.control.profile import ProfileState

AHEAD = ProfileState(position=0.3, velocity=0.2, acceleration=0.0)


def test_a_robot_on_its_line_and_in_time_drives_as_planned() -> None:
    assert line_command(AHEAD, 0.3, 0.0, 0.0) == (0.2, 0.0)


def test_a_gap_along_the_line_is_closed_no_faster_than_allowed() -> None:
    assert line_command(AHEAD, 0.298, 0.0, 0.0)[0] == pytest.approx(0.2 + 5.0 * 0.002)
    assert line_command(AHEAD, 0.1, 0.0, 0.0)[0] == pytest.approx(0.26)
    assert line_command(AHEAD, 0.9, 0.0, 0.0)[0] == pytest.approx(0.14)


@pytest.mark.parametrize("velocity", [0.2, -0.2])
def test_it_comes_back_to_the_line_whichever_way_it_drives(velocity: float) -> None:
    """y' = v h, h' = the turn rate: 2 cm beside the line and 0.1 rad askew both fade."""
    across, heading, dt = 0.02, 0.1, 0.005
    for _ in range(600):
        reference = ProfileState(0.0, velocity, 0.0)
        heading += line_command(reference, 0.0, across, heading)[1] * dt
        across += velocity * math.sin(heading) * dt
    assert abs(across) < 1e-3
    assert abs(heading) < 1e-2


def test_at_its_best_speed_it_comes_back_as_fast_as_goes_without_overshoot() -> None:
    """y = y0 (1 + 2 t) exp(-2 t), where 120 v^2 = 4^2 / 4."""
    velocity, dt = 2.0 / math.sqrt(120.0), 1e-3
    across, heading = 0.01, 0.0
    for step in range(1, 2001):
        _, turn_rate = line_command(ProfileState(0.0, velocity, 0.0), 0.0, across, heading)
        heading += dt * turn_rate
        across += dt * velocity * heading
        assert across == pytest.approx(0.01 * (1.0 + 2.0 * dt * step) * math.exp(-2.0 * dt * step), abs=5e-5)


def test_a_robot_that_stands_beside_its_line_does_not_turn_for_it() -> None:
    assert line_command(ProfileState(0.0, 0.0, 0.0), 0.0, 0.05, 0.0)[1] == 0.0


def test_a_turn_that_is_behind_is_sped_up() -> None:
    assert turn_command(ProfileState(1.0, 1.5, 0.0), 0.9) == pytest.approx(1.5 + 6.0 * 0.1)


def test_a_wish_is_followed_by_steps() -> None:
    assert [limit_slew(0.1, wanted, 0.02) for wanted in (0.5, 0.11, -0.5)] == pytest.approx(
        [0.12, 0.11, 0.08]
    )
