"""What the odometry says: the drive's estimate at a time, and what became of an observation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.readings import Status
from raccoon.model.pose import Pose

HELD = "held: both wheels carry what tyres do that spin at a wall"
"""The reason of an estimate whose robot may not move though its wheels turn."""
SLIPS = {side: f"the {side} wheel slips" for side in ("left", "right")}
"""By side, the reason of one whose wheel turns otherwise than the robot moves."""
AT_REST = "a motor at rest reads motion"
"""The reason of an estimate that takes what a motor reads at rest, and no offset explains, for motion."""


@dataclass(frozen=True, slots=True)
class DriveEstimate:
    """Pose and motion of the robot at `time`, with one standard deviation each.

    time s · x, y m · heading rad, unwrapped · velocity m/s, forward · turn_rate rad/s · gyro_bias rad/s ·
    left_speed, right_speed: rad/s of the wheels, without the board's filter lag, for a speed loop ·
    distance: m, signed integral of the velocity since the start or `reset` ·
    status and reasons: how far to trust it, and why not further.
    """

    time: float
    x: float
    y: float
    heading: float
    velocity: float
    turn_rate: float
    gyro_bias: float
    left_speed: float
    right_speed: float
    distance: float
    x_std: float
    y_std: float
    heading_std: float
    velocity_std: float
    turn_rate_std: float
    gyro_bias_std: float
    status: Status = Status.OK
    reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        """For people: where it is and how sure that is, how it moves, and how far to trust all of it."""
        std, heading_std = 1e3 * math.hypot(self.x_std, self.y_std), math.degrees(self.heading_std)
        place = f"{Pose(self.x, self.y, self.heading)} (+- {std:.1f} mm, {heading_std:.2f} deg)"
        moves = f"{self.velocity:z.3f} m/s, {self.turn_rate:z.3f} rad/s"
        return "; ".join((f"{place}, {moves}, {self.status}", *self.reasons))


@dataclass(frozen=True, slots=True)
class Observation:
    """What became of something seen.

    mahalanobis: how many standard deviations it lay from what was expected, all values together.
    reason: why it was not accepted; empty where it was.
    """

    accepted: bool
    mahalanobis: float
    reason: str = ""
