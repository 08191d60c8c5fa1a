"""What is left where wheels speed up or brake, and nowhere else.

A search takes for noise what no cause explains, and it may be larger where speeds change: there no model is
as good as in steady driving. But where it is larger by far something gives, twists or jumps that no cause of
the catalogue has, and to call that noise would be to say that nothing is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.log import WHEELS
from raccoon.diagnose.noise import CHANGING, STEADY, Regimes

Array = NDArray[np.float64]

TIMES = 20.0
"""By how much more is left where speeds change than in steady driving, from which it is no noise."""
GYRO = 0.05
"""rad/s, root mean square, that must be left of a gyro there."""
WHEEL = 0.05
"""Part of a wheel's largest reading for the same."""
LEAST = 25
"""Bins of either kind from which they are compared."""
DEPENDS_ON = "changes of speed"


def bursting(roles: Sequence[str], measured: Array, residual: Array, regimes: Regimes) -> tuple[str, ...]:
    """What is said of each channel whose error comes in bursts.

    roles: of the channels. measured, residual: (bins, channels). regimes: of the bins.
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
                f"what is left of {name} comes where wheels speed up or brake: {there[index]:.2g} {unit} "
                f"there, {elsewhere[index]:.2g} in steady driving; something is loose, twists or jumps as no "
                "cause of the catalogue does: hold the robot and turn its wheels to and fro"
            )
    return tuple(said)
