"""One step of the drive filter: the readings that it uses, and the state after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from raccoon.estimate.drive.estimate import Observation
from raccoon.estimate.drive.scale_doubt import NO_DOUBT
from raccoon.estimate.ekf.filter import DriveFilter
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State


@dataclass(frozen=True, slots=True)
class RestDoubt:
    """Standard deviations to add to the state because a robot at rest seems to creep.

    offsets: rad/s, of both wheels. bias: rad/s, of the gyro; it has turned the heading for `seconds` s.
    heading, place: further ones of heading (rad) and position (m).
    """

    offsets: float
    bias: float
    seconds: float
    heading: float
    place: float

    def add_to(self, drive: DriveFilter) -> None:
        """Add them to the filter's covariance."""
        drive.widen((State.LEFT_OFFSET, State.RIGHT_OFFSET), self.offsets)
        drive.widen_bias(self.bias, self.seconds)
        drive.widen((State.HEADING,), self.heading)
        drive.widen((State.X, State.Y), self.place)


@dataclass(frozen=True, slots=True)
class StepReading:
    """The readings over `span` s until `time`.

    values, variances: of the left and right wheel (rad/s, nominal scale) and, if there is one, the gyro
    (rad/s).
    turn_acceleration: rad/s2. still: the robot stood.
    differential_variance: (rad/s)^2, of an error that adds to one wheel's speed and subtracts from the
    other's.
    turn_timing_std: rad, of the heading, because the time at which a turn began within the step is unknown.
    along_variance: m^2, of the position along the heading, because the robot may stand while its wheels turn,
    or roll on while a motor at fault gives no reading. across_variance: m^2, across the heading, because of a
    push.
    end_speeds: rad/s of the wheels at the end of the step if a part of it is a gap in the readings. Then
    `values` are means by the counters; variances and differential_variance are those of the angles, rad^2,
    and angle_covariance is the covariance of both angles, rad^2.
    is_wheel_mute: one wheel's reading is not used, so nothing can be compared with the other one.
    way_doubt: standard deviations that `ScaleDoubt` added in this step.
    added_scale_std: relative, added to both scales before the step because they turned out to be wrong.
    rest_doubt: added likewise, because of what standing showed.
    """

    time: float
    span: float
    values: tuple[float, ...]
    variances: tuple[float, ...]
    turn_acceleration: float
    differential_variance: float
    still: bool
    turn_timing_std: float = 0.0
    along_variance: float = 0.0
    across_variance: float = 0.0
    end_speeds: tuple[float, float] | None = None
    angle_covariance: float = 0.0
    is_wheel_mute: bool = False
    way_doubt: tuple[float, float] = NO_DOUBT
    added_scale_std: float = 0.0
    rest_doubt: RestDoubt | None = None

    @property
    def gyro_variance(self) -> float:
        """(rad/s)^2, variance of the mean turn rate: of the gyro, and of the time at which the rate
        changed."""
        return self.variances[2] + (self.turn_timing_std / self.span) ** 2

    @property
    def may_slide(self) -> bool:
        """Whether the robot may have moved otherwise than its wheels turned."""
        return self.along_variance > 0.0 or self.across_variance > 0.0

    def without_turn_of_wheels(self, variance: float) -> StepReading:
        """The same step with its turn by the gyro alone: (rad/s)^2 added to the differential variance."""
        doubt = self.differential_variance + variance
        return replace(self, turn_acceleration=0.0, differential_variance=doubt)


@dataclass(frozen=True, slots=True)
class FilterStep:
    """One step of the filter: its readings, the observations after it, and the state after both."""

    reading: StepReading
    flat: Flat
    observations: tuple[Callable[[], Observation], ...] = ()

    @property
    def time(self) -> float:
        """End of the step, s."""
        return self.reading.time
