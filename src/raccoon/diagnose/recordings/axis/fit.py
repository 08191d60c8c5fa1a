"""Fits an axis' parameters by the simulation error over stretches of two time constants.

A free simulation over the whole recording would not do: a position is an integral, so the few moments in
which the axis sticks dominate the error, and no friction is found. A speed forgets its past, and is simulated
over longer stretches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.bins import runs_of_true
from raccoon.diagnose.recordings.axis.log import AxisLog
from raccoon.diagnose.recordings.axis.model import NEUTRAL_VALUES, Stretches, simulate

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
RowFilter = Callable[[Rows], NDArray[np.bool_]]
"""Selects the rows of a recording that count."""

SECANT_STEP = 1e-3
"""Step in u of the finite differences of the Jacobian."""
DAMPINGS = (1e-6, 1e-2, 1.0, 100.0)
"""Levenberg-Marquardt dampings, all tried in each step: simulations side by side cost little."""
MAX_STEPS, MIN_RELATIVE_GAIN = 20, 1e-5
"""Largest number of steps of a fit, and relative gain of a step at which it ends."""
BOUND_TOLERANCE = 1.02
"""Factor from a bound within which a parameter counts as at the bound."""
MAX_POSITION_ROWS, MAX_SPEED_ROWS = 100, 8000
"""Largest number of compared rows of a stretch, for a position and for a speed."""
MIN_STRETCHES = 10
"""Least number of stretches of a position's recording."""
RUN_TIME_CONSTANTS, RUN_SECONDS = 20.0, 60.0
"""Length of a stretch of a speed, in time constants and in s; the longer one counts."""
MAX_LOG_CHANGE = 200.0
"""Largest change of a parameter's logarithm."""
MAX_RESIDUAL = 1e60
"""Upper bound of a whitened residual, whose squares can still be summed."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One parameter of the model, with the dimensionless coordinate u that is fitted.

    start: value at u = 0. width: change at u = 1, of the logarithm where `positive`. low, high: bounds of the
    value. prior: whether u has a normal prior around 0 with a standard deviation of 1.
    """

    name: str
    start: float
    width: float
    positive: bool = False
    low: float = -math.inf
    high: float = math.inf
    prior: bool = False

    def is_at_bound(self, value: float) -> bool:
        """Whether a positive parameter is at a bound, and thus not determined by the data."""
        return self.positive and (value <= BOUND_TOLERANCE * self.low or value >= self.high / BOUND_TOLERANCE)

    def value(self, u: Array) -> Array:
        """The value at u."""
        # Without a prior a step is unbounded: its exponential must stay finite.
        change = np.clip(self.width * u, -MAX_LOG_CHANGE, MAX_LOG_CHANGE) if self.positive else self.width * u
        value = self.start * np.exp(change) if self.positive else self.start + change
        return np.asarray(np.clip(value, self.low, self.high))


@dataclass(frozen=True, slots=True)
class AxisFit:
    """A fit: u of `parameters`, and at it the whitened residual (rows,) and Jacobian (rows, k), without prior
    rows.

    group_of_row (rows,): the stretch, or the part of the time, of each row.
    """

    parameters: tuple[FreeParameter, ...]
    u: Array
    residual: Array
    jacobian: Array
    group_of_row: NDArray[np.intp]

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters' values by name."""
        return {
            each.name: float(each.value(np.asarray(u)))
            for each, u in zip(self.parameters, self.u, strict=True)
        }

    @property
    def misfit(self) -> float:
        """Sum of the squares of the residual and the prior."""
        has_prior = np.array([each.prior for each in self.parameters])
        return float(self.residual @ self.residual + self.u[has_prior] @ self.u[has_prior])

    def stds(self) -> Mapping[str, float]:
        """Standard deviations by name, from the scatter of the groups' scores (sandwich estimator): residuals
        within a stretch come from the same disturbance and are not independent."""
        J = self.jacobian
        prior = np.diag([float(each.prior) for each in self.parameters])
        inverse = np.linalg.pinv(J.T @ J + prior)
        count = int(self.group_of_row.max()) + 1
        scores = np.zeros((count, len(self.u)))
        np.add.at(scores, self.group_of_row, J * self.residual[:, None])
        spread = scores.T @ scores * count / max(count - 1, 1) + prior
        std = np.sqrt(np.maximum(np.diag(inverse @ spread @ inverse), 0.0))
        return {
            each.name: float(s * each.width * (abs(each.value(np.asarray(u))) if each.positive else 1.0))
            for each, s, u in zip(self.parameters, std, self.u, strict=True)
        }


@dataclass(slots=True)
class AxisData:
    """A recording cut into stretches, with the noise scale of each channel. scales: of motion and current."""

    log: AxisLog
    stretches: Stretches
    scales: Array = field(default_factory=lambda: np.ones(2))

    def residuals(self, parameters: Sequence[FreeParameter], points: Array) -> Array:
        """Simulated minus measured value over the noise scale, (points, rows); 0 where a row has no reading
        or weight."""
        named = {name: np.full(len(points), value) for name, value in NEUTRAL_VALUES.items()}
        named["full"] = np.full(len(points), self.log.full_effort)
        for index, each in enumerate(parameters):
            named[each.name] = each.value(points[:, index])
        position, speed, current = simulate(
            named, self.log.effort, self.log.step, self.stretches, self.log.is_electrical
        )
        rows = [self._whitened(speed if self.log.is_speed else position, self.stretches.measured, 0)]
        if self.stretches.current is not None:
            rows.append(self._whitened(current, self.stretches.current, 1))
        return np.concatenate(rows, axis=1)

    def _whitened(self, model: Array, measured: Array, channel: int) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            error = (model - measured[:, None, :]) * self.stretches.weight[:, None, :] / self.scales[channel]
        error = np.clip(error, -MAX_RESIDUAL, MAX_RESIDUAL)
        lanes = error.shape[1]
        return np.asarray(np.nan_to_num(np.moveaxis(error, 1, 0).reshape(lanes, -1)))

    def group_of_rows(self) -> NDArray[np.intp]:
        """Group index of each row of the residual: its stretch, or with few stretches a twelfth of the
        time."""
        rows = self.stretches.rows()
        if len(self.stretches.first) > 5:
            group = np.broadcast_to(np.arange(rows.shape[1])[None, :], rows.shape)
        else:
            group = (12 * (rows - rows.min())) // (np.ptp(rows) + 1)
        channels = 1 if self.stretches.current is None else 2
        return np.tile(np.asarray(group).ravel(), channels).astype(np.intp)


def fit_axis(data: AxisData, parameters: Sequence[FreeParameter], start: Array | None = None) -> AxisFit:
    """Fit by Levenberg-Marquardt, with all dampings tried in each step. start: u, 0 by default. Raises
    TraceError if the simulation diverges."""
    u = np.zeros(len(parameters)) if start is None else start
    prior = np.array([float(each.prior) for each in parameters])
    bounds = _bounds(parameters)
    residual = data.residuals(parameters, u[None])[0]
    J = _jacobian(data, parameters, u, residual, bounds)
    _check_finite(residual)
    cost = float(residual @ residual + prior @ u**2)
    for _ in range(MAX_STEPS):
        trials = _trial_points(J, residual, u, prior, bounds)
        errors = data.residuals(parameters, trials)
        costs = (errors**2).sum(axis=1) + (prior * trials**2).sum(axis=1)
        best = int(np.argmin(costs))
        gain = cost - float(costs[best])
        if gain > 0.0:
            u, residual, cost = trials[best], errors[best], float(costs[best])
            J = _jacobian(data, parameters, u, residual, bounds)
        if gain <= MIN_RELATIVE_GAIN * cost:
            break
    return AxisFit(tuple(parameters), u, residual, J, data.group_of_rows())


def _check_finite(residual: Array) -> None:
    """Raise TraceError if the simulation diverges from the motion so far that no fit is possible."""
    if len(residual) and float(np.abs(residual).max()) >= MAX_RESIDUAL:
        raise TraceError(
            "no motor or axis moves like this: are its effort, motion and current in the right columns and "
            "units, and recorded at the same time?"
        )


def _bounds(parameters: Sequence[FreeParameter]) -> tuple[Array, Array]:
    """Lower and upper bounds of u."""

    def inverse(each: FreeParameter, value: float) -> float:
        if math.isinf(value):
            return value
        if each.positive:
            return math.log(max(value, 1e-300) / each.start) / each.width
        return (value - each.start) / each.width

    return (
        np.array([inverse(each, each.low) for each in parameters]),
        np.array([inverse(each, each.high) for each in parameters]),
    )


def _jacobian(
    data: AxisData,
    parameters: Sequence[FreeParameter],
    u: Array,
    residual: Array,
    bounds: tuple[Array, Array],
) -> Array:
    # At the upper bound the secant points inwards.
    steps = np.where(u + SECANT_STEP > bounds[1], -SECANT_STEP, SECANT_STEP)
    errors = data.residuals(parameters, u + np.diag(steps))
    return np.asarray((errors - residual).T / steps)


def _trial_points(J: Array, residual: Array, u: Array, prior: Array, bounds: tuple[Array, Array]) -> Array:
    A, b = J.T @ J + np.diag(prior), J.T @ residual + prior * u
    size = np.maximum(np.diag(A), 1e-12 * float(np.diag(A).max()))
    steps = [-np.linalg.lstsq(A + each * np.diag(size), b, rcond=None)[0] for each in DAMPINGS]
    return np.clip(u + np.array(steps), *bounds)


def stretch_duration(time_constant: float) -> float:
    """Length of a stretch, s: two time constants, rounded (by ratio) to 1, 2 or 5 times a power of ten."""
    exponent = math.log10(2.0 * time_constant)
    decade = math.floor(exponent)
    choices = [decade + math.log10(each) for each in (1.0, 2.0, 5.0, 10.0)]
    return float(10.0 ** min(choices, key=lambda each: abs(each - exponent)))


def cut_stretches(log: AxisLog, time_constant: float, keep: RowFilter, overlap: int) -> Stretches | None:
    """The stretches of a log for a time constant (s); None if not a single one fits.

    keep: selects the rows that count. overlap: number of stretches that cover each instant.
    """
    count = len(log.time)
    if log.is_speed:
        length = min(count, round(max(RUN_TIME_CONSTANTS * time_constant, RUN_SECONDS) / log.step) + 1)
        if length >= count:
            return _make_stretches(log, np.zeros(1, np.intp), count, time_constant, keep)
    else:
        seconds = min(
            stretch_duration(time_constant), stretch_duration(0.5 * count * log.step / MIN_STRETCHES)
        )
        length = min(count, round(seconds / log.step) + 1)
    first_rows = np.arange(0, count - length + 1, max(1, (length - 1) // overlap)).astype(np.intp)
    kept_rows = [index for index in first_rows if keep(np.arange(index, index + length, dtype=np.intp)).all()]
    if log.is_speed and not kept_rows:  # for example 30 of 100 s are kept, with stretches of 60 s
        is_kept = keep(np.arange(count, dtype=np.intp))
        begin, end = max(runs_of_true(is_kept), key=lambda each: each[1] - each[0], default=(0, 0))
        length = min(length, end - begin)
        kept_rows = [np.intp(begin)] if length > 1 else []
    return (
        _make_stretches(log, np.array(kept_rows, np.intp), length, time_constant, keep) if kept_rows else None
    )


def _samples_per_row(log: AxisLog, length: int) -> int:
    """Samples per compared row: a position is smooth and needs few rows; with a speed, many rows average out
    the noise."""
    return max(1, (length - 1) // (MAX_SPEED_ROWS if log.is_speed else MAX_POSITION_ROWS))


def _make_stretches(
    log: AxisLog, first: NDArray[np.intp], length: int, time_constant: float, keep: RowFilter
) -> Stretches:
    from scipy.signal import savgol_filter

    known = np.isfinite(log.motion)
    motion = np.interp(log.time, log.time[known], log.motion[known])
    width = 2 * max(3, round(time_constant / 30.0 / log.step)) + 1
    width = min(width, 2 * ((len(motion) - 1) // 2) - 1)
    order = 0 if log.is_speed else 1
    smooth = savgol_filter(motion, width, 2)
    speed = smooth if order == 0 else savgol_filter(motion, width, 2, deriv=1, delta=log.step)
    if log.is_speed:
        speed = np.where(np.arange(len(speed)) == 0, motion[0], speed)
    every = _samples_per_row(log, length)
    rows = first[None, :] + np.arange(0, length, every, dtype=np.intp)[:, None]
    weight = keep(rows).astype(float)
    weight[0] = 0.0 if not log.is_speed else weight[0]
    current = None if log.current is None or not log.is_electrical else log.current[rows]
    position = motion[first] if not log.is_speed else np.zeros(len(first))
    return Stretches(first, len(rows), every, position, speed[first], log.motion[rows], current, weight)
