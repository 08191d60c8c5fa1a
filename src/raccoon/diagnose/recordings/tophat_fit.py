"""White and black levels of a tophat explained by light from outside, gain, height, or two of them."""

from __future__ import annotations

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


@dataclass(frozen=True, slots=True)
class Nominal:
    """What the simulation assumes of one sensor."""

    offset: float = 0.0
    factor: float = 1.0
    height: float = 0.007
    sd: float = 0.0

    def level(self, black: bool | float, offset: float, factor: float, height: float) -> float:
        """Counts over a surface with changes of the three on top."""
        at = float(np.clip(self.height + height, LEAST_HEIGHT, MOST_HEIGHT))
        read = self.factor * factor * counts(float(black), GENERATION, at) + self.offset + offset
        return float(np.clip(read, 0.0, FULL_SCALE))


@dataclass(frozen=True, slots=True)
class LevelFit:
    """Causes with their values. cost: misfit of the levels plus that of usual deviations."""

    ids: tuple[str, ...]
    values: Array
    stds: Array
    misfit: float
    cost: float


def level_fits(table: Array, nominal: Nominal) -> list[LevelFit]:
    """No cause, each alone, each pair; a second one must earn its place."""
    names = tuple(WIDTHS)
    choices: list[tuple[str, ...]] = [(), *((each,) for each in names), *combinations(names, 2)]
    return [_fit(table, nominal, each) for each in choices]


def _fit(table: Array, nominal: Nominal, ids: tuple[str, ...]) -> LevelFit:
    """Gauss-Newton on the levels with usual deviations as priors."""
    widths = np.array([WIDTHS[each] for each in ids])
    weight = 1.0 / np.hypot(table[:, 3], SAME_UNIT)

    def residual(u: Array) -> Array:
        return (predicted(table[:, 1], nominal, ids, widths * u) - table[:, 2]) * weight

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
    misfit = float(r @ r) / max(len(table) / 2.0, 1.0)
    cost = misfit * max(len(table) / 4.0, 1.0) + float(u @ u) + PAIR_PENALTY * len(ids)
    return LevelFit(ids, widths * u, stds, misfit, cost)


def predicted(black: Array, nominal: Nominal, ids: Sequence[str], values: Array) -> Array:
    """Counts over each surface (1 black, 0 white) with changes `values` of the causes `ids`."""
    found = dict(zip(ids, values, strict=True))
    offset, height = float(found.get(AMBIENT, 0.0)), float(found.get(HEIGHT, 0.0))
    factor = max(1.0 + float(found.get(GAIN, 0.0)), 0.01)
    pair = [nominal.level(side, offset, factor, height) for side in (0.0, 1.0)]
    return np.where(black > 0.5, pair[1], pair[0])
