"""Coloured, multichannel noise of a simulation's residual.

Torques that nobody records (floor, gears) disturb a robot. One of them moves both wheels, the gyro and the
battery for a while, so residuals are correlated in time and between channels. A likelihood that takes them
for white and independent mistakes chance for evidence. A vector autoregression

    e[t] = r[t] - sum_k A_k r[t - k],   cov e = S,   w[t] = L^-1 e[t],   S = L L'

turns the residual r into independent unit-variance numbers w. The same linear map is applied to every
direction of the model, so least squares on whitened numbers is maximum likelihood under this noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import BIN_S, bins_per_event

Array = NDArray[np.float64]
Regimes = NDArray[np.intp]
"""Of each bin one of the four below."""
STANDING, STEADY, CHANGING, CREEPING = range(4)
EVENT_BINS = bins_per_event(BIN_S)
"""Bins of an event, half a second, at the usual bin width of 20 ms."""
OUTLIER_EVENT_SIZE = 1.2
"""RMS of the whitened residual over an event, above which the event is weighted down."""
LJUNG_BOX_LAGS = 10
"""Lags, in bins, of the Ljung-Box test for whiteness."""
OUTLIER_SIZE = 2.0
"""RMS of the whitened residual of a bin over the channels, above which the bin is weighted down: what happens
when a wheel breaks loose is not Gaussian."""


@dataclass(frozen=True)
class NoiseModel:
    """VAR(p) of c channels. coefficients (p, c, c): A_k. whitening_factors (4, c, c): L^-1 of each regime.
    regimes (n,). weights (n,), 0 to 1: below 1 for outliers.

    Disturbances do not move a robot that sticks, and no model follows a sudden change as well as a steady
    drive. So standing, steady, changing and creeping bins have a covariance each. A common one would make
    motion look quieter than it is, and small errors in a reversal look like evidence.
    """

    coefficients: Array
    whitening_factors: Array
    regimes: Regimes
    weights: Array

    @property
    def order(self) -> int:
        """p: the number of past bins in the autoregression."""
        return len(self.coefficients)

    def part(self, bins: slice) -> NoiseModel:
        """The model of some of the bins."""
        return replace(self, regimes=self.regimes[bins], weights=self.weights[bins])

    def whiten(self, signals: Array) -> Array:
        """Whitened signals, (..., n, c) -> (..., n, c). The first `order` bins have no complete past and
        become 0.

        A bin and its past are contiguous in memory, so each bin takes one matrix product for all signals.
        """
        bins, channels = signals.shape[-2:]
        rows = np.ascontiguousarray(signals).reshape(-1, bins, channels)
        whole = np.empty_like(rows)
        whole[:, : self.order] = 0.0
        row, late, number = rows.strides[0], bins - self.order, rows.itemsize
        past = as_strided(
            rows,
            (late, len(rows), (self.order + 1) * channels),
            (channels * number, row, number),
            writeable=False,
        )
        np.matmul(past, self._filters, out=whole.transpose(1, 0, 2)[self.order :])
        return whole.reshape(signals.shape)

    @cached_property
    def _filters(self) -> Array:
        """The map from a bin and its past, oldest first, to the whitened bin: (n - order, (order + 1) c,
        c)."""
        lags = np.concatenate(
            [*(-each.T for each in self.coefficients[::-1]), np.eye(self.whitening_factors.shape[-1])]
        )
        regimes, weights = self.regimes[self.order :], self.weights[self.order :]
        return np.asarray(
            (lags @ self.whitening_factors.transpose(0, 2, 1))[regimes] * weights[:, None, None], float
        )


def white_noise(scale: Array, regimes: Regimes) -> NoiseModel:
    """Noise that is uncorrelated in time and between channels. scale (c,): its standard deviations."""
    return NoiseModel(
        np.zeros((0, len(scale), len(scale))),
        np.stack([np.diag(1.0 / scale)] * 4),
        regimes,
        np.ones(len(regimes)),
    )


def fit_noise_model(residual: Array, order: int, floor: Array, regimes: Regimes, event: int) -> NoiseModel:
    """Least-squares VAR of a residual (n, c), its coefficients from the bins in motion where there are
    enough.

    floor (c,): the least standard deviation of each channel's residual (quantisation); a hundredth of its
    square is added to the variance of the innovations. event: bins in half a second. A small ridge keeps the
    regression solvable for short recordings and dead channels.
    """
    n, channels = residual.shape
    order = max(0, min(order, n // (8 * channels)))
    scale = np.maximum(residual.std(axis=0), floor)
    scaled = residual / scale
    coefficients = np.zeros((order, channels, channels))
    innovation = scaled[order:]
    late = regimes[order:]
    moving = late != STANDING
    used = moving if moving.sum() > 20 * channels * max(order, 1) else np.ones(n - order, bool)
    if order:
        past = np.hstack([scaled[order - lag : n - lag] for lag in range(1, order + 1)])
        rows = past[used]
        gram = rows.T @ rows + 1e-3 * len(rows) * np.eye(rows.shape[1])
        solution = np.linalg.solve(gram, rows.T @ innovation[used])
        innovation = innovation - past @ solution
        coefficients = solution.T.reshape(channels, order, channels).transpose(1, 0, 2)
    least = (floor / scale) ** 2 * 0.01
    whole = _whitening_factor(innovation[used], order * channels, least)
    parts = [
        _whitening_factor(innovation[late == regime], 0, least)
        if (late == regime).sum() > 15 * channels
        else whole
        for regime in range(4)
    ]
    coefficients = coefficients * scale[:, None] / scale[None, :]
    model = NoiseModel(coefficients, np.stack(parts) / scale, regimes, np.ones(n))
    size = np.sqrt((model.whiten(residual) ** 2).mean(axis=1))
    model = replace(model, weights=np.minimum(1.0, OUTLIER_SIZE / np.maximum(size, 1e-9)))
    return replace(
        model, weights=model.weights * _event_weights((model.whiten(residual) ** 2).mean(axis=1), event)
    )


def _event_weights(power: Array, event: int) -> Array:
    """Weights (n,) that scale an event of unusual size down to OUTLIER_EVENT_SIZE. power (n,): mean square of
    each whitened bin."""
    means, lengths = event_means(power, event)
    return np.repeat(np.minimum(1.0, OUTLIER_EVENT_SIZE / np.maximum(np.sqrt(means), 1e-9)), lengths)


def event_means(values: Array, event: int) -> tuple[Array, NDArray[np.intp]]:
    """Mean of values (n,) over each event of so many bins, and the number of bins in each."""
    starts = np.arange(0, len(values), event)
    lengths = np.diff([*starts, len(values)])
    return np.add.reduceat(values, starts) / lengths, lengths


def _whitening_factor(innovation: Array, parameters: int, least: Array) -> Array:
    covariance = innovation.T @ innovation / max(len(innovation) - parameters, 1) + np.diag(least)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), float)


def whiteness_p_values(whitened: Array) -> Array:
    """Ljung-Box p-value of each channel of a whitened residual (n, c): small where it is still correlated in
    time."""
    from scipy.special import chdtrc

    n = len(whitened)
    centred = whitened - whitened.mean(axis=0)
    power = (centred**2).sum(axis=0)
    power = np.where(power > 0.0, power, 1.0)
    statistic = np.zeros(whitened.shape[1])
    for lag in range(1, LJUNG_BOX_LAGS + 1):
        correlation = (centred[lag:] * centred[:-lag]).sum(axis=0) / power
        statistic += correlation**2 / max(n - lag, 1)
    return np.asarray(chdtrc(LJUNG_BOX_LAGS, n * (n + 2) * statistic), float)
