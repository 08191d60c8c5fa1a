"""Residuals that come in bursts: large where wheels accelerate or brake, or in the gyro and in no wheel.

A search counts as noise what no cause explains, and that may be larger where speeds change, since no model is
as good there as in steady driving. But if it is larger by far, something yields, twists or jumps in a way
that is not in the catalogue, and counting it as noise would mean to report that nothing is wrong.

A residual in a few moments only is neither: a wheel that slipped on a pipe, a bump, a hand. It is reported
with its time, and says nothing about the robot. The same applies to moments that contain most of the gyro's
residual and that no wheel shows, if the rest of the drive is quiet.

A gyro whose chip has its own clock shows a sample that was taken at any moment of its row, and a firmware
with its own clock applies a command at any moment of its cycle. While the robot accelerates, such a sample is
wrong by this unknown time times the acceleration, which is no burst either.
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
"""Ratio of the residual where speeds change to that in steady driving, above which it is not noise."""
MIN_GYRO_ERROR = 0.05
"""Lower bound in rad/s, RMS, of a gyro's residual there."""
MIN_WHEEL_ERROR_SHARE = 0.05
"""The same for a wheel, relative to its largest reading."""
MIN_GYRO_ONLY_ERROR = 0.04
"""Residual of the gyro where speeds change (rad/s, RMS) that the wheels' residuals do not explain, above
which no push at the wheels caused it: 0.05 to 0.06 if wheels have their own inertia behind backlash.
Fault-free robots have 0.01, and 0.03 with three times the noise."""
MIN_RATIO_TO_REST = 1.8
"""Ratio of that residual to its value at rest, which is the gyro's own noise, that it must also exceed."""
MAX_LAG_BINS = 2
"""Bins by which a wheel's filter may delay it relative to the gyro, before or after."""
MIN_BINS = 25
"""Number of bins of either regime that is needed to compare them."""
MAX_MOMENTS, SECONDS_PER_MOMENT, MIN_POWER_SHARE = 3, 8.0, 0.6
"""Number of moments of a drive that may be single events (a bump, a hand), in a short drive one per so many
s; and the share of the power of the gyro's residual beyond the wheels that they must contain."""
DEPENDS_ON = "changes of speed"
HOLD_ADVICE = "hold the robot and turn its wheels back and forth"
LOOSE_PART_TEXT = (
    f"is loose, twists or jumps in a way that no cause of the catalogue describes: {HOLD_ADVICE}"
)
UNLOGGED_COMMANDS_TEXT = (
    "; or commands were given between the rows of a logger that has its own clock: log each when it is given"
)
"""Another reason for such bursts, on a fault-free robot: with rows of 8 ms they were 0.07 rad/s."""


@dataclass(frozen=True, slots=True)
class Bursts:
    """told: a sentence for each channel whose error comes in bursts again and again. moments: times (s) of
    single events, if the error occurs only there."""

    told: tuple[str, ...] = ()
    moments: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class _Residuals:
    """Residuals of a drive: the roles of its channels, their readings and the unexplained part of these,
    (bins, channels), the time of each bin in s, its regime of the noise, and by how much the ages of the
    gyro's samples vary, s."""

    roles: Sequence[str]
    measured: Array
    residual: Array
    time: Array
    regimes: Regimes
    age_std: float

    @property
    def max_moments(self) -> int:
        """Number of moments that may be single events, 1 or more."""
        return int(np.clip((self.time[-1] - self.time[0]) // SECONDS_PER_MOMENT, 1, MAX_MOMENTS))

    def without_moment(self, moment: float) -> _Residuals:
        """The residuals without those around a moment, s."""
        keep = np.abs(self.time - moment) > DISTURBANCE_S
        return _Residuals(
            self.roles,
            self.measured[keep],
            self.residual[keep],
            self.time[keep],
            self.regimes[keep],
            self.age_std,
        )

    def without_sample_ages(self, error: float, part: Flags) -> float:
        """An RMS residual of the gyro in a part of the drive, rad/s, less what the ages of its samples
        make."""
        gyro = self.roles.index("gyro")
        slopes = np.diff(self.measured[:, gyro] - self.residual[:, gyro]) / np.diff(self.time)
        before, after = (np.pad(slopes**2, each, mode="edge")[part] for each in ((1, 0), (0, 1)))
        by_ages = self.age_std * float(np.sqrt(0.5 * (before + after).mean()))
        return float(np.sqrt(max(error**2 - by_ages**2, 0.0)))

    def gyro_beyond_wheels(self) -> Callable[[Flags], Array] | None:
        """A function from a mask of bins to the gyro's residual in them that the wheels' residuals do not
        explain; None if a gyro or a wheel is not measured."""
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
        """Time in s of a channel's largest residual where speeds change."""
        error = np.where(self.regimes == CHANGING, np.abs(self.residual[:, index]), 0.0)
        return float(self.time[np.argmax(error)])


def find_bursts(
    roles: Sequence[str],
    measured: Array,
    residual: Array,
    time: Array,
    regimes: Regimes,
    play: bool = False,
    age_std: float = 0.0,
) -> Bursts:
    """Describe each channel whose error comes in bursts.

    roles: of the channels. measured, residual: (bins, channels). time: of the bins, s. regimes: of the bins.
    play: whether backlash of a wheel was named, which turns the gyro differently from the wheels by more than
    its equations contain. age_std: standard deviation (s) of the time from a command to the gyro's sample,
    which a row does not tell; 0 if all are alike.
    """
    residuals = _Residuals(roles, measured, residual, time, regimes, age_std)
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
    """Times in s that contain most of the gyro's residual that no wheel explains; empty if that residual is
    there all the time, or small throughout."""
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
        error = in_changes[index]
        if role == "gyro":
            min_error, name, unit = MIN_GYRO_ERROR, "the gyro", "rad/s"
            error = residuals.without_sample_ages(error, changing)
        elif role in WHEELS:
            min_error = MIN_WHEEL_ERROR_SHARE * float(np.abs(residuals.measured[:, index]).max())
            name = f"the {role.rpartition('_')[2]} wheel"
            unit = "counts" if role.startswith("bemf") else "rad/s"
        else:
            continue
        if error > max(min_error, MIN_ERROR_RATIO * in_steady[index]):
            description = (
                f"the remaining error of {name} occurs where wheels speed up or brake: "
                f"{format_size(error)} {unit} there, {format_size(in_steady[index])} in steady "
                f"driving; the tyres spin or skid, or something {LOOSE_PART_TEXT}{UNLOGGED_COMMANDS_TEXT}"
            )
            bursts.append(_Burst(index, description))
    if bursts or play:
        return tuple(bursts)
    return _find_gyro_only_burst(residuals)


def format_size(number: float) -> str:
    """A number with two significant digits, and never with a power of ten."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _find_gyro_only_burst(residuals: _Residuals) -> tuple[_Burst, ...]:
    """The burst of a body that turns differently from its wheels: a push from outside would show in the
    wheels' residuals as well."""
    gyro, resting = residuals.gyro_beyond_wheels(), residuals.regimes == STANDING
    if gyro is None or resting.sum() < MIN_BINS:
        return ()
    changing = residuals.regimes == CHANGING
    in_changes, at_rest = (float(np.sqrt((gyro(part) ** 2).mean())) for part in (changing, resting))
    in_changes = residuals.without_sample_ages(in_changes, changing)
    if in_changes <= max(MIN_GYRO_ONLY_ERROR, MIN_RATIO_TO_REST * at_rest):
        return ()
    description = (
        f"where wheels speed up or brake, the gyro reads {in_changes:.2g} rad/s that no wheel's reading "
        f"explains, at rest {at_rest:.2g}; the tyres spin or skid, or something between wheels and body "
        f"{LOOSE_PART_TEXT}{UNLOGGED_COMMANDS_TEXT}"
    )
    return (_Burst(residuals.roles.index("gyro"), description),)
