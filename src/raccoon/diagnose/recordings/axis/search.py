"""Selects the causes of an axis: forward selection by evidence and cross-validation over blocks of time."""

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
"""Number of blocks of time in the cross-validation, each predicted by a fit to the others."""
MIN_EVIDENCE, MIN_LEFT_OUT_GAIN = 10.0, 6.0
"""Least evidence of a cause (see `TriedCause`), and its least gain in the cross-validation."""
MAX_CAUSES = 4
"""Largest number of named causes of one axis."""
MAX_TIE = 3.0
"""Difference of evidence within which causes tie; the simpler one is selected."""
INITIAL_NOISE_SHARE = 0.05
"""Assumed noise of a channel before the first fit, over the channel's standard deviation."""
MIN_SATURATED_SHARE = 0.5
"""Ratio of the squared residual of the search to that of the saturated fit below which the latter did not
converge."""


@dataclass(frozen=True, slots=True)
class TriedCause:
    """A cause added to the model so far. evidence: decrease of the misfit less k ln(n). left_out_gain:
    decrease of the cross-validated misfit. rivals: other causes tried in the same step."""

    cause: AxisCause
    fit: AxisFit
    evidence: float
    left_out_gain: float
    rivals: tuple[TriedCause, ...] = ()


@dataclass(frozen=True, slots=True)
class AxisSearch:
    """The result of a search. base: fit without causes. fit: with the accepted causes. saturated: with all
    candidates. tried: candidates that were not accepted, each added to the final model."""

    base: AxisFit
    fit: AxisFit
    saturated: AxisFit
    accepted: tuple[TriedCause, ...]
    tried: tuple[TriedCause, ...]


def search_axis(data: AxisData, base: Sequence[FreeParameter], causes: Sequence[AxisCause]) -> AxisSearch:
    """Forward selection of causes. It also sets the noise scales of `data`."""
    data.scales = _initial_scales(data)
    first = fit_axis(data, base)
    data.scales = data.scales * _residual_sizes(data, first)
    saturated = _fit_saturated(data, first, causes)
    data.scales = data.scales * _effective_sizes(data, saturated)
    found = _select_forward(data, base, causes, first, saturated)
    if _residual_power(data, found.fit) < MIN_SATURATED_SHARE * _residual_power(data, saturated):
        # The saturated fit did not converge: the noise is re-estimated from the search, which is repeated.
        data.scales = data.scales * _effective_sizes(data, found.fit)
        found = _select_forward(data, base, causes, first, found.fit)
    return found


def _fit_saturated(data: AxisData, first: AxisFit, causes: Sequence[AxisCause]) -> AxisFit:
    """The fit with all candidates started from the best of their scans, or with one candidate of each effect
    from its usual start, whichever has the smaller residual."""
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
    """Start values of u for the cause's parameters: the best of its scan with the given fit, or its own
    starts."""
    if not cause.scan:
        return cause.starts
    points = np.array([[*fit.u, each] for each in cause.scan])
    errors = data.residuals((*fit.parameters, *cause.parameters), points)
    return (cause.scan[int(np.argmin((errors**2).sum(axis=1)))],)


def _residual_sizes(data: AxisData, fit: AxisFit) -> Array:
    """Root mean square of each channel's residual."""
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
    """Root mean square of each channel's residual times the square root of its autocorrelation time."""
    return np.array(
        [
            _residual_size(data, each) * (1.0 if each is None else math.sqrt(_autocorrelation_time(each)))
            for each in _channel_residuals(data, fit)
        ]
    )


def _autocorrelation_time(residual: Array) -> float:
    """Integrated autocorrelation time in samples: 1 + 2 times the sum of the correlations until they
    vanish."""
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
    """The cause added to the model so far, whose cross-validated misfit is `left_out_before`."""
    fit = _fit_with(data, model_fit, [cause])
    fit = _better_fit(fit, model_fit, cause)
    k = len(cause.parameters)
    samples = max(float((fit.residual != 0.0).sum()) / _autocorrelation_time(fit.residual[:, None]), 3.0)
    evidence = model_fit.misfit - fit.misfit - k * math.log(samples)
    return TriedCause(cause, fit, evidence, left_out_before - left_out_misfit(data, fit))


def _better_fit(fit: AxisFit, model_fit: AxisFit, cause: AxisCause) -> AxisFit:
    """The fit with the cause; if it did not converge, the fit without it, with the cause's u at 0."""
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
    """Cross-validated misfit: sum over the blocks of the misfit under the fit without that block, which is
    approximated by one Gauss-Newton step from the whole fit."""
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
    """The cause with the most evidence among those that also improve the cross-validation; in a tie the
    simplest one, which comes first. None if no cause qualifies."""
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
    """Cosine of the changes that two causes add to the shared model: 1 if the data do not distinguish
    them."""
    a, b = _own_direction(fit, cause), _own_direction(other, rival)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / size if size > 0.0 else 0.0


def _own_direction(fit: AxisFit, cause: AxisCause) -> Array:
    """The cause's largest Jacobian column after the columns of the other parameters are projected out."""
    k = len(cause.parameters)
    rest, own = fit.jacobian[:, :-k], fit.jacobian[:, -k:]
    residuals = own - rest @ np.linalg.lstsq(rest, own, rcond=None)[0]
    return np.asarray(residuals[:, int(np.argmax((residuals**2).sum(axis=0)))])
