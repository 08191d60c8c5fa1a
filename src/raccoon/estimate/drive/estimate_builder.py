"""The odometry's present estimate: the filter's state, moved on by the readings since its last step."""

from __future__ import annotations

import math
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import Status
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.fusion import Fusion
from raccoon.estimate.drive.noise import SILENT_WHEEL
from raccoon.estimate.drive.readings import DriveReadings
from raccoon.estimate.drive.timing import delay_motion, wheels_lead
from raccoon.estimate.drive.wheel_track import HOLD_S
from raccoon.estimate.ekf.filter import covariance_index, covariance_of, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import OdometrySettings, State, wheel_scales
from raccoon.model.drive import DriveGeometry, arc_end

_VAR = {state: variance_index(state) for state in State}
_VX, _VY, _VH = _VAR[State.X], _VAR[State.Y], _VAR[State.HEADING]
_VV, _VW, _VB = _VAR[State.VELOCITY], _VAR[State.TURN_RATE], _VAR[State.GYRO_BIAS]
_VWAY, _WITH_WAY = _VAR[State.WAY], covariance_index(State.VELOCITY, State.WAY)


UNCERTAIN_HEADING, INVALID_HEADING = math.radians(5.0), math.radians(25.0)
UNCERTAIN_PLACE, INVALID_PLACE = 0.10, 0.50
"""m, standard deviation of the position."""
POSE_DOUBT_REASONS = (
    f"the position is uncertain by {UNCERTAIN_PLACE:g} m or more: drive to a wall or a line, and set its "
    "position by robot.odometry.reset(x, y, heading)",
    f"the heading is uncertain by {math.degrees(UNCERTAIN_HEADING):g} degrees or more: "
    "align_on_wall(heading=...) corrects it",
)
"""Reasons of an estimate whose standard deviation is above these thresholds, even if their cause has long
passed."""
INVALID_AFTER_SILENCE_S = 0.5
"""s without any wheel reading after which the pose is invalid."""


def build_estimate(fusion: Fusion, readings: DriveReadings, settings: OdometrySettings) -> DriveEstimate:
    """The estimate at the time of the last cycle."""
    flat, geometry = fusion.drive.flat, fusion.geometry
    scales = wheel_scales(flat[State.WAY], flat[State.BALANCE])
    left_speed = (readings.left.speed - flat[State.LEFT_OFFSET]) / scales[0]
    right_speed = (readings.right.speed - flat[State.RIGHT_OFFSET]) / scales[1]
    x, y, heading = flat[State.X], flat[State.Y], flat[State.HEADING]
    way, velocity_read = flat[State.WAY], flat[State.VELOCITY]
    velocity, turn_rate, distance = way * velocity_read, flat[State.TURN_RATE], fusion.distance
    span = readings.pending.span
    if span > 0.0:
        velocity, turn_rate = geometry.body_motion(left_speed, right_speed)
        turn_rate /= way * flat[State.WHEEL_TURN]
        travel, turn, gyro_rate = motion_since_step(flat, scales, readings, geometry)
        turn_rate = turn_rate if gyro_rate is None else gyro_rate
        x, y, heading = arc_end(x, y, heading, travel, turn)
        distance += travel
    lead, lead_std = wheels_lead(flat, settings.timing)
    x, y, heading = arc_end(x, y, heading, *delay_motion(flat, lead, velocity, turn_rate))
    along_std = lead_std * velocity
    if min(readings.left.silence, readings.right.silence) > HOLD_S:  # the step that is waiting will add it
        along_std = math.hypot(along_std, math.sqrt(0.5 * SILENT_WHEEL * span) * geometry.wheel_radius)
    x_std, y_std = along_std * math.cos(heading), along_std * math.sin(heading)
    heading_std = lead_std * turn_rate
    # Variance of the product of scale and speed read; the two are correlated.
    velocity_variance = (
        way * way * flat[_VV]
        + 2.0 * way * velocity_read * flat[_WITH_WAY]
        + velocity_read * velocity_read * flat[_VWAY]
    )
    if fusion.may_be_held:
        velocity_variance += velocity * velocity
    return DriveEstimate(
        readings.time,
        x,
        y,
        heading,
        velocity,
        turn_rate,
        flat[State.GYRO_BIAS],
        left_speed,
        right_speed,
        distance,
        sqrt(flat[_VX] + x_std * x_std),
        sqrt(flat[_VY] + y_std * y_std),
        sqrt(flat[_VH] + heading_std * heading_std),
        sqrt(max(velocity_variance, 0.0)),
        sqrt(flat[_VW]),
        sqrt(flat[_VB]),
        *_status(flat, readings),
    )


def _status(flat: Flat, readings: DriveReadings) -> tuple[Status, tuple[str, ...]]:
    """Status of the estimate, and the reasons for it."""
    place, heading, reasons = flat[_VX] + flat[_VY], flat[_VH], readings.reasons.now
    if place > UNCERTAIN_PLACE**2:
        reasons = (*reasons, POSE_DOUBT_REASONS[0])
    if heading > UNCERTAIN_HEADING**2:
        reasons = (*reasons, POSE_DOUBT_REASONS[1])
    blind = min(readings.left.silence, readings.right.silence) > INVALID_AFTER_SILENCE_S
    if blind or readings.wiring.turned or place > INVALID_PLACE**2 or heading > INVALID_HEADING**2:
        return Status.INVALID, reasons
    return (Status.UNCERTAIN if reasons else Status.OK), reasons


def motion_since_step(
    flat: Flat, scales: tuple[float, float], readings: DriveReadings, geometry: DriveGeometry
) -> tuple[float, float, float | None]:
    """Travel (m) and turn (rad) since the filter's last step, and the gyro's turn rate in it (rad/s; None
    without a reading)."""
    pending, span = readings.pending, readings.pending.span
    left = (pending.left - flat[State.LEFT_OFFSET] * span) / scales[0]
    right = (pending.right - flat[State.RIGHT_OFFSET] * span) / scales[1]
    travel, turn = geometry.body_motion(left, right)
    turn /= flat[State.WAY] * flat[State.WHEEL_TURN]
    known = pending.gyro_span
    if known <= 0.0:
        return travel, turn, None
    rate = (pending.turn / known - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
    return travel, rate * span, rate


def pose_covariance(flat: Flat, here: DriveEstimate, timing: float) -> NDArray[np.float64]:
    """Covariance of x, y (m) and heading (rad), (3, 3): the filter's, plus the robot's motion in the time by
    which its readings may be early or late."""
    late = wheels_lead(flat, timing)[1]
    along, turned = late * here.velocity, late * here.turn_rate
    moved = np.array([along * math.cos(here.heading), along * math.sin(here.heading), turned])
    P = covariance_of(flat)[: State.VELOCITY, : State.VELOCITY]
    found: NDArray[np.float64] = P + np.outer(moved, moved)
    return found
