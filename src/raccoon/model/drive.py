"""Kinematics of a two-wheel drive: wheel speeds, body motion and the arc between them.

Both wheels roll on one axis of length `track_width`; the robot's origin is its middle. With v_L, v_R the
speeds of the wheels' contacts (wheel speed times radius)::

    v = (v_L + v_R) / 2        turn rate = (v_R - v_L) / track width

Units and signs: docs/quantities.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError


@dataclass(frozen=True, slots=True)
class DriveGeometry:
    """Wheel radius and track width, m.

    Raises ConfigError for a length that is not above 0.
    """

    wheel_radius: float
    track_width: float

    def __post_init__(self) -> None:
        for name in ("wheel_radius", "track_width"):
            length = getattr(self, name)
            if not (math.isfinite(length) and length > 0.0):
                raise ConfigError(f"{name} is {length} m: allowed are numbers above 0")

    @classmethod
    def from_robot(cls, robot: RobotConfig) -> DriveGeometry:
        """The geometry of `[model.drive]`."""
        return cls(robot.model.drive.wheel_radius.value, robot.model.drive.track_width.value)

    def body_motion(self, left: float, right: float) -> tuple[float, float]:
        """(velocity m/s, turn rate rad/s) of wheel speeds in rad/s, or (travel m, turn rad) of wheel
        angles.
        """
        scale = self.wheel_radius
        return 0.5 * (left + right) * scale, (right - left) * scale / self.track_width


def arc_end(x: float, y: float, heading: float, travel: float, turn: float) -> tuple[float, float, float]:
    """Pose (m, m, rad) after `travel` m along an arc that turns by `turn` rad.

    The chord of an arc has length travel * sin(turn/2) / (turn/2) and points along the middle heading.
    """
    half = 0.5 * turn
    # Below this the series is exact to the last bit and sin(half) / half is not.
    ratio = math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0
    chord = travel * ratio
    return x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + turn
