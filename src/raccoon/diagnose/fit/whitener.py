"""From residuals to independent unit-variance numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.cross_validation import MIN_DIRECTION_VARIANCE
from raccoon.diagnose.fit.noise_model import NoiseModel

Array = NDArray[np.float64]


class WhiteningMap(Protocol):
    """A linear map from residuals to independent unit-variance numbers."""

    def __call__(self, signals: Array) -> Array:
        """(..., bins, channels) -> (..., rows)."""
        ...


@dataclass(frozen=True, slots=True)
class UncertainDirections:
    """Directions in which some rows have more than unit variance, and that taken away.

    directions (rows, k): orthonormal; shrink (k,): (1 + R R')^(-1/2) = 1 - U diag(1 - 1/sqrt(1 + s^2)) U' for
    R = U s V'. Of what is taken away seven digits do, in half of the time: a residual is some units of the
    noise.
    """

    rows: slice
    directions: NDArray[np.float32]
    shrink: Array

    @classmethod
    def of(cls, white: Array, start: int = 0) -> UncertainDirections:
        """Of whitened directions (directions, bins, channels) from that row on."""
        rows = white.reshape(len(white), white.shape[1] * white.shape[2]).T
        powers, right = np.linalg.eigh(rows.T @ rows)
        strong = powers > MIN_DIRECTION_VARIANCE
        left = rows @ (right[:, strong] / np.sqrt(powers[strong]))
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + powers[strong])
        return cls(slice(start, start + len(rows)), left.astype(np.float32), shrink)

    def with_part(self, part: float) -> UncertainDirections:
        """The same with a part of what makes it uncertain."""
        variance = part**2 * (1.0 / (1.0 - self.shrink) ** 2 - 1.0)
        return replace(self, shrink=1.0 - 1.0 / np.sqrt(1.0 + variance))

    @property
    def spread(self) -> Array:
        """The directions as they were, (rows, k), each as long as what it adds to a row's standard
        deviation."""
        return np.asarray(self.directions * np.sqrt(1.0 / (1.0 - self.shrink) ** 2 - 1.0), float)

    def restricted_to(self, seen: NDArray[np.bool_]) -> UncertainDirections:
        """What is uncertain of some of all rows, (rows,), by themselves."""
        part = self.spread * seen[self.rows, None]
        return UncertainDirections.of(part.T[:, :, None], self.rows.start)

    def undo_whitening(self, rows: Array) -> None:
        """Undo `take_away`."""
        mine = rows[..., self.rows]
        mine += mine @ self.directions * (1.0 / (1.0 - self.shrink) - 1.0) @ self.directions.T

    def whiten_in_place(self, rows: Array) -> None:
        """Rows (..., rows) of the whole recording become white in these directions too."""
        mine = rows[..., self.rows]
        along = mine.astype(np.float32) @ self.directions * self.shrink.astype(np.float32)
        mine -= along @ self.directions.T


@dataclass(frozen=True, slots=True)
class Whitener:
    """Makes independent unit-variance numbers of residuals: VAR noise, then what wanders slowly, piece by
    piece, then what the whole recording has in common; where there is one piece, both at once.

    (1 + W W' + C C')^-1 = A' (1 + A C C' A')^-1 A with A = (1 + W W')^(-1/2), so the directions of `common`
    are those that were white but for what wanders, made white with it.

    rest (bins, channels): what nothing explained when this was made. spread (bins, channels): variance in
    channel units that wandering friction and what no model gets right have on unseen data; a fit of
    everything takes it away, so it is not in `rest`. wander: by what share of Coulomb friction the floor is
    expected to let it wander.
    """

    noise: NoiseModel
    wandering: tuple[UncertainDirections, ...]
    common: UncertainDirections | None
    unexplained: Array
    held_out_variance: Array
    wander_share: float = 0.0

    @classmethod
    def plain(cls, noise: NoiseModel, rest: Array) -> Whitener:
        """Of noise alone."""
        return cls(noise, (), None, rest, np.zeros_like(rest))

    @classmethod
    def of(
        cls,
        noise: NoiseModel,
        wandering: Sequence[Array],
        common: Array,
        rest: Array,
        spread: Array,
        wander: float,
    ) -> Whitener:
        """wandering: directions (directions, bins, channels) of one piece after the other; common: of all of
        them. Both whitened by the noise."""
        if len(wandering) == 1:
            wandering, common = [np.concatenate([*wandering, common])], common[:0]
        starts = np.cumsum([0, *(each.shape[1] * each.shape[2] for each in wandering)])
        steps = [
            UncertainDirections.of(each, start) for each, start in zip(wandering, starts[:-1], strict=True)
        ]
        local = cls(noise, tuple(steps), None, rest, spread, wander)
        if not len(common):
            return local
        rows = local.slowed(common.reshape(len(common), -1))
        return replace(local, common=UncertainDirections.of(rows[:, :, None]))

    def noise_only(self) -> Whitener:
        """The same of noise alone."""
        return replace(self, wandering=(), common=None)

    def with_wander_share(self, part: float) -> Whitener:
        """The same with a part of what wanders. Raises ValueError where more is uncertain in all pieces: made
        white after it, that depends on it."""
        if self.common is not None:
            raise ValueError("what is uncertain beside what wanders would have to be made white anew")
        return replace(self, wandering=tuple(each.with_part(part) for each in self.wandering))

    def restricted_to_bins(self, seen: NDArray[np.bool_]) -> Whitener:
        """The same of some bins, (bins,), by themselves: rows of the others are 0, whatever is in them."""
        noise = replace(self.noise, weights=self.noise.weights * seen)
        rows = np.repeat(seen, self.unexplained.shape[1])
        wandering = tuple(each.restricted_to(rows) for each in self.wandering)
        local = replace(self, noise=noise, wandering=wandering, common=None)
        if self.common is None:
            return local
        common = self.common.spread.T
        for each in self.wandering:
            each.undo_whitening(common)
        return replace(local, common=UncertainDirections.of(local.slowed(common * rows)[:, :, None]))

    def __call__(self, signals: Array) -> Array:
        """(..., bins, channels) -> (..., rows)."""
        white = self.noise.whiten(signals)
        return self._whiten_uncertain_in_place(white.reshape(*white.shape[:-2], -1))

    def slowed(self, rows: Array) -> Array:
        """Rows (..., rows) that are white but for what is uncertain, white with it too."""
        return self._whiten_uncertain_in_place(rows.copy())

    def _whiten_uncertain_in_place(self, rows: Array) -> Array:
        for each in self.wandering:
            each.whiten_in_place(rows)
        if self.common is not None:
            self.common.whiten_in_place(rows)
        return rows

    def gram_reduction(self, rows: Array) -> Array:
        """By how much less the inner products are of `slowed` rows, (rows, rows), at half of the cost."""
        less = np.zeros((len(rows), len(rows)))
        common = np.zeros((rows.shape[1], 0)) if self.common is None else self.common.directions
        left = rows @ common
        for each in self.wandering:
            along = rows[:, each.rows] @ each.directions
            less += _product_reduction(along, each.shrink)
            left -= (along * each.shrink) @ (each.directions.T @ common[each.rows])
        return less if self.common is None else less + _product_reduction(left, self.common.shrink)


def _product_reduction(along: Array, shrink: Array) -> Array:
    """What inner products lose where so much is taken away of the parts along some directions."""
    return np.asarray((along * (1.0 - (1.0 - shrink) ** 2)) @ along.T, float)
