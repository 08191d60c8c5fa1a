"""Where the robot is, how it moves, and how well both are known: wheels and gyro in one filter.

Once a cycle `Odometry.update` turns raw words into wheel angles and a turn rate, moves the drive filter on
to the newest gyro reading and gives a `DriveEstimate`. The pose is in the field frame, heading unwrapped
(docs/quantities.md); docs/odometry.md derives the filter and shows what it reaches.
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
"""s; the filter moves on with the first gyro reading after it (every 20 ms at 50 and at 200 Hz)."""
MAX_OBSERVATION_AGE_S = 2.0
"""s; what was seen longer ago is not taken any more."""


class Odometry:
    """Estimator of a two-wheel drive. Feed it every cycle.

    Makes its filterpy filter at construction (which imports filterpy: a second or two), never in a cycle.
    Raises ConfigError for settings or a geometry that make no sense.
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
        self._readings = DriveReadings(robot, settings.imu_latency)
        self._device = SIMULATOR
        self._stepper = FilterStepper(robot, settings, self._readings, self._device)
        self.resets = 0
        """How often the pose was set anew, after which nothing planned in the one before holds."""
        self.reset(x, y, heading)

    @property
    def estimate(self) -> DriveEstimate:
        """The newest estimate."""
        return self._estimate

    @property
    def wheel_scales(self) -> tuple[float, float]:
        """Speed as read over true speed, left and right: 1 where the calibration is right."""
        flat = self._stepper.fusion.drive.flat
        return wheel_scales(flat[State.WAY], flat[State.BALANCE])

    @property
    def gyro_scale(self) -> tuple[float, float]:
        """Turn rate as the gyro reads it over the true one, by robot.toml and by what was seen in the field;
        and its standard deviation."""
        flat = self._stepper.fusion.drive.flat
        return flat[State.GYRO_SCALE], math.sqrt(flat[variance_index(State.GYRO_SCALE)])

    @property
    def turn_share(self) -> float:
        """Turn by the gyro over that of the wheels, where all turns say that a number is far off; else 1."""
        return self._stepper.turn_share.value

    @property
    def held_way(self) -> float:
        """m that both wheels turned so far while they carry what they do at a wall; 0 where they do not."""
        return self._stepper.contact.held_way

    @property
    def slipped(self) -> bool:
        """Whether a wheel slipped since the robot last stood, in a motion that had begun well."""
        return self._stepper.fusion.slip.slipped

    @property
    def silent_wheels(self) -> tuple[bool, bool]:
        """Whether the left and the right wheel have said nothing for so long that their speed is not known:
        the estimate has 0 then, which is no reading.
        """
        return (
            self._readings.left.silence > HOLD_S,
            self._readings.right.silence > HOLD_S,
        )

    @property
    def wiring(self) -> Wiring:
        """Whether the robot turns as its wheels say."""
        return self._readings.wiring

    @property
    def pose_covariance(self) -> NDArray[np.float64]:
        """Covariance of x, y (m) and heading (rad), (3, 3).

        That of the filter's last step (at most 20 ms ago), and what the robot moves in the time by which its
        readings may be early or late.
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
        """Take the robot to be at this pose (m, m, rad); what is known of scales and offsets stays.

        position_std, heading_std: m and rad by which it may have been put down wrong; walls and lines that
        are seen later correct it. Raises ValueError for a value that is not finite, a heading that looks like
        degrees, or a deviation below 0.
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
        """Take the cycle `inputs`, read while `command` was in force, and give the estimate at its time.

        command: None where it is not known: the robot is then never taken to stand because nothing drives it.
        Never raises for what a sensor says; see `DriveEstimate.reasons`.
        """
        if inputs.device is not self._device:
            if inputs.device != self._device:  # a recording may say the same one anew
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
        """The robot was seen at a pose (m, m, rad), at `time` (None: now).

        A heading counts modulo a turn. Not believed (and not used) where it lies beyond the 99.9 % that the
        present uncertainty allows: after a kidnapping use `reset`. Raises ValueError for values that are not
        finite or a deviation that is not above 0.
        """
        return self._observe(pose_measurement(x, y, heading, position_std, heading_std), time)

    def observe_heading(self, heading: float, std: float, *, time: float | None = None) -> Observation:
        """The robot was seen heading this way, rad: aligned to a wall. Otherwise as `observe_pose`."""
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
        """A sensor crossed the line through `point` (m) along `direction` (rad).

        sensor: m ahead and m to the left of the robot's origin. std: m. Otherwise as `observe_pose`.
        """
        return self._observe(line_measurement(point, direction, sensor, std), time)

    def doubt_way(self, way: float) -> None:
        """Of the last `way` m (0 or more) that the wheels turned, the robot may have gone none: at a wall."""
        if way > 0.0:
            self._stepper.fusion.doubt_way(way)
            self._estimate = self._build_estimate()

    def mark(self) -> None:
        """Begin the way that `observe_distance` measures here; `reset` does so too."""
        self._stepper.fusion.wheel_travel = WheelTravel()

    def observe_distance(self, distance: float, std: float) -> Observation:
        """The robot went `distance` m (negative: back) since the mark, by tape; it stands now.

        Tells the wheels' scales, and through them corrects the pose. Otherwise as `observe_pose`.
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
        since = self._readings.pending.span + self._readings.waiting[0]
        found = self._stepper.fusion.observe(seen, shift, since, None if time == now else time)
        self._estimate = self._build_estimate()
        return found

    def _build_estimate(self) -> DriveEstimate:
        return build_estimate(self._stepper.fusion, self._readings, self._settings)
