"""One step of the drive filter: the readings that it takes, and the state after it."""

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
    """Deviations that a robot at rest that seems to creep adds to the state.

    offsets: rad/s, of both wheels. bias: rad/s, of the gyro, and seconds: s for which it has turned the
    heading. heading, place: rad and m besides.
    """

    offsets: float
    bias: float
    seconds: float
    heading: float
    place: float

    def add_to(self, drive: DriveFilter) -> None:
        """Widen the filter's covariance by it."""
        drive.widen((State.LEFT_OFFSET, State.RIGHT_OFFSET), self.offsets)
        drive.widen_bias(self.bias, self.seconds)
        drive.widen((State.HEADING,), self.heading)
        drive.widen((State.X, State.Y), self.place)


@dataclass(frozen=True, slots=True)
class StepReading:
    """What was read over `span` s until `time`.

    values, variances: left and right wheel (rad/s, nominal scale) and, where there is one, the gyro (rad/s).
    turn_acceleration: rad/s2. differential_variance: (rad/s)^2 by which one wheel reads more and the other
    less. still: the robot stood. turn_timing_std: rad of the heading, where it is not known when in the step
    a turn began. along_variance: m^2 of the place along the heading, where the robot may stand while its
    wheels turn, or roll on while a motor at fault reads nothing. across_variance: m^2 across the heading,
    where something pushed it. end_speeds: the wheels' speeds at its end, rad/s, where a part of the step is a
    gap in the readings; values are then the mean by the counters, variances and differential_variance those
    of the angles, rad^2, and angle_covariance, rad^2, of both angles. is_wheel_mute: nothing is taken of one
    wheel, so there is nothing to judge the other one by. way_doubt: what `ScaleDoubt` added in this step.
    added_scale_std: added to the scales before it, because they turned out wrong. rest_doubt: likewise, by
    what standing showed.
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
        """(rad/s)^2 by which the mean turn rate is in doubt, that of the gyro and that of when it changed."""
        return self.variances[2] + (self.turn_timing_std / self.span) ** 2

    @property
    def may_slide(self) -> bool:
        """Whether the robot may have moved otherwise than its wheels turned."""
        return self.along_variance > 0.0 or self.across_variance > 0.0

    def without_turn_of_wheels(self, variance: float) -> StepReading:
        """The same with a turn by the gyro alone: (rad/s)^2 more doubt about the wheels' difference."""
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
        """Its end, s."""
        return self.reading.time
