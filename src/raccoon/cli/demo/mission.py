"""The mission of the demo, written with the public API only: once open loop, by time, and once with the
library."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from raccoon import Action, Pose, after_time, deg, motors, seq, straight, turn, wait

# A Z over the table: legs in m, turns in rad.
LEGS = (0.60, 0.40, 0.40)
TURNS = (deg(90), deg(-90))
DISTANCE = sum(LEGS)
REST_AT_START_S = 1.0  # s at the start, as a robot waits for its start light


def goal() -> Pose:
    """The pose where the mission should end."""
    pose = Pose()
    for leg, angle in zip(LEGS, (*TURNS, 0.0), strict=True):
        pose = pose.ahead(leg).turned(angle)
    return pose


def closed_loop_mission() -> Action[Any]:
    """The mission in closed loop, by distances and angles."""
    first, second, third = LEGS
    return seq(
        wait(REST_AT_START_S),
        straight(first),
        turn(TURNS[0]),
        straight(second),
        turn(TURNS[1]),
        straight(third),
    )


@dataclass(frozen=True, slots=True)
class Times:
    """The times that a team measures on its table and writes into its program, all at full power.

    per_metre: s/m. per_radian: s/rad. metre_lost (m), radian_lost (rad): way and angle lost by starting and
    stopping.
    """

    per_metre: float
    per_radian: float
    metre_lost: float
    radian_lost: float

    def leg(self, distance: float) -> float:
        """Time at full power for `distance` m, s."""
        return (distance + self.metre_lost) * self.per_metre

    def spin(self, angle: float) -> float:
        """Time at full power for a turn on the spot by `angle` rad, s."""
        return (abs(angle) + self.radian_lost) * self.per_radian


def timed_mission(times: Times) -> Action[Any]:
    """The mission in open loop: full power for these times."""
    first, second, third = LEGS
    left, right = TURNS
    pause = wait(0.3)
    return seq(
        wait(REST_AT_START_S),
        _power(1.0, 1.0, times.leg(first)),
        pause,
        _power(-1.0, 1.0, times.spin(left)),
        pause,
        _power(1.0, 1.0, times.leg(second)),
        pause,
        _power(1.0, -1.0, times.spin(right)),
        pause,
        _power(1.0, 1.0, times.leg(third)),
        wait(0.5),
    )


def _power(left: float, right: float, seconds: float) -> Action[None]:
    return motors(left, right).until(after_time(seconds))
