"""What a step of the drive filter takes, and what it leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from raccoon.estimate.drive.estimate import Observation
from raccoon.estimate.drive.scales import NOTHING
from raccoon.estimate.ekf.filter import DriveFilter
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State


@dataclass(frozen=True, slots=True)
class RestDoubt:
    """What a robot at rest that seems to creep adds to what is not known, as deviations.

    offsets: rad/s, of both wheels. bias: rad/s, of the gyro, and seconds: s for which it has turned the
    heading. heading, place: rad and m besides.
    """

    offsets: float
    bias: float
    seconds: float
    heading: float
    place: float

    def add_to(self, drive: DriveFilter) -> None:
        """Add it to the belief."""
        drive.widen((State.LEFT_OFFSET, State.RIGHT_OFFSET), self.offsets)
        drive.doubt_bias(self.bias, self.seconds)
        drive.widen((State.HEADING,), self.heading)
        drive.widen((State.X, State.Y), self.place)


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read over `span` s until `time`.

    values, variances: left and right wheel (rad/s, nominal scale) and, where it is there, the gyro (rad/s).
    swing: rad/s2, how fast the turn rate changed. wobble: variance by which one wheel reads more and the
    other less. still: the robot stood. undated: rad, deviation of the heading by a turn of which it is not
    known when it began. held: m^2 of its place, along the heading, because the robot may stand while its
    wheels turn, or roll on while a motor at fault reads nothing. aside: m^2 of its place, across the heading,
    because something pushed it. now: where nobody looked for a part of the
    step, the wheels' speeds at its end, rad/s; values are then the mean of what the counters say, variances
    and wobble those of the angles, rad^2. together: rad^2, the covariance of both angles then. mute: of one
    wheel nothing is taken, so that there is nothing to judge the other one by. way: what `ScaleDoubt` added
    in this step. scales: deviation that the scales got before it, because they turned out wrong. rest: what
    was found wrong before it by standing.
    """

    time: float
    span: float
    values: tuple[float, ...]
    variances: tuple[float, ...]
    swing: float
    wobble: float
    still: bool
    undated: float = 0.0
    held: float = 0.0
    aside: float = 0.0
    now: tuple[float, float] | None = None
    together: float = 0.0
    mute: bool = False
    way: tuple[float, float] = NOTHING
    scales: float = 0.0
    rest: RestDoubt | None = None

    @property
    def of_gyro(self) -> float:
        """(rad/s)^2 by which the mean turn rate is in doubt, that of the gyro and that of when it changed."""
        return self.variances[2] + (self.undated / self.span) ** 2

    @property
    def slides(self) -> bool:
        """Whether the robot may have moved otherwise than its wheels turned."""
        return self.held > 0.0 or self.aside > 0.0


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the filter: what it took, and the belief after it and after what was `seen` then."""

    reading: Reading
    flat: Flat
    seen: tuple[Callable[[], Observation], ...] = ()

    @property
    def time(self) -> float:
        """Its end, s."""
        return self.reading.time
