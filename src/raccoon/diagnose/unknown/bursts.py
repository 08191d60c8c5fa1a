"""What is left where wheels speed up or brake, and nowhere else, or not at the wheels.

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

from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.drives.moments import AROUND
from raccoon.diagnose.fit.noise_model import CHANGING, STANDING, STEADY, Regimes
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIMES = 20.0
"""By how much more is left where speeds change than in steady driving, from which it is no noise."""
GYRO = 0.05
"""rad/s, root mean square, that must be left of a gyro there."""
WHEEL = 0.05
"""Part of a wheel's largest reading for the same."""
ALONE = 0.04
"""rad/s, root mean square, that is left of a gyro where speeds change and of no wheel, from which no push of
the wheels made it: 0.05 to 0.06 where wheels have inertia of their own behind play. Sound robots have 0.01,
and 0.03 with three times the noise."""
BESIDE_REST = 1.8
"""Times what a gyro has so at rest, which is its own noise."""
NEIGHBOURS = 2
"""Bins before and after by which a wheel's filter may show it later than the gyro."""
LEAST = 25
"""Bins of either kind from which they are compared."""
MOMENTS, EVERY, MOST = 3, 8.0, 0.6
"""So many moments of a drive are things that happened in it, of a short one one in so many s; and the part of
the power of what a gyro says that no wheel does, from which they have most of it."""
DEPENDS_ON = "changes of speed"
HOLD = "hold the robot and turn its wheels to and fro"
LOOSE = f"is loose, twists or jumps as no cause of the catalogue does: {HOLD}"
UNLOGGED = (
    "; or commands were given between the rows of a logger that has its own clock: log each when it is given"
)
"""What makes such bursts of a sound robot: at 8 ms a row they were 0.07 rad/s."""


@dataclass(frozen=True, slots=True)
class Bursts:
    """told: a sentence for each channel whose error comes in bursts again and again. moments: s, around which
    something happened, where it comes then only."""

    told: tuple[str, ...] = ()
    moments: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class _Rest:
    """What is left of a drive: the roles of its channels, what they read and what no model explains of it,
    (bins, channels), when each bin is, s, and which of the noise's regimes it is in."""

    roles: Sequence[str]
    measured: Array
    residual: Array
    time: Array
    regimes: Regimes

    @property
    def few(self) -> int:
        """How many moments are no habit of the robot, 1 or more."""
        return int(np.clip((self.time[-1] - self.time[0]) // EVERY, 1, MOMENTS))

    def without(self, moment: float) -> _Rest:
        """The rest less what is around a moment, s."""
        keep = np.abs(self.time - moment) > AROUND
        return _Rest(
            self.roles, self.measured[keep], self.residual[keep], self.time[keep], self.regimes[keep]
        )

    def of_the_gyro(self) -> Callable[[Flags], Array] | None:
        """What is left of the gyro in some bins and not of the wheels' readings there; None without these."""
        wheels = [index for index, role in enumerate(self.roles) if role in WHEELS]
        if "gyro" not in self.roles or len(wheels) < len(SIDES):
            return None
        gyro = self.residual[:, self.roles.index("gyro")]
        shifts = range(-NEIGHBOURS, NEIGHBOURS + 1)
        columns = np.hstack([np.roll(self.residual[:, wheels], shift, axis=0) for shift in shifts])

        def alone(part: Flags) -> Array:
            solved = np.linalg.lstsq(columns[part], gyro[part], rcond=None)[0]
            return np.asarray(gyro[part] - columns[part] @ solved, float)

        return alone

    def worst(self, index: int) -> float:
        """s, when a channel is furthest off where speeds change."""
        error = np.where(self.regimes == CHANGING, np.abs(self.residual[:, index]), 0.0)
        return float(self.time[np.argmax(error)])


def bursting(
    roles: Sequence[str],
    measured: Array,
    residual: Array,
    time: Array,
    regimes: Regimes,
    play: bool = False,
) -> Bursts:
    """What is said of each channel whose error comes in bursts.

    roles: of the channels. measured, residual: (bins, channels). time: of the bins, s. regimes: of the bins.
    play: whether play of a wheel was named, which makes its gyro turn otherwise than the wheels, by more than
    its equations say.
    """
    rest = _Rest(roles, measured, residual, time, regimes)
    few, moments = rest.few, [] if play else _turned_alone(rest)
    for each in moments:
        rest = rest.without(each)
    found = said = _bursts(rest, play)
    while found and len(moments) < few:
        moments.append(rest.worst(found[0].index))
        rest = rest.without(moments[-1])
        if (rest.regimes == CHANGING).sum() < LEAST:
            break
        found = _bursts(rest, play)
    return Bursts(tuple(each.told for each in said)) if found else Bursts(moments=tuple(moments))


def _turned_alone(rest: _Rest) -> list[float]:
    """s, the moments that hold most of what a gyro says and no wheel; none where it is there all the time, or
    little at the most."""
    gyro = rest.of_the_gyro()
    if gyro is None:
        return []
    power = gyro(np.ones(len(rest.time), bool)) ** 2
    left = power.copy()
    moments: list[float] = []
    while len(moments) < rest.few:
        middle = float(rest.time[np.argmax(left)])
        there = np.abs(rest.time - middle) <= AROUND
        if np.sqrt(left[there].mean()) < GYRO:
            break
        left[there] = 0.0
        moments.append(middle)
        if left.sum() < (1.0 - MOST) * power.sum():
            return moments
    return []


@dataclass(frozen=True, slots=True)
class _Burst:
    """Of which channel, and what is said of it."""

    index: int
    told: str


def _bursts(rest: _Rest, play: bool) -> tuple[_Burst, ...]:
    roles, residual, regimes = rest.roles, rest.residual, rest.regimes
    changing, steady = regimes == CHANGING, regimes == STEADY
    if min(changing.sum(), steady.sum()) < LEAST:
        return ()
    there, elsewhere = (np.sqrt((residual[part] ** 2).mean(axis=0)) for part in (changing, steady))
    said = []
    for index, role in enumerate(roles):
        if role == "gyro":
            least, name, unit = GYRO, "the gyro", "rad/s"
        elif role in WHEELS:
            least = WHEEL * float(np.abs(rest.measured[:, index]).max())
            name = f"the {role.rpartition('_')[2]} wheel"
            unit = "counts" if role.startswith("bemf") else "rad/s"
        else:
            continue
        if there[index] > max(least, TIMES * elsewhere[index]):
            told = (
                f"what is left of {name} comes where wheels speed up or brake: "
                f"{size_text(there[index])} {unit} there, {size_text(elsewhere[index])} in steady driving; "
                f"the tyres spin or skid, or something {LOOSE}{UNLOGGED}"
            )
            said.append(_Burst(index, told))
    if said or play:
        return tuple(said)
    return _of_the_gyro_alone(rest)


def size_text(number: float) -> str:
    """Two digits, and never a power of ten."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _of_the_gyro_alone(rest: _Rest) -> tuple[_Burst, ...]:
    """Where a body turns as no wheel does: what pushes a robot is left of its wheels' readings as well."""
    alone, resting = rest.of_the_gyro(), rest.regimes == STANDING
    if alone is None or resting.sum() < LEAST:
        return ()
    there, at_rest = (
        float(np.sqrt((alone(part) ** 2).mean())) for part in (rest.regimes == CHANGING, resting)
    )
    if there <= max(ALONE, BESIDE_REST * at_rest):
        return ()
    told = (
        f"where wheels speed up or brake the gyro says {there:.2g} rad/s that no wheel's reading does, at "
        f"rest {at_rest:.2g}; the tyres spin or skid, or something between wheels and body {LOOSE}{UNLOGGED}"
    )
    return (_Burst(rest.roles.index("gyro"), told),)
