"""Which effects an axis needs: nested fits of the simulation error, judged on blocks that were left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.axis.causes import AxisCause
from raccoon.diagnose.recordings.axis.fit import AxisData, AxisFit, Number, fit_axis

Array = NDArray[np.float64]

BLOCKS = 6
"""Of time, of which each is foreseen by a fit of all others."""
LEAST_EVIDENCE, LEAST_LEFT_OUT = 10.0, 6.0
"""Log evidence that a cause needs, in all and on blocks that were not fitted."""
MOST_CAUSES = 4
"""That are named of one axis."""
TIE = 3.0
"""Evidence within which two causes are alike, and the plainer one is taken."""
CRUDE = 0.05
"""Of the spread of a channel, for its noise before anything is fitted."""
LOST = 0.5
"""Share of the squared residual of every candidate at once below which the search must have found more."""


@dataclass(frozen=True, slots=True)
class Tried:
    """A cause on top of the model so far. evidence: drop of the misfit less k ln(n). left_out: drop of the
    misfit of blocks that were left out. rivals: what else was tried at the same step."""

    cause: AxisCause
    fit: AxisFit
    evidence: float
    left_out: float
    rivals: tuple[Tried, ...] = ()


@dataclass(frozen=True, slots=True)
class AxisSearch:
    """base: the fit without causes. fit: with the accepted ones. saturated: with every candidate.
    tried: each candidate that was not accepted, on top of the final model."""

    base: AxisFit
    fit: AxisFit
    saturated: AxisFit
    accepted: tuple[Tried, ...]
    tried: tuple[Tried, ...]


def search_axis(data: AxisData, base: Sequence[Number], causes: Sequence[AxisCause]) -> AxisSearch:
    """Forward selection. Sets the noise scales of `data` on the way."""
    data.scales = _crude_scales(data)
    first = fit_axis(data, base)
    data.scales = data.scales * _sizes(data, first)
    saturated = _saturated(data, first, causes)
    data.scales = data.scales * _colour(data, saturated)
    found = _forward(data, base, causes, first, saturated)
    if _power(data, found.fit) < LOST * _power(data, saturated):
        # Everything at once got lost: the noise is what the search has left, and evidence counts anew.
        data.scales = data.scales * _colour(data, found.fit)
        found = _forward(data, base, causes, first, found.fit)
    return found


def _saturated(data: AxisData, first: AxisFit, causes: Sequence[AxisCause]) -> AxisFit:
    """Every candidate at once, from where scans begin or with one rule of each effect from its usual start,
    whichever gets further."""
    every = _with(data, first, causes)
    once = [each for index, each in enumerate(causes) if each.id not in {it.id for it in causes[:index]}]
    usual = _with(data, first, [replace(each, scan=()) for each in once])
    return every if _power(data, every) < _power(data, usual) else usual


def _power(data: AxisData, fit: AxisFit) -> float:
    return float((data.residuals(fit.numbers, fit.u[None])[0] ** 2).sum())


def _forward(
    data: AxisData, base: Sequence[Number], causes: Sequence[AxisCause], first: AxisFit, saturated: AxisFit
) -> AxisSearch:
    now = plain = fit_axis(data, base, first.u)
    accepted: list[Tried] = []
    while len(accepted) < MOST_CAUSES:
        taken = {each.cause.id for each in accepted}
        left_out = left_out_misfit(data, now)
        tried = [_try(data, now, left_out, each) for each in causes if each.id not in taken]
        best = _best(tried)
        if best is None:
            break
        rivals = tuple(each for each in tried if each.cause.id != best.cause.id)
        accepted.append(replace(best, rivals=rivals))
        now = best.fit
    return AxisSearch(plain, now, saturated, tuple(accepted), tuple(tried))


def _crude_scales(data: AxisData) -> Array:
    current = data.parts.current
    spreads = [np.nanstd(data.parts.measured), 1.0 if current is None else np.nanstd(current)]
    return np.asarray(CRUDE * np.maximum(np.array(spreads), 1e-9))


def _with(data: AxisData, fit: AxisFit, causes: Sequence[AxisCause]) -> AxisFit:
    numbers = [*fit.numbers, *(number for each in causes for number in each.numbers)]
    starts = [start for each in causes for start in _starts(data, fit, each)]
    return fit_axis(data, numbers, np.concatenate([fit.u, starts]))


def _starts(data: AxisData, fit: AxisFit, cause: AxisCause) -> tuple[float, ...]:
    """Where the cause's numbers begin: at the best of those to scan on top of the fit as it is."""
    if not cause.scan:
        return cause.starts
    points = np.array([[*fit.u, each] for each in cause.scan])
    errors = data.residuals((*fit.numbers, *cause.numbers), points)
    return (cause.scan[int(np.argmin((errors**2).sum(axis=1)))],)


def _sizes(data: AxisData, fit: AxisFit) -> Array:
    """For each channel, the size of the residual."""
    return np.array([_size(data, each) for each in _channels(data, fit)])


def _size(data: AxisData, residual: Array | None) -> float:
    if residual is None:
        return 1.0
    return max(math.sqrt(float((residual[data.parts.weight > 0.0] ** 2).mean())), 1e-9)


def _channels(data: AxisData, fit: AxisFit) -> tuple[Array, Array | None]:
    """Residuals of motion and current, (rows, stretches) each."""
    shape = data.parts.measured.shape
    count = shape[0] * shape[1]
    current = fit.residual[count:].reshape(shape) if len(fit.residual) > count else None
    return fit.residual[:count].reshape(shape), current


def _colour(data: AxisData, fit: AxisFit) -> Array:
    """For each channel, the size of the residual times the root of how many neighbours are alike."""
    return np.array(
        [
            _size(data, each) * (1.0 if each is None else math.sqrt(_alike(each)))
            for each in _channels(data, fit)
        ]
    )


def _alike(residual: Array) -> float:
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


def _try(data: AxisData, now: AxisFit, left_out: float, cause: AxisCause) -> Tried:
    """now: the model so far. left_out: its misfit of blocks that were left out."""
    fit = _with(data, now, [cause])
    fit = _better(fit, now, cause)
    k = len(cause.numbers)
    samples = max(float((fit.residual != 0.0).sum()) / _alike(fit.residual[:, None]), 3.0)
    evidence = now.misfit - fit.misfit - k * math.log(samples)
    return Tried(cause, fit, evidence, left_out - left_out_misfit(data, fit))


def _better(fit: AxisFit, now: AxisFit, cause: AxisCause) -> AxisFit:
    """The fit, or the old one with the cause at 0 where it is not better: a fit that got lost."""
    if fit.misfit <= now.misfit:
        return fit
    zeros = np.zeros(len(cause.numbers))
    jacobian = np.hstack([now.jacobian, np.zeros((len(now.residual), len(zeros)))])
    return replace(
        now, numbers=(*now.numbers, *cause.numbers), u=np.concatenate([now.u, zeros]), jacobian=jacobian
    )


def left_out_misfit(data: AxisData, fit: AxisFit) -> float:
    """Misfit of each block under the fit without it, one Gauss-Newton step away from the whole fit."""
    prior = np.diag([float(each.prior) for each in fit.numbers])
    count = int(fit.group.max()) + 1
    block = fit.group * min(BLOCKS, count) // count
    points = []
    for index in range(min(BLOCKS, count)):
        rest = block != index
        J, r = fit.jacobian[rest], fit.residual[rest]
        step = np.linalg.lstsq(J.T @ J + prior, J.T @ r + prior @ fit.u, rcond=None)[0]
        points.append(fit.u - np.clip(step, -1.0, 1.0))
    errors = data.residuals(fit.numbers, np.array(points))
    return float(sum((errors[index, block == index] ** 2).sum() for index in range(len(points))))


def _best(tried: Sequence[Tried]) -> Tried | None:
    """The most evidence among those that also help what was left out; a tie goes to the plainer cause."""
    good = [
        each for each in tried if LEAST_EVIDENCE < each.evidence < math.inf and each.left_out > LEAST_LEFT_OUT
    ]
    if not good:
        return None
    most = max(each.evidence for each in good)
    return next(each for each in good if each.evidence > most - TIE)


def alike(fit: AxisFit, cause: AxisCause, other: AxisFit, rival: AxisCause) -> float:
    """Cosine between what two causes add beyond the shared model: 1 where the data cannot tell them."""
    a, b = _own(fit, cause), _own(other, rival)
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / size if size > 0.0 else 0.0


def _own(fit: AxisFit, cause: AxisCause) -> Array:
    """The strongest direction of a cause's columns after the other columns took what they can."""
    k = len(cause.numbers)
    rest, mine = fit.jacobian[:, :-k], fit.jacobian[:, -k:]
    left = mine - rest @ np.linalg.lstsq(rest, mine, rcond=None)[0]
    return np.asarray(left[:, int(np.argmax((left**2).sum(axis=0)))])
