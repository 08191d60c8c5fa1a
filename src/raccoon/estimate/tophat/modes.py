"""The stories that a tophat's readings may tell, and how likely one follows on another (see `hypotheses`)."""

from __future__ import annotations

from collections.abc import Iterator
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
SLOWER = 2.0  # times, that a robot of which nobody says it may be than is assumed
STANDS = 0.003  # of u, sd of its change in one reading while the light stands
PACES = (0.06, 0.4)  # of u, sd of the change in one reading where the light begins to move
SUNLIGHT = 15.0  # sd of that change where the sun comes out at once, light
BEGINS, ENDS = (1.0 / 1500, 1.0 / 4000, 1.0 / 4000), 1.0 / 30  # chance in one reading that it does, or stops
UNEVEN = 0.15  # of the pace, sd by which it changes from one reading to the next
WITH_OTHERS = {None: 1.0, True: 8.0, False: 0.5}  # times likelier, by whether other sensors are at a loss
BETWEEN_LINES, LINE_WIDTH = 0.2, 0.05  # m, on the average
NARROW = 0.1  # of what is begun like a line, that is narrower than the spot: seams, scratches
LIGHTS = 2  # standing, moving
FLOORS = (2.0, 0.3)  # m between borders of the floor, on the average: to any other, and back to the first
STEPS = 2 + 2 * STAGES
"""The first phase on the way to another floor, which is as white: its light is in the place of black's."""
OTHER = STEPS + len(FLOORS) * STAGES
"""The phase of white on another floor, from which the one of before comes back."""
PHASES = OTHER + 1
STORIES = PHASES * LIGHTS

_coverage = edge_coverage(1.0 - 2.0 * (np.arange(STAGES) + 0.5) / STAGES, 1.0)
DARKNESS: Array = np.concatenate([[0.0, 1.0], _coverage, _coverage[::-1], *[_coverage] * len(FLOORS), [0.0]])
"""Share of the spot on black, or on the floor ahead, by phase: white, black, entering, leaving, to each
floor, there."""
MORE_BLACK: Array = (DARKNESS[2:STEPS] > 0.5).astype(float)
GROUP: Index = np.repeat([0, 1] + [2] * 2 * STAGES + [3] * len(FLOORS) * STAGES + [0], LIGHTS)


class Moves(NamedTuple):
    """Every step from story to story: where from, where to, by how many stages (-1: none), how light went.

    In the order of their targets: those of `reached[place]` begin at `starts`.
    source: the story, or from `STORIES` on one that comes to another floor or leaves for it
    (`Hypotheses._with_floors`). floor: which of `FLOORS` it leads to, -1 of none. not_stepping: 1, but 0
    on the way there. brighter: by how much the light in black's place may be above u: any, on that way.
    """

    source: Index
    reached: Index
    starts: Index
    place: Index
    stages: Index
    change: Index
    from_white: NDArray[np.bool_]
    on_other: NDArray[np.bool_]
    settles: NDArray[np.bool_]
    floor: Index
    not_stepping: Array
    brighter: Array
    on_edge: NDArray[np.bool_]
    entering: NDArray[np.bool_]
    turns: NDArray[np.bool_]
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
    ways = _ways()
    after = np.array([each[1] for each in _CHANGES], dtype=np.intp)
    ways.sort(key=lambda way: (way[1], after[way[3]]))
    source, target, stages, change, floors = np.array(ways, dtype=np.intp).T
    reached, starts, place = np.unique(
        target * LIGHTS + after[change], return_index=True, return_inverse=True
    )
    from_white, floor = (source == 0) | (source == OTHER), floors >= 0
    before, _, wander, pace, sun, part, uneven = np.array(_CHANGES).T
    dark, entering = DARKNESS[target], (source >= 2) & (source < 2 + STAGES)
    stepping = (target >= STEPS) & (target < OTHER)
    return Moves(
        source=np.where(
            floor, _on_floors(source, target, floors), source * LIGHTS + before[change].astype(np.intp)
        ),
        reached=reached,
        starts=starts,
        place=place,
        stages=stages,
        change=change,
        from_white=from_white,
        on_other=source == OTHER,
        settles=(source == OTHER) & (target == 0),
        floor=floors,
        not_stepping=(~stepping).astype(float),
        brighter=np.where(stepping, np.inf, 0.0),
        on_edge=~from_white & (source > 1),
        entering=entering,
        turns=entering & ((target == 0) | (target >= 2 + STAGES)),
        moves_on=after[change].astype(float),
        part=part[change],
        uneven=uneven[change],
        wander=wander[change] ** 2,
        pace=pace[change] ** 2,
        sun=sun[change] ** 2,
        white_part=1.0 - dark,
        black_part=dark,
        blur=np.where((dark > 0.0) & (dark < 1.0), 0.3 / STAGES, 0.0),
    )


def _ways() -> list[tuple[int, int, int, int, int]]:
    """Each move: from and to which phase, by how many stages, which of `_CHANGES`, and to which floor."""
    steps = [(phase, phase, -1) for phase in (0, 1, OTHER)] + [(OTHER, 0, -1)]
    steps += [*_over_edge((0, OTHER), 2, 1), *_over_edge((1,), 2 + STAGES, 0)]
    ways = [(*step, change, -1) for step in steps for change in range(len(_CHANGES))]
    ways += [(*step, 0, -1) for step in _over_narrow()]
    for floor, (begins, end) in enumerate((((0, OTHER), OTHER), ((OTHER,), 0))):
        first = STEPS + floor * STAGES
        ways += [(*step, 0, floor) for step in _over_edge(begins, first, end)]  # under a light that stands
    return ways


def _over_edge(begins: tuple[int, ...], first: int, end: int) -> Iterator[tuple[int, int, int]]:
    """From and to which phase, by how many stages: from where an edge begins, over its stages, to its end."""
    for phase in begins:
        yield from ((phase, first + k - 1, k) for k in range(1, FASTEST + 1))
    for stage in range(STAGES):
        for k in range(FASTEST + 1):
            yield first + stage, first + stage + k if stage + k < STAGES else end, k


def _over_narrow() -> Iterator[tuple[int, int, int]]:
    """From the stages of an edge to black to those of one from black, where the spot is on as much of it:
    what is narrower than the spot ends before that is all on it."""
    for stage in range(STAGES):
        for k in range(FASTEST + 1):
            left = STAGES - 1 - stage + k
            yield 2 + stage, 2 + STAGES + left if left < STAGES else 0, k


def _on_floors(source: Index, target: Index, floors: Index) -> Index:
    """Where the stories that move along a border stand, after what changes there: its stages at the end of
    it, one by one, behind them white at its beginning, from white of the first floor and of another, and
    from that back."""
    begins = (source == 0) | (source == OTHER)
    ends = (target == 0) | (target == OTHER)
    leaving = STORIES + len(FLOORS) * STAGES + floors + (source == OTHER)
    return np.where(begins, leaving, np.where(ends, STORIES + source - STEPS, source * LIGHTS))


@lru_cache(maxsize=128)
def chances(pace_tenths: int, spot_microns: int, others_lost: bool | None, known: bool = True) -> Array:
    """Probability of every move at a pace (stages a reading); where it is not known, `SLOWER` as well."""
    moves = moves_of_stories()
    pace = 0.1 * pace_tenths
    way = pace * 1e-6 * spot_microns / STAGES
    number = np.arange(FASTEST + 1)
    paces = np.array([[pace], [pace / (1.0 if known else SLOWER)]])
    each = np.exp(-0.5 * ((number - paces) / (PACE_SPREAD * paces + LEAST_SPREAD)) ** 2)
    advance = (each / each.sum(axis=1, keepdims=True)).mean(axis=0)
    rate = np.where(moves.from_white, min(way / BETWEEN_LINES, 0.1), min(way / LINE_WIDTH, 0.2))
    along = advance[moves.stages]
    borders = np.array([min(way / FLOORS[0], 0.1), min(way / FLOORS[1], 0.1), 0.0])
    begun = np.where(moves.floor >= 0, borders[moves.floor], rate)
    entering = begun * along / (1.0 - advance[0])
    stays = 1.0 - rate - moves.from_white * borders[0] - moves.on_other * 2.0 * borders[1]
    stays = np.where(moves.settles, borders[1], stays)  # and is the floor
    turning = NARROW * min(pace / STAGES, 1.0)
    along = along * np.where(moves.turns, turning, np.where(moves.entering, 1.0 - turning, 1.0))
    chance = np.where(moves.stages < 0, stays, np.where(moves.on_edge, along, entering))
    begins = WITH_OTHERS[others_lost] * np.array(BEGINS)
    changes = np.array([1.0 - begins.sum(), *begins, 1.0 - ENDS, ENDS])
    return np.asarray(chance * np.where(moves.floor < 0, changes[moves.change], 1.0))
