"""What is left where wheels speed up or brake, and nowhere else, or not at the wheels.

A search takes for noise what no cause explains, and it may be larger where speeds change: there no model is
as good as in steady driving. But where it is larger by far something gives, twists or jumps that no cause of
the catalogue has, and to call that noise would be to say that nothing is wrong.

What comes in a few moments is neither: a wheel that slipped on a pipe, a bump, a hand. It is told with its
time, and says nothing of the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.noise import CHANGING, STANDING, STEADY, Regimes
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
MOMENTS, AROUND = 3, 0.6
"""So many moments of a drive are things that happened in it; and s to either side of the worst bin of one."""
DEPENDS_ON = "changes of speed"
HOLD = "hold the robot and turn its wheels to and fro"
LOOSE = f"is loose, twists or jumps as no cause of the catalogue does: {HOLD}"


@dataclass(frozen=True, slots=True)
class Bursts:
    """told: a sentence for each channel whose error comes in bursts. lasting: whether they come again and
    again, and not only in a few moments."""

    told: tuple[str, ...] = ()
    lasting: bool = False


@dataclass(frozen=True, slots=True)
class _Rest:
    """What is left of a drive: the roles of its channels, what they read and what no model explains of it,
    (bins, channels), when each bin is, s, and which of the noise's regimes it is in."""

    roles: Sequence[str]
    measured: Array
    residual: Array
    time: Array
    regimes: Regimes

    def part(self, keep: Flags) -> _Rest:
        return _Rest(
            self.roles, self.measured[keep], self.residual[keep], self.time[keep], self.regimes[keep]
        )

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
    found = said = _bursts(rest, play)
    moments: list[float] = []
    while found and len(moments) < MOMENTS:
        moments.append(rest.worst(found[0].index))
        rest = rest.part(np.abs(rest.time - moments[-1]) > AROUND)
        if (rest.regimes == CHANGING).sum() < LEAST:
            break
        found = _bursts(rest, play)
    if said and not found:
        return Bursts((_happened(moments),))
    return Bursts(tuple(each.told for each in said), lasting=bool(said))


def _happened(moments: Sequence[float]) -> str:
    times = " and ".join(f"{each:.1f}" for each in sorted(moments))
    return (
        f"around {times} s the robot moved as no command and no cause makes it, and nowhere else: a bump, "
        "something that it ran into or over, a hand? Nothing is made of it"
    )


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
                f"what is left of {name} comes where wheels speed up or brake: {_size(there[index])} {unit} "
                f"there, {_size(elsewhere[index])} in steady driving; something {LOOSE}"
            )
            said.append(_Burst(index, told))
    if said or play:
        return tuple(said)
    return _of_the_gyro_alone(roles, residual, regimes)


def _size(number: float) -> str:
    """Two digits, and never a power of ten."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _of_the_gyro_alone(roles: Sequence[str], residual: Array, regimes: Regimes) -> tuple[_Burst, ...]:
    """Where a body turns as no wheel does: what pushes a robot is left of its wheels' readings as well."""
    wheels = [index for index, role in enumerate(roles) if role in WHEELS]
    resting = regimes == STANDING
    if "gyro" not in roles or len(wheels) < len(SIDES) or resting.sum() < LEAST:
        return ()
    gyro = residual[:, roles.index("gyro")]
    shifts = range(-NEIGHBOURS, NEIGHBOURS + 1)
    columns = np.hstack([np.roll(residual[:, wheels], shift, axis=0) for shift in shifts])

    def unshared(part: NDArray[np.bool_]) -> float:
        solved = np.linalg.lstsq(columns[part], gyro[part], rcond=None)[0]
        return float(np.sqrt(((gyro[part] - columns[part] @ solved) ** 2).mean()))

    there, at_rest = unshared(regimes == CHANGING), unshared(resting)
    if there <= max(ALONE, BESIDE_REST * at_rest):
        return ()
    told = (
        f"where wheels speed up or brake the gyro says {there:.2g} rad/s that no wheel's reading does, at "
        f"rest {at_rest:.2g}; the tyres skid, or something between wheels and body {LOOSE}"
    )
    return (_Burst(roles.index("gyro"), told),)
