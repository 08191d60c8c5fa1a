"""The stories that a tophat's readings may tell, and how likely one follows on another (see `hypotheses`)."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import edge_coverage

Array = NDArray[np.float64]
Index = NDArray[np.intp]

STAGES = 6  # of an edge
FASTEST = 4  # stages in one reading
PACE_SPREAD, LEAST_SPREAD = 0.3, 0.35  # of the stages in one reading: speed and spot are known roughly
STANDS = 0.003  # of u, sd of its change in one reading while the light stands
PACES = (0.06, 0.4)  # of u, sd of the change in one reading where the light begins to move
SUNLIGHT = 15.0  # sd of that change where the sun comes out at once, light
BEGINS, ENDS = (1.0 / 1500, 1.0 / 4000, 1.0 / 4000), 1.0 / 30  # chance in one reading that it does, or stops
UNEVEN = 0.15  # of the pace, sd by which it changes from one reading to the next
WITH_OTHERS = {None: 1.0, True: 8.0, False: 0.5}  # times likelier, by whether other sensors are at a loss
BETWEEN_LINES, LINE_WIDTH = 0.2, 0.05  # m, on the average
LIGHTS = 2  # standing, moving
PHASES = 2 + 2 * STAGES
STORIES = PHASES * LIGHTS

_coverage = edge_coverage(1.0 - 2.0 * (np.arange(STAGES) + 0.5) / STAGES, 1.0)
DARKNESS: Array = np.concatenate([[0.0, 1.0], _coverage, _coverage[::-1]])
"""Share of the spot on black by phase: white, black, entering, leaving."""
MORE_BLACK: Array = (DARKNESS[2:] > 0.5).astype(float)
GROUP: Index = np.repeat(np.minimum(np.arange(PHASES), 2), LIGHTS)


class Moves(NamedTuple):
    """Every step from story to story: where from, where to, by how many stages (-1: none), how light went."""

    source: Index
    target: Index
    stages: Index
    change: Index
    from_white: NDArray[np.bool_]
    on_edge: NDArray[np.bool_]
    moves_on: Array
    part: Array
    uneven: Array
    wander: Array
    pace: Array
    sun: Array
    white_part: Array
    black_part: Array
    blur: Array


# What light does from one reading to the next: from, to, sd of its change and of its pace in shares of u and
# of its pace in light, and the part of the pace by which it changes with the variance of that. It stops
# anywhere between two readings.
_CHANGES = (
    (0, 0, STANDS, 0.0, 0.0, 0.0, 0.0),
    (0, 1, 0.0, PACES[0], 0.0, 1.0, 0.0),
    (0, 1, 0.0, PACES[1], 0.0, 1.0, 0.0),
    (0, 1, 0.0, 0.0, SUNLIGHT, 1.0, 0.0),
    (1, 1, 0.0, 0.0, 0.0, 1.0, UNEVEN**2),
    (1, 0, STANDS, 0.0, 0.0, 0.5, 1.0 / 12.0),
)


@lru_cache(maxsize=1)
def moves_of_stories() -> Moves:
    """All moves; the arrays are shared, so leave them as they are."""
    steps = [(phase, phase, -1) for phase in (0, 1)]
    for surface, first, end in ((0, 2, 1), (1, 2 + STAGES, 0)):
        steps += [(surface, first + k - 1, k) for k in range(1, FASTEST + 1)]
        for stage in range(STAGES):
            for k in range(FASTEST + 1):
                steps.append((first + stage, first + stage + k if stage + k < STAGES else end, k))
    ways = np.array([(*step, change) for step in steps for change in range(len(_CHANGES))], dtype=np.intp)
    source, target, stages, change = ways.T
    before, after, wander, pace, sun, part, uneven = np.array(_CHANGES).T
    dark = DARKNESS[target]
    return Moves(
        source=source * LIGHTS + before[change].astype(np.intp),
        target=target * LIGHTS + after[change].astype(np.intp),
        stages=stages,
        change=change,
        from_white=source == 0,
        on_edge=source > 1,
        moves_on=after[change],
        part=part[change],
        uneven=uneven[change],
        wander=wander[change] ** 2,
        pace=pace[change] ** 2,
        sun=sun[change] ** 2,
        white_part=1.0 - dark,
        black_part=dark,
        blur=np.where((dark > 0.0) & (dark < 1.0), 0.3 / STAGES, 0.0),
    )


@lru_cache(maxsize=128)
def chances(pace_tenths: int, spot_microns: int, others_lost: bool | None) -> Array:
    """Probability of every move at a pace (stages a reading)."""
    moves = moves_of_stories()
    pace = 0.1 * pace_tenths
    way = pace * 1e-6 * spot_microns / STAGES
    number = np.arange(FASTEST + 1)
    advance = np.exp(-0.5 * ((number - pace) / (PACE_SPREAD * pace + LEAST_SPREAD)) ** 2)
    advance /= advance.sum()
    rate = np.where(moves.from_white, min(way / BETWEEN_LINES, 0.1), min(way / LINE_WIDTH, 0.2))
    along = advance[moves.stages]
    entering = rate * along / (1.0 - advance[0])
    chance = np.where(moves.stages < 0, 1.0 - rate, np.where(moves.on_edge, along, entering))
    begins = WITH_OTHERS[others_lost] * np.array(BEGINS)
    changes = np.array([1.0 - begins.sum(), *begins, 1.0 - ENDS, ENDS])
    return np.asarray(chance * changes[moves.change])
