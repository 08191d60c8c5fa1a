"""The modes of a tophat's readings (surface and light), and their transition probabilities, for
`hypotheses`."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import edge_coverage

Array = NDArray[np.float64]
Index = NDArray[np.intp]

STAGES = 6  # stages of an edge
MAX_STAGES_PER_READING = 4  # stages in one reading
# sd of the stages per reading, as a share and at least: speed and spot are known roughly
PACE_SPREAD, MIN_SPREAD = 0.3, 0.35
UNKNOWN_WAY_FACTOR = 2.0  # factor by which the robot may be slower than assumed if its distance is unknown
STANDING_LIGHT_SD = 0.003  # sd of the change in one reading while the light stands, as a share of u
LIGHT_PACE_SDS = (0.06, 0.4)  # sd of the change in one reading as the light begins to move, as a share of u
SUNLIGHT_SD = 15.0  # light; sd of that change if the sun comes out at once
LIGHT_CHANGE_BEGINS = (1.0 / 1500, 1.0 / 4000, 1.0 / 4000)  # probability in one reading, at each pace
LIGHT_CHANGE_ENDS = 1.0 / 30  # probability in one reading
PACE_CHANGE_SD = 0.15  # sd of the change of the pace from one reading to the next, as a share of it
OTHERS_LOST_FACTORS = {None: 1.0, True: 8.0, False: 0.5}
"""Factors on the probability of a change of light, by whether other sensors are lost (None: there are
none)."""
LEAKED_LIGHT = 0.03  # light that a sensor gets over any surface
BETWEEN_LINES_M, LINE_WIDTH_M = 0.2, 0.05  # m, means
NARROW_LINE_SHARE = 0.1  # share of apparent lines that are narrower than the spot: seams, scratches
LIGHT_STATES = 2  # standing, moving
FLOOR_BORDERS_M = (2.0, 0.3)
"""m between borders of the floor, means: to any other floor, and back to the first."""
FIRST_BORDER_PHASE = 2 + 2 * STAGES
"""The first phase on the border to another floor. That floor is as white: its light is in black's place."""
OTHER_FLOOR_PHASE = FIRST_BORDER_PHASE + len(FLOOR_BORDERS_M) * STAGES
"""The phase of white on another floor, from which the former floor may return."""
PHASES = OTHER_FLOOR_PHASE + 1
MODES = PHASES * LIGHT_STATES
EDGE_MODES = slice(2 * LIGHT_STATES, FIRST_BORDER_PHASE * LIGHT_STATES, LIGHT_STATES)
"""The stages of an edge, in standing light."""
BORDER_MODES = slice(FIRST_BORDER_PHASE * LIGHT_STATES, OTHER_FLOOR_PHASE * LIGHT_STATES, LIGHT_STATES)
OTHER_FLOOR_MODE = OTHER_FLOOR_PHASE * LIGHT_STATES

_coverage = edge_coverage(1.0 - 2.0 * (np.arange(STAGES) + 0.5) / STAGES, 1.0)
PHASE_COVERAGE: Array = np.concatenate(
    [[0.0, 1.0], _coverage, _coverage[::-1], *[_coverage] * len(FLOOR_BORDERS_M), [0.0]]
)
"""Share of the spot on black, or on the floor ahead, by phase: white, black, entering black, leaving it,
entering each floor, and on it."""
MODE_GROUPS: Index = np.repeat(
    [0, 1] + [2] * 2 * STAGES + [3] * len(FLOOR_BORDERS_M) * STAGES + [0], LIGHT_STATES
)


def _mode_sums() -> Array:
    """1 where a mode belongs to a sum: white, black, more than half on black, on a border, standing light and
    no edge."""
    phase, state = np.divmod(np.arange(MODES), LIGHT_STATES)
    on_white, on_black = (phase == 0) | (phase == OTHER_FLOOR_PHASE), phase == 1
    crossing = (phase > 1) & (phase < FIRST_BORDER_PHASE)
    on_border = (phase >= FIRST_BORDER_PHASE) & (phase < OTHER_FLOOR_PHASE)
    mostly_black = crossing & (PHASE_COVERAGE[phase] > 0.5)
    is_steady = (on_white | on_black) & (state == 0)
    return np.stack([on_white, on_black, mostly_black, on_border, is_steady], axis=1).astype(float)


MODE_SUMS: Array = _mode_sums()
"""Matrix by which the modes' probabilities sum up to those (modes, sums)."""


class Predictions(NamedTuple):
    """Every pair of a source and a change of light, one array for each property.

    source: the mode, or, from `MODES` on, one that reaches another floor or leaves for it
    (`bank_step._with_floor_modes`).
    """

    source: Index
    keeps_pace: Array
    pace_share: Array
    pace_share_squared: Array
    pace_change_variance: Array
    standing_variance: Array
    pace_variance: Array
    sunlight_variance: Array


class ModeTransitions(NamedTuple):
    """Every transition from mode to mode, one array for each property: prediction, target, stages (-1: none),
    change of light.

    They are sorted by target: those to `reached_modes[reached_index]` begin at `reached_starts`. Transitions
    from the same source with the same change of light share a prediction; `prediction` is its index in
    `predictions`. floor: index in `FLOOR_BORDERS_M`, -1 for none. leaked_light: light over black besides its
    share of white's; infinite on a border. max_excess_light: bound on the light in black's place above u;
    infinite on a border.
    """

    predictions: Predictions
    prediction: Index
    reached_modes: Index
    reached_starts: Index
    reached_index: Index
    stages: Index
    change: Index
    from_white: NDArray[np.bool_]
    on_other: NDArray[np.bool_]
    adopts_floor: NDArray[np.bool_]
    floor: Index
    leaked_light: Array
    max_excess_light: Array
    on_edge: NDArray[np.bool_]
    entering: NDArray[np.bool_]
    leaves_narrow_line: NDArray[np.bool_]
    white_part: Array
    black_part: Array
    blur: Array


# Changes of light from one reading to the next: state before, state after, sd of the change (share of u), of
# the pace (share of u) and of the pace (light), share of the pace that this reading gets and its variance.
# Light stops anywhere between two readings.
_LIGHT_CHANGES = (
    (0, 0, STANDING_LIGHT_SD, 0.0, 0.0, 0.0, 0.0),
    (0, 1, 0.0, LIGHT_PACE_SDS[0], 0.0, 1.0, 0.0),
    (0, 1, 0.0, LIGHT_PACE_SDS[1], 0.0, 1.0, 0.0),
    (0, 1, 0.0, 0.0, SUNLIGHT_SD, 1.0, 0.0),
    (1, 1, 0.0, 0.0, 0.0, 1.0, PACE_CHANGE_SD**2),
    (1, 0, STANDING_LIGHT_SD, 0.0, 0.0, 0.5, 1.0 / 12.0),
)


@lru_cache(maxsize=1)
def mode_transitions() -> ModeTransitions:
    """All transitions; the arrays are shared: do not change them."""
    transitions = _list_transitions()
    after = np.array([each[1] for each in _LIGHT_CHANGES], dtype=np.intp)
    transitions.sort(key=lambda way: (way[1], after[way[3]]))
    source, target, stages, change, floors = np.array(transitions, dtype=np.intp).T
    reached, starts, place = np.unique(
        target * LIGHT_STATES + after[change], return_index=True, return_inverse=True
    )
    from_white = (source == 0) | (source == OTHER_FLOOR_PHASE)
    dark, entering = PHASE_COVERAGE[target], (source >= 2) & (source < 2 + STAGES)
    stepping = (target >= FIRST_BORDER_PHASE) & (target < OTHER_FLOOR_PHASE)
    predictions, prediction = _list_predictions(source, target, change, floors)
    return ModeTransitions(
        predictions=predictions,
        prediction=prediction,
        reached_modes=reached,
        reached_starts=starts,
        reached_index=place,
        stages=stages,
        change=change,
        from_white=from_white,
        on_other=source == OTHER_FLOOR_PHASE,
        adopts_floor=(source == OTHER_FLOOR_PHASE) & (target == 0),
        floor=floors,
        leaked_light=np.where(stepping, np.inf, LEAKED_LIGHT),
        max_excess_light=np.where(stepping, np.inf, 0.0),
        on_edge=~from_white & (source > 1),
        entering=entering,
        leaves_narrow_line=entering & ((target == 0) | (target >= 2 + STAGES)),
        white_part=1.0 - dark,
        black_part=dark,
        blur=np.where((dark > 0.0) & (dark < 1.0), 0.3 / STAGES, 0.0),
    )


def _list_predictions(
    source: Index, target: Index, change: Index, floors: Index
) -> tuple[Predictions, Index]:
    """The pairs of source and change of light, and the index of each transition's pair."""
    before, after, wander, pace, sun, part, uneven = np.array(_LIGHT_CHANGES).T
    modes = np.where(
        floors >= 0,
        _floor_sources(source, target, floors),
        source * LIGHT_STATES + before[change].astype(np.intp),
    )
    pairs, prediction = np.unique(modes * len(_LIGHT_CHANGES) + change, return_inverse=True)
    modes, change = np.divmod(pairs, len(_LIGHT_CHANGES))
    found = Predictions(
        source=modes,
        keeps_pace=after[change],
        pace_share=part[change],
        pace_share_squared=part[change] ** 2,
        pace_change_variance=uneven[change],
        standing_variance=wander[change] ** 2,
        pace_variance=pace[change] ** 2,
        sunlight_variance=sun[change] ** 2,
    )
    return found, prediction


def _list_transitions() -> list[tuple[int, int, int, int, int]]:
    """Each transition: source and target phase, stages, index in `_LIGHT_CHANGES`, and index of the floor."""
    steps = [(phase, phase, -1) for phase in (0, 1, OTHER_FLOOR_PHASE)] + [(OTHER_FLOOR_PHASE, 0, -1)]
    steps += [*_edge_transitions((0, OTHER_FLOOR_PHASE), 2, 1), *_edge_transitions((1,), 2 + STAGES, 0)]
    transitions = [(*step, change, -1) for step in steps for change in range(len(_LIGHT_CHANGES))]
    transitions += [(*step, 0, -1) for step in _narrow_line_transitions()]
    borders = (((0, OTHER_FLOOR_PHASE), OTHER_FLOOR_PHASE), ((OTHER_FLOOR_PHASE,), 0))
    for floor, (begins, end) in enumerate(borders):  # in standing light
        first = FIRST_BORDER_PHASE + floor * STAGES
        transitions += [(*step, 0, floor) for step in _edge_transitions(begins, first, end)]
    return transitions


def _edge_transitions(begins: tuple[int, ...], first: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Source and target phase, and stages: from where an edge begins, over its stages, to its end."""
    for phase in begins:
        yield from ((phase, first + k - 1, k) for k in range(1, MAX_STAGES_PER_READING + 1))
    for stage in range(STAGES):
        for k in range(MAX_STAGES_PER_READING + 1):
            yield first + stage, first + stage + k if stage + k < STAGES else end, k


def _narrow_line_transitions() -> Iterator[tuple[int, int, int]]:
    """From the stages of an edge to black to those of an edge from black with the same coverage: a line
    narrower than the spot ends before the spot is on it entirely."""
    for stage in range(STAGES):
        for k in range(MAX_STAGES_PER_READING + 1):
            left = STAGES - 1 - stage + k
            yield 2 + stage, 2 + STAGES + left if left < STAGES else 0, k


def _floor_sources(source: Index, target: Index, floors: Index) -> Index:
    """Index of the source of each border transition in `bank_step._with_floor_modes`: behind the modes
    are the stages that reach the end of a border, one by one; then white that leaves the first floor, leaves
    another one, and leaves that back to the first."""
    begins = (source == 0) | (source == OTHER_FLOOR_PHASE)
    ends = (target == 0) | (target == OTHER_FLOOR_PHASE)
    leaving = MODES + len(FLOOR_BORDERS_M) * STAGES + floors + (source == OTHER_FLOOR_PHASE)
    return np.where(
        begins, leaving, np.where(ends, MODES + source - FIRST_BORDER_PHASE, source * LIGHT_STATES)
    )


@lru_cache(maxsize=128)
def transition_probabilities(
    pace_tenths: int, spot_microns: int, others_lost: bool | None, way_known: bool = True
) -> Array:
    """Probability of every transition at a pace in stages per reading. For an unknown distance it is the mean
    of this pace and one slower by `UNKNOWN_WAY_FACTOR`."""
    transitions = mode_transitions()
    pace = 0.1 * pace_tenths
    way = pace * 1e-6 * spot_microns / STAGES
    number = np.arange(MAX_STAGES_PER_READING + 1)
    paces = np.array([[pace], [pace / (1.0 if way_known else UNKNOWN_WAY_FACTOR)]])
    weights = np.exp(-0.5 * ((number - paces) / (PACE_SPREAD * paces + MIN_SPREAD)) ** 2)
    advance = (weights / weights.sum(axis=1, keepdims=True)).mean(axis=0)
    rate = np.where(transitions.from_white, min(way / BETWEEN_LINES_M, 0.1), min(way / LINE_WIDTH_M, 0.2))
    along = advance[transitions.stages]
    borders = np.array([min(way / FLOOR_BORDERS_M[0], 0.1), min(way / FLOOR_BORDERS_M[1], 0.1), 0.0])
    begun = np.where(transitions.floor >= 0, borders[transitions.floor], rate)
    entering = begun * along / (1.0 - advance[0])
    stay = 1.0 - rate - transitions.from_white * borders[0] - transitions.on_other * 2.0 * borders[1]
    stay = np.where(transitions.adopts_floor, borders[1], stay)  # adopted as the floor
    turning = NARROW_LINE_SHARE * min(pace / STAGES, 1.0)
    along = along * np.where(
        transitions.leaves_narrow_line, turning, np.where(transitions.entering, 1.0 - turning, 1.0)
    )
    probability = np.where(transitions.stages < 0, stay, np.where(transitions.on_edge, along, entering))
    begins = OTHERS_LOST_FACTORS[others_lost] * np.array(LIGHT_CHANGE_BEGINS)
    changes = np.array([1.0 - begins.sum(), *begins, 1.0 - LIGHT_CHANGE_ENDS, LIGHT_CHANGE_ENDS])
    return np.asarray(probability * np.where(transitions.floor < 0, changes[transitions.change], 1.0))
