"""The condition that two tophats are over a line that crosses the one between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError
from raccoon.robot.actions.condition import Condition, Test
from raccoon.robot.actions.limits import check_name
from raccoon.robot.motions.line_sight import MAX_INSIDE_DISTANCE_M, check_pair

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

BLACK_SPOTS, MIXED_SPOTS, MAX_WAY_BETWEEN_M = 1.8, 1.5, 0.02
"""Sum of the two spots' shares on black that is a crossing line, and up to which there is none; largest way
(m) from the second to the first: a spot takes half of it where the line lies 50 degrees off square."""


def at_crossing(left: str, right: str) -> Condition:
    """Both tophats come to black, at once or one soon after the other: another line crosses the one that they
    follow, or lies across the way.

    left, right: their names. Raises CalibrationError at the start without calibrations, and ConfigError for
    two tophats that fit on the line together: they cannot tell a crossing line.
    """
    check_name(left=left, right=right)

    def start(robot: Robot) -> Test:
        sensors = robot.tophat(left), robot.tophat(right)
        for each in sensors:
            each.require()
        mixed = -math.inf  # m of the way where it was not all black the last time

        def test() -> bool:
            nonlocal mixed
            here, first, second = robot.estimate.distance, sensors[0].coverage, sensors[1].coverage
            if first is None or second is None or not (sensors[0].sees and sensors[1].sees):
                return False
            if first + second < MIXED_SPOTS:
                mixed = here
            return first + second > BLACK_SPOTS and abs(here - mixed) < MAX_WAY_BETWEEN_M

        return test

    def check(robot: Robot) -> None:
        check_pair(robot, left, right)
        apart = robot.tophat(left).config.left - robot.tophat(right).config.left
        if apart < MAX_INSIDE_DISTANCE_M:
            raise ConfigError(
                f"tophats {left} and {right} are {apart:g} m apart in robot.toml: both fit on one line, so "
                f"they cannot see a crossing; allowed are {MAX_INSIDE_DISTANCE_M:g} m and more"
            )

    return Condition(f"{left} and {right} at a crossing", start, check=check)
