"""Odometry: the estimate of pose and motion, with standard deviations, from wheels and gyro in one filter.

In every cycle `Odometry.update` converts the raw words to wheel angles and a turn rate, moves the drive
filter on to the newest gyro reading and returns a `DriveEstimate`. The pose is in the field frame, its
heading unwrapped (docs/quantities.md). docs/odometry.md derives the filter and states its accuracy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, STOP, Inputs, Outputs
from raccoon.estimate.drive.estimate import DriveEstimate, Observation
from raccoon.estimate.drive.estimate_builder import build_estimate, pose_covariance
from raccoon.estimate.drive.observations import (
    PoseMeasurement,
    WheelTravel,
    heading_measurement,
    line_measurement,
    pose_measurement,
)
from raccoon.estimate.drive.readings import DriveReadings
from raccoon.estimate.drive.stepper import FilterStepper
from raccoon.estimate.drive.timing import believed_delay_motion
from raccoon.estimate.drive.wheel_track import HOLD_S
from raccoon.estimate.drive.wiring import Wiring
from raccoon.estimate.ekf.filter import variance_index
from raccoon.estimate.ekf.state import OdometrySettings, State, wheel_scales
from raccoon.model.drive import arc_end
from raccoon.model.pose import check_heading_unit

__all__ = ["DriveEstimate", "Observation", "Odometry", "OdometrySettings"]

DEFAULTS = OdometrySettings()
STEP_S = 0.0175
"""s; the filter moves on with the first gyro reading after this time (every 20 ms at 50 and at 200 Hz)."""
MAX_OBSERVATION_AGE_S = 2.0
"""s, maximum age of an observation; an older one is rejected."""


class Odometry:
    """Estimator of a two-wheel drive. Call `update` in every cycle.

    The constructor makes the filterpy filter (importing filterpy takes a second or two); no cycle imports it.
    Raises ConfigError for implausible settings or geometry.
    """

    def __init__(
        self,
        robot: RobotConfig,
        *,
        x: float = 0.0,
        y: float = 0.0,
        heading: float = 0.0,
        settings: OdometrySettings = DEFAULTS,
    ) -> None:
        self._settings = settings
        self._readings = DriveReadings(robot)
        self._device = SIMULATOR
        self._stepper = FilterStepper(robot, settings, self._readings, self._device)
        self.resets = 0
        """Number of times the pose was set. Plans made in the previous pose are invalid after that."""
        self.reset(x, y, heading)

    @property
    def estimate(self) -> DriveEstimate:
        """The newest estimate."""
        return self._estimate

    @property
    def wheel_scales(self) -> tuple[float, float]:
        """Speed as read over true speed, of the left and right wheel; 1 if the calibration is right."""
        flat = self._stepper.fusion.drive.flat
        return wheel_scales(flat[State.WAY], flat[State.BALANCE])

    @property
    def gyro_scale(self) -> tuple[float, float]:
        """Turn rate as read by the gyro over the true one, from robot.toml and the observations so far, and
        its standard deviation."""
        flat = self._stepper.fusion.drive.flat
        return flat[State.GYRO_SCALE], math.sqrt(flat[variance_index(State.GYRO_SCALE)])

    @property
    def turn_share(self) -> float:
        """Turn by the gyro over turn by the wheels if all turns show that a scale is far off; otherwise 1."""
        return self._stepper.turn_share.value

    @property
    def held_way(self) -> float:
        """m that both wheels turned since their load became as high as at a wall; 0 while it is not."""
        return self._stepper.contact.held_way

    @property
    def slipped(self) -> bool:
        """Whether a wheel slipped since the robot last stood, in a motion that had begun without slip."""
        return self._stepper.fusion.slip.slipped

    @property
    def silent_wheels(self) -> tuple[bool, bool]:
        """Whether the left and the right wheel gave no reading for so long that their speed is unknown. The
        estimate's wheel speed of 0 is then no reading."""
        return (
            self._readings.left.silence > HOLD_S,
            self._readings.right.silence > HOLD_S,
        )

    @property
    def wiring(self) -> Wiring:
        """The check of the wheels' signs against the gyro: does the robot turn as its wheels read?"""
        return self._readings.wiring

    @property
    def pose_covariance(self) -> NDArray[np.float64]:
        """Covariance of x, y (m) and heading (rad), (3, 3).

        It is that of the filter's last step (at most 20 ms ago), plus the motion of the robot in the time by
        which its readings may be early or late.
        """
        return pose_covariance(self._stepper.fusion.drive.flat, self._estimate, self._settings.timing)

    def reset(
        self,
        x: float = 0.0,
        y: float = 0.0,
        heading: float = 0.0,
        *,
        position_std: float = 0.0,
        heading_std: float = 0.0,
    ) -> None:
        """Set the robot's pose (m, m, rad); the learnt scales and offsets stay.

        position_std, heading_std: standard deviations of that pose, m and rad; later observations of walls
        and lines correct it. Raises ValueError for a value that is not finite, a heading that looks like
        degrees, or a standard deviation below 0.
        """
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)):
            raise ValueError(f"pose ({x}, {y}, {heading}): every value must be finite")
        check_heading_unit("heading", heading)
        for name, std in (("position_std", position_std), ("heading_std", heading_std)):
            if not 0.0 <= std < math.inf:
                raise ValueError(f"{name} is {std}: allowed are finite numbers from 0")
        travel, turn = believed_delay_motion(self._stepper.fusion.drive.flat, self._settings.timing)
        self._stepper.place(*arc_end(x, y, heading, -travel, -turn))
        self._stepper.fusion.drive.widen((State.X, State.Y), position_std)
        self._stepper.fusion.drive.widen((State.HEADING,), heading_std)
        self._readings.clear()
        self.resets += 1
        self._estimate = self._build_estimate()

    def update(self, inputs: Inputs, command: Outputs | None = STOP) -> DriveEstimate:
        """Process the cycle `inputs`, read while `command` was in force; returns the estimate at its time.

        command: None if it is unknown; the robot then never counts as standing still. Never raises for a bad
        sensor reading; see `DriveEstimate.reasons`.
        """
        if inputs.device is not self._device:
            if inputs.device != self._device:  # a recording may contain an equal device again
                self._stepper.configure(inputs.device)
            self._device = inputs.device
        self._stepper.contact.take_command(inputs, command)
        if self._readings.take(inputs) and self._readings.pending.span > STEP_S:
            self._stepper.advance(command)
        self._estimate = self._build_estimate()
        return self._estimate

    def observe_pose(
        self,
        x: float,
        y: float,
        heading: float,
        *,
        position_std: float,
        heading_std: float,
        time: float | None = None,
    ) -> Observation:
        """Update the filter with an observed pose (m, m, rad) of the robot at `time` (s; None: now).

        A heading counts modulo a full turn. The observation is rejected if it is beyond the 99.9 % gate of
        the present uncertainty: after the robot was moved by hand use `reset`. Raises ValueError for values
        that are not finite or a standard deviation that is not above 0.
        """
        return self._observe(pose_measurement(x, y, heading, position_std, heading_std), time)

    def observe_heading(self, heading: float, std: float, *, time: float | None = None) -> Observation:
        """Update the filter with an observed heading and its std, rad, as after an alignment with a wall.
        Otherwise as `observe_pose`."""
        return self._observe(heading_measurement(heading, std), time)

    def observe_line(
        self,
        point: tuple[float, float],
        direction: float,
        *,
        sensor: tuple[float, float],
        std: float,
        time: float | None = None,
    ) -> Observation:
        """Update the filter with a sensor that crossed the line through `point` (m) along `direction` (rad).

        sensor: its position, m ahead and m to the left of the robot's origin. std: m, of the crossing's
        distance from the line. Otherwise as `observe_pose`.
        """
        return self._observe(line_measurement(point, direction, sensor, std), time)

    def doubt_way(self, way: float) -> None:
        """Add uncertainty: of the last `way` m (0 or more) that the wheels turned, the robot may have moved
        none, as at a wall."""
        if way > 0.0:
            self._stepper.fusion.doubt_way(way)
            self._estimate = self._build_estimate()

    def mark(self) -> None:
        """Start the distance that `observe_distance` measures; `reset` does so too."""
        self._stepper.fusion.wheel_travel = WheelTravel()

    def observe_distance(self, distance: float, std: float) -> Observation:
        """Update the filter with the distance (m, negative: backwards) since the mark, by tape; the robot
        stands.

        It corrects the wheels' scales, and through them the pose. Otherwise as `observe_pose`.
        """
        found = self._stepper.fusion.observe_way(distance, std)
        self._estimate = self._build_estimate()
        return found

    def _observe(self, seen: PoseMeasurement, time: float | None) -> Observation:
        now = self._readings.time
        if time is not None and not now - MAX_OBSERVATION_AGE_S <= time <= now:
            allowed = f"the {MAX_OBSERVATION_AGE_S:g} s before {now} s"
            return Observation(False, math.nan, f"seen at {time} s: allowed are {allowed}")
        flat = self._stepper.fusion.drive.flat
        here = self._estimate
        shift = np.array([here.x - flat[State.X], here.y - flat[State.Y], here.heading - flat[State.HEADING]])
        since = self._readings.pending.span
        found = self._stepper.fusion.observe(seen, shift, since, None if time == now else time)
        self._estimate = self._build_estimate()
        return found

    def _build_estimate(self) -> DriveEstimate:
        return build_estimate(self._stepper.fusion, self._readings, self._settings)
