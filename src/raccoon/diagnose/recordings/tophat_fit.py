"""White and black levels of a tophat explained by light from outside, gain, height, or two of them.

Light is an added offset in the contract, as a converter's is. Real light lowers both levels, black far more
(`raccoon.model.reflectance`): no offset does, so levels that fall like that are compared with it as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophat_words import AMBIENT, GAIN, HEIGHT
from raccoon.model.reflectance import FULL_SCALE, LEAST_HEIGHT, MOST_HEIGHT, counts
from raccoon.sim.tophats import GENERATION

Array = NDArray[np.float64]

WIDTHS = {AMBIENT: 200.0, GAIN: 0.2, HEIGHT: 0.006}
"""Twice the catalogue's width of a usual deviation."""
SAME_UNIT = 4.0
"""Counts by which two sound sensors of one make differ on the same floor at the least."""
PAIR_PENALTY = 6.0
ROUNDS = 40
FITS = 9.0
"""Misfit up to which levels count as explained."""
USUAL_LIGHT, LEAST_LIGHT = 0.1, 1e-4
"""Shares of direct sun: what recorded calibrations had at the most, and the least that is looked for."""


@dataclass(frozen=True, slots=True)
class Nominal:
    """What the simulation assumes of one sensor."""

    offset: float = 0.0
    factor: float = 1.0
    height: float = 0.007
    sd: float = 0.0

    def level(self, black: bool | float, offset: float, factor: float, height: float) -> float:
        """Counts over a surface with changes of the three on top."""
        return float(np.clip(self.uncut(black, offset, factor, height), 0.0, FULL_SCALE))

    def uncut(self, black: float, offset: float, factor: float, height: float, light: float = 0.0) -> float:
        """The same before the converter cuts it off. light: share of direct sun."""
        at = float(np.clip(self.height + height, LEAST_HEIGHT, MOST_HEIGHT))
        return self.factor * factor * counts(float(black), GENERATION, at, light) + self.offset + offset


@dataclass(frozen=True, slots=True)
class LevelFit:
    """Causes with their values. cost: misfit of the levels plus that of usual deviations.

    light: share of direct sun, where the levels fall as light makes them; the offset is then their mean, and
    the misfit that of the light.
    """

    ids: tuple[str, ...]
    values: Array
    stds: Array
    misfit: float
    cost: float
    light: float = 0.0


def level_fits(table: Array, nominal: Nominal, cut: tuple[int, int] = (0, 0)) -> list[LevelFit]:
    """No cause, each alone, each pair; a second one must earn its place.

    cut: of white and black, as `Levels` has it. A level that is cut off says only that it is beyond, and one
    level that is left tells no two causes.
    """
    names = tuple(WIDTHS)
    choices: list[tuple[str, ...]] = [(), *((each,) for each in names)]
    if cut == (0, 0):
        choices += combinations(names, 2)
    found = [_fit(table, nominal, each, cut) for each in choices]
    light = _light(table, nominal) if cut == (0, 0) else None
    return found if light is None else [*found, light]


def _fit(table: Array, nominal: Nominal, ids: tuple[str, ...], cut: tuple[int, int]) -> LevelFit:
    """Gauss-Newton on the levels with usual deviations as priors."""
    widths = np.array([WIDTHS[each] for each in ids])
    weight = 1.0 / np.hypot(table[:, 3], SAME_UNIT)

    def residual(u: Array) -> Array:
        pair = _pair(nominal, ids, widths * u)
        left = np.where(table[:, 1] > 0.5, pair[1], pair[0]) - table[:, 2]
        return _beyond(left, table[:, 1], cut) * weight

    u = np.zeros(len(ids))
    for _ in range(ROUNDS if len(ids) else 0):
        r = residual(u)
        J = np.column_stack([(residual(u + 1e-4 * row) - r) / 1e-4 for row in np.eye(len(ids))])
        A = J.T @ J + np.eye(len(ids))
        step = np.linalg.solve(A, J.T @ r + u)
        u = u - np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-6:
            break
    r = residual(u)
    if len(ids):
        J = np.column_stack([(residual(u + 1e-4 * row) - r) / 1e-4 for row in np.eye(len(ids))])
        stds = widths * np.sqrt(np.diag(np.linalg.inv(J.T @ J + np.eye(len(ids)))))
    else:
        stds = np.zeros(0)
    return LevelFit(ids, widths * u, stds, *_costs(r, u, len(table)))


def _beyond(left: Array, black: Array, cut: tuple[int, int]) -> Array:
    """Errors of the levels; none where a level that is cut off is beyond the end."""
    side = np.where(black > 0.5, cut[1], cut[0])
    below = np.where(side < 0, np.maximum(left, 0.0), left)
    return np.asarray(np.where(side > 0, np.minimum(left, 0.0), below))


def _costs(residual: Array, u: Array, rows: int) -> tuple[float, float]:
    """Misfit and cost. Large deviations are rare but happen: their cost grows as a logarithm."""
    misfit = float(residual @ residual) / max(rows / 2.0, 1.0)
    usual = 2.0 * float(np.log1p(u**2).sum())
    return misfit, misfit * max(rows / 4.0, 1.0) + usual + PAIR_PENALTY * len(u)


def _light(table: Array, nominal: Nominal) -> LevelFit | None:
    """Light alone, as the model of the sensor has it; None where the levels do not fall like that."""
    weight = 1.0 / np.hypot(table[:, 3], SAME_UNIT)

    def residual(light: float) -> Array:
        pair = [nominal.uncut(side, 0.0, 1.0, 0.0, light) for side in (0.0, 1.0)]
        return np.asarray((np.where(table[:, 1] > 0.5, pair[1], pair[0]) - table[:, 2]) * weight)

    grid = np.geomspace(LEAST_LIGHT, 1.0, 200)
    for _ in range(3):
        errors = [float(np.sum(residual(float(each)) ** 2)) for each in grid]
        best = int(np.argmin(errors))
        grid = np.geomspace(grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)], 20)
    light = float(grid[len(grid) // 2])
    misfit, cost = _costs(residual(light), np.array([light / USUAL_LIGHT]), len(table))
    if misfit > FITS:
        return None
    falls = [nominal.uncut(side, 0, 1, 0, light) - nominal.uncut(side, 0, 1, 0) for side in (0.0, 1.0)]
    offset, apart = 0.5 * (falls[0] + falls[1]), 0.5 * abs(falls[1] - falls[0])
    return LevelFit((AMBIENT,), np.array([offset]), np.array([apart]), misfit, cost, light)


def probability(fits: Sequence[LevelFit], id_: str) -> float:
    """Of a cause among all that was fitted, 0.99 at the most."""
    least = min(each.cost for each in fits)
    weights = [math.exp(-0.5 * (each.cost - least)) for each in fits]
    mine = sum(weight for each, weight in zip(fits, weights, strict=True) if id_ in each.ids)
    return min(0.99, mine / sum(weights))


def _pair(nominal: Nominal, ids: Sequence[str], values: Array) -> tuple[float, float]:
    """Counts over white and black with changes `values` of the causes `ids`, not cut off."""
    found = dict(zip(ids, values, strict=True))
    offset, height = float(found.get(AMBIENT, 0.0)), float(found.get(HEIGHT, 0.0))
    factor = max(1.0 + float(found.get(GAIN, 0.0)), 0.01)
    return nominal.uncut(0.0, offset, factor, height), nominal.uncut(1.0, offset, factor, height)


def predicted(black: Array, nominal: Nominal, ids: Sequence[str], values: Array) -> Array:
    """Counts over each surface (1 black, 0 white) with changes `values` of the causes `ids`."""
    pair = np.clip(_pair(nominal, ids, values), 0.0, FULL_SCALE)
    return np.asarray(np.where(black > 0.5, pair[1], pair[0]))
