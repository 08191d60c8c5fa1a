"""Robust fits of a battery's binned reading: residuals far below the fit, as under another load, cost
little."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OUTLIER_NOISES = 4.0
"""Residual, in standard deviations of the noise, above which a bin does not count: another load may be on."""


def huber_fit(columns: Array, target: Array, known: Flags, noise: float) -> Array:
    """Coefficients (columns,) by robust least squares with Huber's weights, linear beyond one noise."""
    found, products = np.zeros(columns.shape[1]), _column_products(columns)
    weights = known.astype(float)
    for _ in range(15):
        (found,) = _weighted_least_squares(columns, products, target, weights[None])
        weights = known / np.maximum(1.0, np.abs(target - columns @ found) / noise)
    return found


def fit_costs(
    columns: Array, voltage: Array, known: Flags, noise: float, starts: Array
) -> Iterator[tuple[float, Array]]:
    """Cost and residual of the fit from each start. The cost saturates for readings far below the fit
    (another load) and grows quadratically for readings above it, since no load adds voltage."""
    for rest in voltage - biweight_fits(columns, voltage, known, noise, starts) @ columns.T:
        yield float(bin_costs(rest, noise)[known].sum()), rest


def bin_costs(rest: Array, noise: float) -> Array:
    """The cost of the residual of each bin."""
    far = rest / (OUTLIER_NOISES * noise)
    return np.asarray(np.where(far > 1.0, far**2, 1.0 - np.maximum(0.0, 1.0 - far**2) ** 3), float)


def biweight_fits(columns: Array, target: Array, known: Flags, noise: float, starts: Array) -> Array:
    """Coefficients (starts, columns) by Tukey's biweight, in which far outliers do not count, from each
    start."""
    found, products = starts, _column_products(columns)
    for _ in range(30):
        far = (target - found @ columns.T) / (OUTLIER_NOISES * noise)
        found = _weighted_least_squares(columns, products, target, known * np.maximum(0.0, 1.0 - far**2) ** 2)
    return found


def _column_products(columns: Array) -> Array:
    """The outer product of the columns with themselves in every bin, (bins, columns * columns)."""
    return (columns[:, :, None] * columns[:, None, :]).reshape(len(columns), -1)


def _weighted_least_squares(columns: Array, products: Array, target: Array, weights: Array) -> Array:
    """Weighted least-squares coefficients (fits, columns). weights: (fits, bins)."""
    count = columns.shape[1]
    inner = (weights @ products).reshape(-1, count, count) + 1e-6 * np.eye(count)
    return np.asarray(np.linalg.solve(inner, ((weights * target) @ columns)[:, :, None])[:, :, 0], float)
