"""Whitening: the map from residuals to independent unit-variance numbers."""

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
    """Directions in which some rows have more than unit variance, and the factors that reduce it to 1.

    directions (rows, k): orthonormal; shrink (k,): (1 + R R')^(-1/2) = 1 - U diag(1 - 1/sqrt(1 + s^2)) U' for
    R = U s V'. Single precision suffices for the subtracted part, and takes half the time: a residual is some
    units of the noise.
    """

    rows: slice
    directions: NDArray[np.float32]
    shrink: Array

    @classmethod
    def of(cls, white: Array, start: int = 0) -> UncertainDirections:
        """From whitened directions (directions, bins, channels), whose rows begin at `start`."""
        rows = white.reshape(len(white), white.shape[1] * white.shape[2]).T
        powers, right = np.linalg.eigh(rows.T @ rows)
        strong = powers > MIN_DIRECTION_VARIANCE
        left = rows @ (right[:, strong] / np.sqrt(powers[strong]))
        shrink = 1.0 - 1.0 / np.sqrt(1.0 + powers[strong])
        return cls(slice(start, start + len(rows)), left.astype(np.float32), shrink)

    def with_share(self, share: float) -> UncertainDirections:
        """The same directions with their standard deviations multiplied by `share`."""
        variance = share**2 * (1.0 / (1.0 - self.shrink) ** 2 - 1.0)
        return replace(self, shrink=1.0 - 1.0 / np.sqrt(1.0 + variance))

    @property
    def spread(self) -> Array:
        """The directions (rows, k), each scaled to its standard deviation."""
        return np.asarray(self.directions * np.sqrt(1.0 / (1.0 - self.shrink) ** 2 - 1.0), float)

    def restricted_to(self, mask: NDArray[np.bool_]) -> UncertainDirections:
        """The uncertain directions restricted to the rows of a mask (rows of the whole recording,)."""
        spread = self.spread * mask[self.rows, None]
        return UncertainDirections.of(spread.T[:, :, None], self.rows.start)

    def undo_whitening(self, rows: Array) -> None:
        """Undo `whiten_in_place`."""
        own = rows[..., self.rows]
        own += own @ self.directions * (1.0 / (1.0 - self.shrink) - 1.0) @ self.directions.T

    def whiten_in_place(self, rows: Array) -> None:
        """Whiten rows (..., rows) of the whole recording in these directions as well."""
        own = rows[..., self.rows]
        along = own.astype(np.float32) @ self.directions * self.shrink.astype(np.float32)
        own -= along @ self.directions.T


@dataclass(frozen=True, slots=True)
class Whitener:
    """Map from residuals to independent unit-variance numbers: by the VAR noise model, then by the slowly
    varying directions, piece by piece, then by those common to the whole recording; with one piece both at
    once.

    (1 + W W' + C C')^-1 = A' (1 + A C C' A')^-1 A with A = (1 + W W')^(-1/2), so `common` holds the common
    directions C after whitening by the noise model and the slowly varying directions W.

    unexplained (bins, channels): the held-out error from which the noise was estimated. held_out_variance
    (bins, channels): variance, in squared channel units, that slowly varying friction and form errors have on
    unseen data; a fit of everything absorbs it, so it is not in `unexplained`. wander_share: expected RMS
    size of slowly varying floor friction, relative to Coulomb friction.
    """

    noise: NoiseModel
    wandering: tuple[UncertainDirections, ...]
    common: UncertainDirections | None
    unexplained: Array
    held_out_variance: Array
    wander_share: float = 0.0

    @classmethod
    def plain(cls, noise: NoiseModel, unexplained: Array) -> Whitener:
        """A whitener of a noise model alone."""
        return cls(noise, (), None, unexplained, np.zeros_like(unexplained))

    @classmethod
    def of(
        cls,
        noise: NoiseModel,
        wandering: Sequence[Array],
        common: Array,
        unexplained: Array,
        held_out_variance: Array,
        wander_share: float,
    ) -> Whitener:
        """wandering: slowly varying directions (directions, bins, channels) of one piece after the other;
        common: those of the whole recording. Both are whitened by the noise model."""
        if len(wandering) == 1:
            wandering, common = [np.concatenate([*wandering, common])], common[:0]
        starts = np.cumsum([0, *(each.shape[1] * each.shape[2] for each in wandering)])
        pieces = [
            UncertainDirections.of(each, start) for each, start in zip(wandering, starts[:-1], strict=True)
        ]
        local = cls(noise, tuple(pieces), None, unexplained, held_out_variance, wander_share)
        if not len(common):
            return local
        rows = local.whiten_uncertain(common.reshape(len(common), -1))
        return replace(local, common=UncertainDirections.of(rows[:, :, None]))

    def noise_only(self) -> Whitener:
        """The whitener of the noise model alone, without uncertain directions."""
        return replace(self, wandering=(), common=None)

    def with_wander_share(self, share: float) -> Whitener:
        """The whitener with the slowly varying directions multiplied by `share`. Raises ValueError if there
        are common directions: they are whitened after these and depend on them."""
        if self.common is not None:
            raise ValueError("what is uncertain beside what wanders would have to be made white anew")
        return replace(self, wandering=tuple(each.with_share(share) for each in self.wandering))

    def restricted_to_bins(self, mask: NDArray[np.bool_]) -> Whitener:
        """The whitener restricted to the bins of a mask (bins,): rows of the others become 0, whatever is in
        them."""
        noise = replace(self.noise, weights=self.noise.weights * mask)
        rows = np.repeat(mask, self.unexplained.shape[1])
        wandering = tuple(each.restricted_to(rows) for each in self.wandering)
        local = replace(self, noise=noise, wandering=wandering, common=None)
        if self.common is None:
            return local
        common = self.common.spread.T
        for each in self.wandering:
            each.undo_whitening(common)
        return replace(
            local, common=UncertainDirections.of(local.whiten_uncertain(common * rows)[:, :, None])
        )

    def __call__(self, signals: Array) -> Array:
        """(..., bins, channels) -> (..., rows)."""
        white = self.noise.whiten(signals)
        return self._whiten_uncertain_in_place(white.reshape(*white.shape[:-2], -1))

    def whiten_uncertain(self, rows: Array) -> Array:
        """Whiten rows (..., rows), which the noise model has whitened, in the uncertain directions as
        well."""
        return self._whiten_uncertain_in_place(rows.copy())

    def _whiten_uncertain_in_place(self, rows: Array) -> Array:
        for each in self.wandering:
            each.whiten_in_place(rows)
        if self.common is not None:
            self.common.whiten_in_place(rows)
        return rows

    def gram_reduction(self, rows: Array) -> Array:
        """Amount by which `whiten_uncertain` reduces the rows' inner products, (rows, rows), at half its
        cost."""
        reduction = np.zeros((len(rows), len(rows)))
        common = np.zeros((rows.shape[1], 0)) if self.common is None else self.common.directions
        left = rows @ common
        for each in self.wandering:
            along = rows[:, each.rows] @ each.directions
            reduction += _product_reduction(along, each.shrink)
            left -= (along * each.shrink) @ (each.directions.T @ common[each.rows])
        if self.common is None:
            return reduction
        return reduction + _product_reduction(left, self.common.shrink)


def _product_reduction(along: Array, shrink: Array) -> Array:
    """Amount by which shrinking the components along some directions reduces the inner products."""
    return np.asarray((along * (1.0 - (1.0 - shrink) ** 2)) @ along.T, float)
