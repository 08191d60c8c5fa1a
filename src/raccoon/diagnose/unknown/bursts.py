"""What is left where wheels speed up or brake, and nowhere else, or not at the wheels.

A search takes for noise what no cause explains, and it may be larger where speeds change: there no model is
as good as in steady driving. But where it is larger by far something gives, twists or jumps that no cause of
the catalogue has, and to call that noise would be to say that nothing is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.noise import CHANGING, STANDING, STEADY, Regimes
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

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
DEPENDS_ON = "changes of speed"
HOLD = "hold the robot and turn its wheels to and fro"
LOOSE = f"is loose, twists or jumps as no cause of the catalogue does: {HOLD}"


def bursting(
    roles: Sequence[str], measured: Array, residual: Array, regimes: Regimes, play: bool = False
) -> tuple[str, ...]:
    """What is said of each channel whose error comes in bursts.

    roles: of the channels. measured, residual: (bins, channels). regimes: of the bins. play: whether play of
    a wheel was named, which makes its gyro turn otherwise than the wheels, by more than its equations say.
    """
    changing, steady = regimes == CHANGING, regimes == STEADY
    if min(changing.sum(), steady.sum()) < LEAST:
        return ()
    there, elsewhere = (np.sqrt((residual[part] ** 2).mean(axis=0)) for part in (changing, steady))
    said = []
    for index, role in enumerate(roles):
        if role == "gyro":
            least, name, unit = GYRO, "the gyro", "rad/s"
        elif role in WHEELS:
            least = WHEEL * float(np.abs(measured[:, index]).max())
            name = f"the {role.rpartition('_')[2]} wheel"
            unit = "counts" if role.startswith("bemf") else "rad/s"
        else:
            continue
        if there[index] > max(least, TIMES * elsewhere[index]):
            said.append(
                f"what is left of {name} comes where wheels speed up or brake: {_size(there[index])} {unit} "
                f"there, {_size(elsewhere[index])} in steady driving; something {LOOSE}"
            )
    if said or play:
        return tuple(said)
    return _of_the_gyro_alone(roles, residual, regimes)


def _size(number: float) -> str:
    """Two digits, and never a power of ten."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"


def _of_the_gyro_alone(roles: Sequence[str], residual: Array, regimes: Regimes) -> tuple[str, ...]:
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
    return (
        f"where wheels speed up or brake the gyro says {there:.2g} rad/s that no wheel's reading does, at "
        f"rest {at_rest:.2g}; the tyres skid, or something between wheels and body {LOOSE}",
    )
