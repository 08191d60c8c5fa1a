"""Selects the causes that an axis needs: forward selection by evidence and by blocks that were left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.axis.causes import AxisCause
from raccoon.diagnose.recordings.axis.fit import AxisData, AxisFit, FreeParameter, fit_axis

Array = NDArray[np.float64]

BLOCKS = 6
"""Blocks of time, each predicted by a fit of all others (cross-validation)."""
MIN_EVIDENCE, MIN_LEFT_OUT_GAIN = 10.0, 6.0
"""Evidence that a cause needs (see `TriedCause`), and gain on blocks that were left out."""
MAX_CAUSES = 4
"""Most causes that are named of one axis."""
MAX_TIE = 3.0
"""Difference of evidence within which two causes tie, and the simpler one is taken."""
INITIAL_NOISE_SHARE = 0.05
"""Noise of a channel over its spread, assumed before anything is fitted."""
MIN_SATURATED_SHARE = 0.5
"""Squared residual of the search over that of the saturated fit, below which the latter did not converge."""


@dataclass(frozen=True, slots=True)
class TriedCause:
    """A cause on top of the model so far. evidence: drop of the misfit less k ln(n). left_out_gain: drop of
    the misfit of blocks that were left out. rivals: what else was tried at the same step."""

    cause: AxisCause
    fit: AxisFit
    evidence: float
    left_out_gain: float
    rivals: tuple[TriedCause, ...] = ()


@dataclass(frozen=True, slots=True)
class AxisSearch:
    """The result of a search. base: the fit without causes. fit: with the accepted ones. saturated: with
    every candidate. tried: each candidate that was not accepted, on top of the final model."""

    base: AxisFit
    fit: AxisFit
    saturated: AxisFit
    accepted: tuple[TriedCause, ...]
    tried: tuple[TriedCause, ...]


def search_axis(data: AxisData, base: Sequence[FreeParameter], causes: Sequence[AxisCause]) -> AxisSearch:
    """Forward selection of causes. Sets the noise scales of `data` on the way."""
    data.scales = _initial_scales(data)
    first = fit_axis(data, base)
    data.scales = data.scales * _residual_sizes(data, first)
    saturated = _fit_saturated(data, first, causes)
    data.scales = data.scales * _effective_sizes(data, saturated)
    found = _select_forward(data, base, causes, first, saturated)
    if _residual_power(data, found.fit) < MIN_SATURATED_SHARE * _residual_power(data, saturated):
        # The saturated fit did not converge: the noise is what the search leaves, and evidence is recounted.
        data.scales = data.scales * _effective_sizes(data, found.fit)
        found = _select_forward(data, base, causes, first, found.fit)
    return found


def _fit_saturated(data: AxisData, first: AxisFit, causes: Sequence[AxisCause]) -> AxisFit:
    """The fit of all candidates at once, from the best of their scans, or with one rule of each effect from
    its usual start: whichever has the smaller residual."""
    all_at_once = _fit_with(data, first, causes)
    first_rules = [
        each for index, each in enumerate(causes) if each.id not in {it.id for it in causes[:index]}
    ]
    usual = _fit_with(data, first, [replace(each, scan=()) for each in first_rules])
    return all_at_once if _residual_power(data, all_at_once) < _residual_power(data, usual) else usual


def _residual_power(data: AxisData, fit: AxisFit) -> float:
    return float((data.residuals(fit.parameters, fit.u[None])[0] ** 2).sum())


def _select_forward(
    data: AxisData,
    base: Sequence[FreeParameter],
    causes: Sequence[AxisCause],
    first: AxisFit,
    saturated: AxisFit,
) -> AxisSearch:
    model_fit = base_fit = fit_axis(data, base, first.u)
    accepted: list[TriedCause] = []
    while len(accepted) < MAX_CAUSES:
        taken = {each.cause.id for each in accepted}
        left_out_before = left_out_misfit(data, model_fit)
        tried = [
            _try_cause(data, model_fit, left_out_before, each) for each in causes if each.id not in taken
        ]
        best = _best_candidate(tried)
        if best is None:
            break
        rivals = tuple(each for each in tried if each.cause.id != best.cause.id)
        accepted.append(replace(best, rivals=rivals))
        model_fit = best.fit
    return AxisSearch(base_fit, model_fit, saturated, tuple(accepted), tuple(tried))


def _initial_scales(data: AxisData) -> Array:
    current = data.stretches.current
    spreads = [np.nanstd(data.stretches.measured), 1.0 if current is None else np.nanstd(current)]
    return np.asarray(INITIAL_NOISE_SHARE * np.maximum(np.array(spreads), 1e-9))


def _fit_with(data: AxisData, fit: AxisFit, causes: Sequence[AxisCause]) -> AxisFit:
    parameters = [*fit.parameters, *(number for each in causes for number in each.parameters)]
    starts = [start for each in causes for start in _start_values(data, fit, each)]
    return fit_axis(data, parameters, np.concatenate([fit.u, starts]))


def _start_values(data: AxisData, fit: AxisFit, cause: AxisCause) -> tuple[float, ...]:
    """Starting u of the cause's parameters: the best of its scan on top of the fit, or its own starts."""
    if not cause.scan:
        return cause.starts
    points = np.array([[*fit.u, each] for each in cause.scan])
    errors = data.residuals((*fit.parameters, *cause.parameters), points)
    return (cause.scan[int(np.argmin((errors**2).sum(axis=1)))],)


def _residual_sizes(data: AxisData, fit: AxisFit) -> Array:
    """RMS of the residual of each channel."""
    return np.array([_residual_size(data, each) for each in _channel_residuals(data, fit)])


def _residual_size(data: AxisData, residual: Array | None) -> float:
    if residual is None:
        return 1.0
    return max(math.sqrt(float((residual[data.stretches.weight > 0.0] ** 2).mean())), 1e-9)


def _channel_residuals(data: AxisData, fit: AxisFit) -> tuple[Array, Array | None]:
    """Residuals of motion and current, (rows, stretches) each."""
    shape = data.stretches.measured.shape
    count = shape[0] * shape[1]
    current = fit.residual[count:].reshape(shape) if len(fit.residual) > count else None
    return fit.residual[:count].reshape(shape), current


def _effective_sizes(data: AxisData, fit: AxisFit) -> Array:
    """RMS of the residual of each channel times the root of its autocorrelation time."""
    return np.array(
        [
            _residual_size(data, each) * (1.0 if each is None else math.sqrt(_autocorrelation_time(each)))
            for each in _channel_residuals(data, fit)
        ]
    )


def _autocorrelation_time(residual: Array) -> float:
    """Integrated autocorrelation time in samples: 1 + 2 sum of the correlations until they vanish."""
    power = float((residual**2).sum())
    if power == 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, len(residual)):
        correlation = float((residual[lag:] * residual[:-lag]).sum()) / power
        if correlation < 0.05:
            break
        total += 2.0 * correlation
    return total


def _try_cause(data: AxisData, model_fit: AxisFit, left_out_before: float, cause: AxisCause) -> TriedCause:
    """The cause on top of the model so far, whose misfit of left-out blocks is `left_out_before`."""
    fit = _fit_with(data, model_fit, [cause])
    fit = _better_fit(fit, model_fit, cause)
    k = len(cause.parameters)
    samples = max(float((fit.residual != 0.0).sum()) / _autocorrelation_time(fit.residual[:, None]), 3.0)
    evidence = model_fit.misfit - fit.misfit - k * math.log(samples)
    return TriedCause(cause, fit, evidence, left_out_before - left_out_misfit(data, fit))


def _better_fit(fit: AxisFit, model_fit: AxisFit, cause: AxisCause) -> AxisFit:
    """The fit with the cause, or where it did not converge the one without it, with the cause at 0."""
    if fit.misfit <= model_fit.misfit:
        return fit
    zeros = np.zeros(len(cause.parameters))
    jacobian = np.hstack([model_fit.jacobian, np.zeros((len(model_fit.residual), len(zeros)))])
    return replace(
        model_fit,
        parameters=(*model_fit.parameters, *cause.parameters),
        u=np.concatenate([model_fit.u, zeros]),
        jacobian=jacobian,
    )


def left_out_misfit(data: AxisData, fit: AxisFit) -> float:
    """Sum over blocks of the misfit under the fit without that block, which is taken one Gauss-Newton step
    from the whole fit."""
    prior = np.diag([float(each.prior) for each in fit.parameters])
    count = int(fit.group_of_row.max()) + 1
    block = fit.group_of_row * min(BLOCKS, count) // count
    points = []
    for index in range(min(BLOCKS, count)):
        rest = block != index
        J, r = fit.jacobian[rest], fit.residual[rest]
        step = np.linalg.lstsq(J.T @ J + prior, J.T @ r + prior @ fit.u, rcond=None)[0]
        points.append(fit.u - np.clip(step, -1.0, 1.0))
    errors = data.residuals(fit.parameters, np.array(points))
    return float(sum((errors[index, block == index] ** 2).sum() for index in range(len(points))))


def _best_candidate(tried: Sequence[TriedCause]) -> TriedCause | None:
    """The cause of most evidence among those that also help left-out blocks; a tie goes to the simpler one,
    which comes first."""
    acceptable = [
        each
        for each in tried
        if MIN_EVIDENCE < each.evidence < math.inf and each.left_out_gain > MIN_LEFT_OUT_GAIN
    ]
    if not acceptable:
        return None
    most = max(each.evidence for each in acceptable)
    return next(each for each in acceptable if each.evidence > most - MAX_TIE)


def cause_similarity(fit: AxisFit, cause: AxisCause, other: AxisFit, rival: AxisCause) -> float:
    """Cosine between what two causes add beyond the shared model: 1 where the data cannot tell them apart."""
    a, b = _own_direction(fit, cause), _own_direction(other, rival)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / size if size > 0.0 else 0.0


def _own_direction(fit: AxisFit, cause: AxisCause) -> Array:
    """The largest of a cause's Jacobian columns after projecting out the other columns."""
    k = len(cause.parameters)
    rest, own = fit.jacobian[:, :-k], fit.jacobian[:, -k:]
    residuals = own - rest @ np.linalg.lstsq(rest, own, rcond=None)[0]
    return np.asarray(residuals[:, int(np.argmax((residuals**2).sum(axis=0)))])
