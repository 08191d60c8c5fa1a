"""A residual that is far larger at one wheel than at the other.

A search counts as noise what no cause explains, in each channel as much as there is. But both wheels are of
one make and on one floor, so their disturbances are alike. If the error of one is several times that of the
other, all the time, the cause is outside the catalogue, and counting it as noise would mean to report that
nothing is wrong: a brush that skips, a gear that catches, a cable that drags.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.unknown.bursts import format_size
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

MIN_SIDE_RATIO = 3.0
"""Ratio of the RMS errors of the two wheels above which the error is one-sided. Of 62 robots of all kinds
with nothing unknown in one wheel none had more than 1.45; a motor that cogs and a wheel that rubs, which
curves detect, had 2.3."""
MIN_SHARE_OF_READING = 0.006
"""Lower bound of that error relative to the largest reading: fault-free robots have 0.001 to 0.005."""
MOVING_SHARE = 0.15
"""Threshold on a wheel's reading, relative to the largest, above which it moves; both must move, since a
standing wheel has no error."""
MIN_EVENTS = 10
"""Number of half seconds of driving that is needed to compare the wheels."""
EVENTS_LEFT_OUT = 3
"""Number of the worst of these that are left out, since single events may have caused them."""


def find_one_sided_error(
    roles: Sequence[str], measured: Array, residual: Array, event: int, counting: Sequence[float]
) -> tuple[str, str] | None:
    """The name of the unknown cause, by its wheel, and a sentence with both sizes; None if the wheels are
    alike.

    roles: of the channels. measured, residual: (bins, channels). event: bins in half a second. counting:
    `counting_error` of the channels, which is no error of a wheel: if the reading of one was missing and
    derived from its counter, 27 counts beside the other's 4 were one wheel's fault.
    """
    for kind, unit in (("bemf", "counts"), ("speed", "rad/s")):
        pair = [roles.index(each) for side in SIDES if (each := f"{kind}_{side}") in roles]
        sizes = _usual_sizes(measured[:, pair], residual[:, pair], event) if len(pair) == len(SIDES) else None
        if sizes is None:
            continue
        sizes = np.sqrt(np.maximum(sizes**2 - np.array([counting[each] for each in pair]) ** 2, 0.0))
        worse = int(np.argmax(sizes))
        size, other = float(sizes[worse]), float(sizes[1 - worse])
        if size > max(MIN_SIDE_RATIO * other, MIN_SHARE_OF_READING * float(np.abs(measured[:, pair]).max())):
            side, other_side = SIDES[worse], SIDES[1 - worse]
            return f"{side} wheel alone", (
                f"the remaining error of the {side} wheel is {format_size(size)} {unit} all the time, that "
                f"of the {other_side} one {format_size(other)}: something on that wheel alone skips, catches "
                "or drags in a way that no cause of the catalogue describes: turn it by hand, and check its "
                "motor's plug, its gears and what pulls at the robot on that side"
            )
    return None


def _usual_sizes(measured: Array, residual: Array, event: int) -> Array | None:
    """RMS residual (2,) of two wheels while both turn, without the worst events; None if there are too
    few."""
    speed = np.abs(measured)
    driving = np.flatnonzero((speed > MOVING_SHARE * speed.max()).all(axis=1))
    events = np.split(driving, np.searchsorted(driving, range(event, len(speed), event)))
    powers = np.array([(residual[each] ** 2).mean(axis=0) for each in events if 2 * len(each) >= event])
    if len(powers) < MIN_EVENTS + EVENTS_LEFT_OUT:
        return None
    usual = powers[np.argsort(powers.max(axis=1))[:-EVENTS_LEFT_OUT]]
    return np.asarray(np.sqrt(usual.mean(axis=0)), np.float64)
