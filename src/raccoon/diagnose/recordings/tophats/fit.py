"""Fits a tophat's white and black levels by ambient light, gain, height, or several of them.

In the contract, light is an added offset. Real light lowers both levels, black far more, and the older make
of sensor differs in both (`raccoon.model.reflectance`), unlike any offset or factor. So both are fitted as
well, and the result is expressed in the contract's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.sentences import AMBIENT_LIGHT, GAIN, HEIGHT
from raccoon.model.reflectance import (
    FULL_SCALE,
    MAX_HEIGHT,
    MIN_HEIGHT,
    black_doubt,
    counts,
    height_doubt,
)
from raccoon.sim.tophats import SENSOR_GENERATION

Array = NDArray[np.float64]

CHANGE_WIDTHS = {AMBIENT_LIGHT: 200.0, GAIN: 0.2, HEIGHT: 0.006}
"""Scales of the causes' changes: twice the catalogue's width of a usual deviation."""
LIGHT = "light"
"""Name of real light, which is fitted in place of an offset."""
OLDER_GENERATION = "old"
PARAMETER_COST = 6.0
"""Cost of each fitted parameter, and of the assumption of the other make of sensor."""
MIN_DOUBT_HEIGHT = 0.005
"""Height, m, below which the uncertainty of black no longer increases, since it would then explain any
level."""
MAX_STEPS = 40
"""Largest number of steps of a fit."""
MAX_MISFIT = 9.0
"""Largest misfit of levels that count as explained."""
MAX_PROBABILITY_OF_PAIR = 0.8
"""Largest probability of a cause if two are named: on sensors with two hidden causes whose levels needed two,
three of four names were right."""
USUAL_LIGHT = 0.1
"""Largest share of direct sun in recorded calibrations."""


@dataclass(frozen=True, slots=True)
class NominalSensor:
    """The simulation's assumptions on one sensor: offset, counts; factor; height, m; sd of its noise,
    counts."""

    offset: float = 0.0
    factor: float = 1.0
    height: float = 0.007
    sd: float = 0.0

    def level(self, black: float) -> float:
        """Counts over a surface (1 black, 0 white), clipped to the converter's range."""
        return float(np.clip(self.unclipped_level(black, 0.0, 1.0, 0.0), 0.0, FULL_SCALE))

    def unclipped_level(
        self,
        black: float,
        offset: float,
        factor: float,
        height: float,
        light: float = 0.0,
        generation: str = SENSOR_GENERATION,
    ) -> float:
        """Counts over a surface with changes of offset, factor and height, before clipping. light: share of
        direct sun."""
        at = _clip_height(self.height + height)
        return self.factor * factor * counts(float(black), generation, at, light) + self.offset + offset


@dataclass(frozen=True, slots=True)
class LevelFit:
    """A fit of causes `ids`, with the values of their changes and standard deviations.

    misfit: sum of the squared whitened residuals of the levels. cost: misfit plus the costs of the deviations
    and of the `parameter_count` fitted parameters. light: share of direct sun, if light lowers the levels.
    level_drops: counts by which it lowers white and black; the offset is minus their mean. generation:
    assumed make of sensor; if it is not the simulation's, the factor is the best approximation. The misfit is
    that with the light and make themselves.
    """

    ids: tuple[str, ...]
    values: Array
    stds: Array
    misfit: float
    cost: float
    parameter_count: int
    light: float = 0.0
    level_drops: tuple[float, float] = (0.0, 0.0)
    generation: str = SENSOR_GENERATION

    @property
    def is_exact(self) -> bool:
        """Whether the causes' values reproduce the fitted levels exactly."""
        return self.light == 0.0 and self.generation == SENSOR_GENERATION


def _clip_height(height: float) -> float:
    """The height, m, clipped to the validity range of the reflectance model."""
    return float(np.clip(height, MIN_HEIGHT, MAX_HEIGHT))


def fit_levels(table: Array, nominal: NominalSensor, clipped: tuple[int, int] = (0, 0)) -> list[LevelFit]:
    """Fits without a cause, with each single cause, and with several; each parameter has its cost.

    table: from `SurfaceLevels.surface_levels`. clipped: `SurfaceLevels.clipped`. A clipped level only shows
    that it is beyond the range, and the single other level does not distinguish two causes.
    """
    single_causes: list[tuple[str, ...]] = [(), *((each,) for each in CHANGE_WIDTHS)]
    if clipped != (0, 0):
        return [_fit_causes(table, nominal, each, clipped) for each in single_causes]
    in_light: list[tuple[str, ...]] = [(LIGHT,), (HEIGHT, LIGHT)]
    newer = [
        _fit_causes(table, nominal, each)
        for each in (*single_causes, *combinations(CHANGE_WIDTHS, 2), *in_light)
    ]
    older = [
        _fit_causes(table, nominal, each, generation=OLDER_GENERATION) for each in ((), (HEIGHT,), *in_light)
    ]
    return [*newer, *older]


def _fit_causes(
    table: Array,
    nominal: NominalSensor,
    free: tuple[str, ...],
    clipped: tuple[int, int] = (0, 0),
    generation: str = SENSOR_GENERATION,
) -> LevelFit:
    """Fit these causes to the levels, with usual deviations as priors."""
    u, misfit, std = _gauss_newton(table, nominal, free, clipped, generation)
    if HEIGHT in free and clipped == (0, 0):  # refit with the uncertainty of black at that height
        height = max(_clip_height(nominal.height + _changes(free, u)[HEIGHT]), MIN_DOUBT_HEIGHT)
        black_std = np.where(table[:, 0] > 0.5, black_doubt(generation, height), 0.0)
        wider = np.column_stack([table[:, :2], np.hypot(table[:, 2], black_std)])
        u, misfit, std = _gauss_newton(wider, nominal, free, clipped, generation)
    return _as_contract_numbers(nominal, free, u, std, misfit, generation)


def _gauss_newton(
    table: Array, nominal: NominalSensor, free: tuple[str, ...], clipped: tuple[int, int], generation: str
) -> tuple[Array, float, Array]:
    """Gauss-Newton fit: coordinates of the causes, misfit of the levels, standard deviations of the
    coordinates."""
    black, level, weights = table[:, 0], table[:, 1], 1.0 / table[:, 2]

    def residual(u: Array) -> Array:
        pair = _unclipped_pair(nominal, _changes(free, u), generation)
        return _clipped_residuals(np.where(black > 0.5, pair[1], pair[0]) - level, black, clipped) * weights

    def slopes(u: Array, r: Array) -> Array:
        return np.column_stack([(residual(u + 1e-4 * row) - r) / 1e-4 for row in np.eye(len(free))])

    # The square root of light is fitted, which keeps light positive; at 0 the gradient would vanish.
    u = np.array([0.3 if each == LIGHT else 0.0 for each in free])
    for _ in range(MAX_STEPS if free else 0):
        r = residual(u)
        J = slopes(u, r)
        step = np.linalg.solve(J.T @ J + np.eye(len(free)), J.T @ r + u)
        u = u - np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-6:
            break
    r = residual(u)
    std = np.zeros(0)
    if free:
        J = slopes(u, r)
        std = np.sqrt(np.diag(np.linalg.inv(J.T @ J + np.eye(len(free)))))
    return u, float(r @ r), std


def _changes(free: Sequence[str], u: Array) -> dict[str, float]:
    """Changes of the causes, and the light, at the coordinates u."""
    return {
        each: USUAL_LIGHT * float(coordinate) ** 2
        if each == LIGHT
        else CHANGE_WIDTHS[each] * float(coordinate)
        for each, coordinate in zip(free, u, strict=True)
    }


def _as_contract_numbers(
    nominal: NominalSensor, free: Sequence[str], u: Array, std: Array, misfit: float, generation: str
) -> LevelFit:
    """The fit in the contract's parameters: light as an offset and another make as a factor, by the best
    approximation over white and black."""
    # Large deviations are rare but happen: their cost grows logarithmically.
    parameter_count = len(free) + (generation != SENSOR_GENERATION)
    cost = misfit + 2.0 * float(np.log1p(u**2).sum()) + PARAMETER_COST * parameter_count
    changes = _changes(free, u)
    found = {
        each: (changes[each], CHANGE_WIDTHS[each] * float(std_of_u))
        for each, std_of_u in zip(free, std, strict=True)
        if each != LIGHT
    }
    height, light = changes.get(HEIGHT, 0.0), changes.get(LIGHT, 0.0)
    if HEIGHT in found:
        doubt = height_doubt(_clip_height(nominal.height + height))
        found[HEIGHT] = height, math.hypot(found[HEIGHT][1], doubt)
    unlit = [nominal.unclipped_level(side, 0.0, 1.0, height, 0.0, generation) for side in (0.0, 1.0)]
    if generation != SENSOR_GENERATION:
        usual = np.array([nominal.unclipped_level(side, 0.0, 1.0, height) for side in (0.0, 1.0)])
        factors = np.array(unlit) / usual
        factor = float(usual @ np.array(unlit) / (usual @ usual))
        found[GAIN] = factor - 1.0, 0.5 * float(np.ptp(factors))
    level_drops = (0.0, 0.0)
    if light:
        lit = [nominal.unclipped_level(side, 0.0, 1.0, height, light, generation) for side in (0.0, 1.0)]
        level_drops = unlit[0] - lit[0], unlit[1] - lit[1]
        found[AMBIENT_LIGHT] = (
            -0.5 * (level_drops[0] + level_drops[1]),
            0.5 * abs(level_drops[1] - level_drops[0]),
        )
    ids = tuple(each for each in CHANGE_WIDTHS if each in found)
    values, stds = (np.array([found[each][index] for each in ids]) for index in (0, 1))
    return LevelFit(ids, values, stds, misfit, cost, parameter_count, light, level_drops, generation)


def _clipped_residuals(residuals: Array, black: Array, clipped: tuple[int, int]) -> Array:
    """Residuals of the levels; 0 if a clipped level is predicted beyond the end of the range."""
    side = np.where(black > 0.5, clipped[1], clipped[0])
    below = np.where(side < 0, np.maximum(residuals, 0.0), residuals)
    return np.asarray(np.where(side > 0, np.minimum(residuals, 0.0), below))


def probability(fits: Sequence[LevelFit], id_: str) -> float:
    """Probability of a cause among all fits: at most 0.99, or `MAX_PROBABILITY_OF_PAIR` if the best fit has
    two parameters."""
    best = min(fits, key=lambda each: each.cost)
    least, most = best.cost, 0.99 if best.parameter_count < 2 else MAX_PROBABILITY_OF_PAIR
    weights = [math.exp(-0.5 * (each.cost - least)) for each in fits]
    mine = sum(weight for each, weight in zip(fits, weights, strict=True) if id_ in each.ids)
    return min(most, mine / sum(weights))


def _unclipped_pair(
    nominal: NominalSensor, changes: Mapping[str, float], generation: str = SENSOR_GENERATION
) -> tuple[float, float]:
    """Unclipped counts over white and black with these changes of the causes and the light."""
    offset, height, light = (changes.get(each, 0.0) for each in (AMBIENT_LIGHT, HEIGHT, LIGHT))
    factor = max(1.0 + changes.get(GAIN, 0.0), 0.01)
    white, black = (
        nominal.unclipped_level(side, offset, factor, height, light, generation) for side in (0.0, 1.0)
    )
    return white, black


def predict_counts(black: Array, nominal: NominalSensor, ids: Sequence[str], values: Array) -> Array:
    """Counts over each surface (1 black, 0 white) with changes `values` of the causes `ids`."""
    changes = {each: float(value) for each, value in zip(ids, values, strict=True)}
    pair = np.clip(_unclipped_pair(nominal, changes), 0.0, FULL_SCALE)
    return np.asarray(np.where(black > 0.5, pair[1], pair[0]))
