"""What is left of one wheel by far more than of the other.

A search takes for noise what no cause explains, of each channel as much as there is. But both wheels are of
one make and on one floor, so what pushes them about is alike. Where one of them is off several times as far,
all the time, it does what no cause of the catalogue does, and to call that noise would be to say that nothing
is wrong: a brush that skips, a gear that catches, a cable that drags.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.unknown.bursts import size_text
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

RATIO = 3.0
"""Times the other wheel's error, root mean square. Of 62 robots of all kinds with nothing unknown in one
wheel none had more than 1.45; a motor that cogs and a wheel that rubs, of which curves tell, had 2.3."""
SHARE = 0.006
"""Part of the largest reading that it is at the least: sound robots have 0.001 to 0.005."""
BOTH_MOVE = 0.15
"""Part of the largest reading that both wheels must have: one that stands is not off."""
FEWEST = 10
"""Half seconds of driving from which they are compared, and what happens in `FEW` of them is left out."""
FEW = 3


def one_sided(roles: Sequence[str], measured: Array, residual: Array, event: int) -> tuple[str, str] | None:
    """What is unknown then, by the wheel it is of, and a sentence with both sizes; None where wheels are
    alike.

    roles: of the channels. measured, residual: (bins, channels). event: bins in half a second.
    """
    for kind, unit in (("bemf", "counts"), ("speed", "rad/s")):
        pair = [roles.index(each) for side in SIDES if (each := f"{kind}_{side}") in roles]
        sizes = _usual_sizes(measured[:, pair], residual[:, pair], event) if len(pair) == len(SIDES) else None
        if sizes is None:
            continue
        worse = int(np.argmax(sizes))
        size, other = float(sizes[worse]), float(sizes[1 - worse])
        if size > max(RATIO * other, SHARE * float(np.abs(measured[:, pair]).max())):
            side, like = SIDES[worse], SIDES[1 - worse]
            return f"{side} wheel alone", (
                f"what is left of the {side} wheel is {size_text(size)} {unit} all the time, and "
                f"{size_text(other)} of the {like} one: something of that wheel alone skips, catches or "
                "drags as no cause of the catalogue does: turn it by hand, and look at its motor's plug, its "
                "gears and what pulls at the robot on that side"
            )
    return None


def _usual_sizes(measured: Array, residual: Array, event: int) -> Array | None:
    """Root mean square of what is left of two wheels while both turn, without a few moments; None of too
    little."""
    speed = np.abs(measured)
    driving = np.flatnonzero((speed > BOTH_MOVE * speed.max()).all(axis=1))
    events = np.split(driving, np.searchsorted(driving, range(event, len(speed), event)))
    powers = np.array([(residual[each] ** 2).mean(axis=0) for each in events if 2 * len(each) >= event])
    if len(powers) < FEWEST + FEW:
        return None
    usual = powers[np.argsort(powers.max(axis=1))[:-FEW]]
    return np.asarray(np.sqrt(usual.mean(axis=0)), np.float64)
