"""Results of the odometry: the estimate of the drive at a time, and whether an observation was accepted."""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.readings import Status
from raccoon.model.pose import Pose

HELD = "held: both wheels carry as much load as when tyres spin at a wall"
"""Reason of an estimate whose robot may not move although its wheels turn."""
SLIPS = {side: f"the {side} wheel slips" for side in ("left", "right")}
"""By side, the reason of an estimate whose wheel turns otherwise than the robot moves."""
AT_REST = "a motor at rest reads motion"
"""Reason of an estimate that counts a motor's reading at rest, which no offset explains, as motion."""


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
        """Readable text: pose and its standard deviations, motion, status and reasons."""
        std, heading_std = 1e3 * math.hypot(self.x_std, self.y_std), math.degrees(self.heading_std)
        place = f"{Pose(self.x, self.y, self.heading)} (+- {std:.1f} mm, {heading_std:.2f} deg)"
        moves = f"{self.velocity:z.3f} m/s, {self.turn_rate:z.3f} rad/s"
        return "; ".join((f"{place}, {moves}, {self.status}", *self.reasons))


@dataclass(frozen=True, slots=True)
class Observation:
    """Whether an observation was accepted.

    mahalanobis: its distance from the expected values, in standard deviations, all values together. reason:
    why it was not accepted; empty if it was.
    """

    accepted: bool
    mahalanobis: float
    reason: str = ""
