"""Residuals that come in bursts: large where wheels speed up or brake, or of the gyro and of no wheel.

A search takes for noise what no cause explains, and it may be larger where speeds change: there no model is
as good as in steady driving. But where it is larger by far something gives, twists or jumps that no cause of
the catalogue has, and to call that noise would be to say that nothing is wrong.

What comes in a few moments is neither: a wheel that slipped on a pipe, a bump, a hand. It is told with its
time, and says nothing of the robot. Moments that hold most of what a gyro says and no wheel are such, too,
where the rest of the drive is quiet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.disturbances import DISTURBANCE_S
from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.noise_model import CHANGING, STANDING, STEADY, Regimes
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_ERROR_RATIO = 20.0
"""Residual where speeds change, over that in steady driving, from which it is no noise."""
MIN_GYRO_ERROR = 0.05
"""rad/s, root mean square, of a gyro's residual there, at least."""
MIN_WHEEL_ERROR_SHARE = 0.05
"""The same of a wheel, as a share of its largest reading."""
MIN_GYRO_ONLY_ERROR = 0.04
"""rad/s, root mean square, of a gyro's residual where speeds change that no wheel's residual explains, from
which no push of the wheels made it: 0.05 to 0.06 where wheels have inertia of their own behind play. Sound
robots have 0.01, and 0.03 with three times the noise."""
MIN_RATIO_TO_REST = 1.8
"""The same over its value at rest, which is the gyro's own noise."""
MAX_LAG_BINS = 2
"""Bins before and after by which a wheel's filter may show it later than the gyro."""
MIN_BINS = 25
"""Bins of either regime from which they are compared."""
MAX_MOMENTS, SECONDS_PER_MOMENT, MIN_POWER_SHARE = 3, 8.0, 0.6
"""How many moments of a drive may be single events (a bump, a hand), of a short one one in so many s; and the
part of the power of the gyro's residual beyond the wheels that they must hold."""
DEPENDS_ON = "changes of speed"
HOLD_ADVICE = "hold the robot and turn its wheels to and fro"
LOOSE_PART_TEXT = f"is loose, twists or jumps as no cause of the catalogue does: {HOLD_ADVICE}"
UNLOGGED_COMMANDS_TEXT = (
    "; or commands were given between the rows of a logger that has its own clock: log each when it is given"
)
"""What makes such bursts of a sound robot: at 8 ms a row they were 0.07 rad/s."""


@dataclass(frozen=True, slots=True)
class Bursts:
    """descriptions: a sentence for each channel whose error comes in bursts again and again. moments: s, of
    single events, where the error comes only then."""

    told: tuple[str, ...] = ()
    moments: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class _Residuals:
    """Residuals of a drive: the roles of its channels, what they read and what no model explains of it,
    (bins, channels), the time of each bin, s, and which of the noise's regimes it is in."""

    roles: Sequence[str]
    measured: Array
    residual: Array
    time: Array
    regimes: Regimes

    @property
    def max_moments(self) -> int:
        """How many moments may be single events, 1 or more."""
        return int(np.clip((self.time[-1] - self.time[0]) // SECONDS_PER_MOMENT, 1, MAX_MOMENTS))

    def without_moment(self, moment: float) -> _Residuals:
        """The residuals less those around a moment, s."""
        keep = np.abs(self.time - moment) > DISTURBANCE_S
        return _Residuals(
            self.roles, self.measured[keep], self.residual[keep], self.time[keep], self.regimes[keep]
        )

    def gyro_beyond_wheels(self) -> Callable[[Flags], Array] | None:
        """A function that gives, for some bins, the gyro's residual that the wheels' residuals do not
        explain; None where a gyro or wheel is not measured."""
        wheels = [index for index, role in enumerate(self.roles) if role in WHEELS]
        if "gyro" not in self.roles or len(wheels) < len(SIDES):
            return None
        gyro = self.residual[:, self.roles.index("gyro")]
        shifts = range(-MAX_LAG_BINS, MAX_LAG_BINS + 1)
        columns = np.hstack([np.roll(self.residual[:, wheels], shift, axis=0) for shift in shifts])

        def residual_beyond_wheels(part: Flags) -> Array:
            solved = np.linalg.lstsq(columns[part], gyro[part], rcond=None)[0]
            return np.asarray(gyro[part] - columns[part] @ solved, float)

        return residual_beyond_wheels

    def worst_moment(self, index: int) -> float:
        """s, when a channel is furthest off where speeds change."""
        error = np.where(self.regimes == CHANGING, np.abs(self.residual[:, index]), 0.0)
        return float(self.time[np.argmax(error)])


def find_bursts(
    roles: Sequence[str],
    measured: Array,
    residual: Array,
    time: Array,
    regimes: Regimes,
    play: bool = False,
) -> Bursts:
    """Describe each channel whose error comes in bursts.

    roles: of the channels. measured, residual: (bins, channels). time: of the bins, s. regimes: of the bins.
    play: whether play of a wheel was named, which makes its gyro turn otherwise than the wheels, by more than
    its equations say.
    """
    residuals = _Residuals(roles, measured, residual, time, regimes)
    max_moments, moments = residuals.max_moments, [] if play else _find_gyro_only_moments(residuals)
    for each in moments:
        residuals = residuals.without_moment(each)
    remaining = bursts = _find_channel_bursts(residuals, play)
    while remaining and len(moments) < max_moments:
        moments.append(residuals.worst_moment(remaining[0].index))
        residuals = residuals.without_moment(moments[-1])
        if (residuals.regimes == CHANGING).sum() < MIN_BINS:
            break
        remaining = _find_channel_bursts(residuals, play)
    return Bursts(tuple(each.description for each in bursts)) if remaining else Bursts(moments=tuple(moments))


def _find_gyro_only_moments(residuals: _Residuals) -> list[float]:
    """Moments, s, that hold most of the gyro's residual that no wheel explains; none where that is there all
    the time, or small throughout."""
    gyro = residuals.gyro_beyond_wheels()
    if gyro is None:
        return []
    power = gyro(np.ones(len(residuals.time), bool)) ** 2
    remaining = power.copy()
    moments: list[float] = []
    while len(moments) < residuals.max_moments:
        middle = float(residuals.time[np.argmax(remaining)])
        around = np.abs(residuals.time - middle) <= DISTURBANCE_S
        if np.sqrt(remaining[around].mean()) < MIN_GYRO_ERROR:
            break
        remaining[around] = 0.0
        moments.append(middle)
        if remaining.sum() < (1.0 - MIN_POWER_SHARE) * power.sum():
            return moments
    return []


@dataclass(frozen=True, slots=True)
class _Burst:
    """The channel by its index, and a sentence about it."""

    index: int
    description: str


def _find_channel_bursts(residuals: _Residuals, play: bool) -> tuple[_Burst, ...]:
    roles, residual, regimes = residuals.roles, residuals.residual, residuals.regimes
    changing, steady = regimes == CHANGING, regimes == STEADY
    if min(changing.sum(), steady.sum()) < MIN_BINS:
        return ()
    in_changes, in_steady = (np.sqrt((residual[part] ** 2).mean(axis=0)) for part in (changing, steady))
    bursts = []
    for index, role in enumerate(roles):
        if role == "gyro":
            min_error, name, unit = MIN_GYRO_ERROR, "the gyro", "rad/s"
        elif role in WHEELS:
            min_error = MIN_WHEEL_ERROR_SHARE * float(np.abs(residuals.measured[:, index]).max())
            name = f"the {role.rpartition('_')[2]} wheel"
            unit = "counts" if role.startswith("bemf") else "rad/s"
        else:
            continue
        if in_changes[index] > max(min_error, MIN_ERROR_RATIO * in_steady[index]):
            description = (
                f"what is left of {name} comes where wheels speed up or brake: "
                f"{format_size(in_changes[index])} {unit} there, "
                f"{format_size(in_steady[index])} in steady driving; "
                f"the tyres spin or skid, or something {LOOSE_PART_TEXT}{UNLOGGED_COMMANDS_TEXT}"
            )
            bursts.append(_Burst(index, description))
    if bursts or play:
        return tuple(bursts)
    return _find_gyro_only_burst(residuals)


def format_size(number: float) -> str:
    """A number with two digits, and never a power of ten."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _find_gyro_only_burst(residuals: _Residuals) -> tuple[_Burst, ...]:
    """Where the body turns as no wheel does: a push from outside would show in the wheels' residuals as
    well."""
    gyro, resting = residuals.gyro_beyond_wheels(), residuals.regimes == STANDING
    if gyro is None or resting.sum() < MIN_BINS:
        return ()
    in_changes, at_rest = (
        float(np.sqrt((gyro(part) ** 2).mean())) for part in (residuals.regimes == CHANGING, resting)
    )
    if in_changes <= max(MIN_GYRO_ONLY_ERROR, MIN_RATIO_TO_REST * at_rest):
        return ()
    description = (
        f"where wheels speed up or brake the gyro says {in_changes:.2g} rad/s that no wheel's reading does, "
        f"at rest {at_rest:.2g}; the tyres spin or skid, or something between wheels and body "
        f"{LOOSE_PART_TEXT}{UNLOGGED_COMMANDS_TEXT}"
    )
    return (_Burst(residuals.roles.index("gyro"), description),)
