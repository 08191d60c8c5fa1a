"""Estimation of the noise at a working point: the residual that nothing in the catalogue explains.

The residual of a model also contains the effect of a missing cause, and noise estimated from it would hide
that cause. So all directions in which the model may differ, including the probes, are fitted first. But a fit
of two hundred directions also absorbs noise, most of all in the few moments in which everything acts at once:
reversals, wheels that break loose. There its residual is several times too small. The noise is therefore
estimated from the *held-out* error, with which each half second is predicted by a fit of all others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.bins import runs_of_true
from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.cross_validation import RecordingPart, held_out_error, log_evidence_of_wander
from raccoon.diagnose.fit.linear_model import ColumnGroup, LinearModel
from raccoon.diagnose.fit.noise_model import (
    CHANGING,
    CREEPING,
    STANDING,
    STEADY,
    NoiseModel,
    fit_noise_model,
    white_noise,
)
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.fit.wander import Piece, split_into_pieces
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.form_errors import form_error_factor, form_weight

Array = NDArray[np.float64]

VAR_ORDER = 6
"""Order of the noise's vector autoregression, in bins of 20 ms."""
VAR_ORDER_SHORT_BINS = 12
"""The same for bins of a quarter of that width. With order 6, two of six faults in drives with a wheel loop
had a small friction named beside them, with 12 one."""
STANDSTILL_SHARE = 0.03
"""Threshold on a wheel's reading, relative to its largest, below which the wheel counts as standing."""
CREEP_SHARE = 0.15
"""Threshold on a wheel's reading, relative to its largest, below which stick and slip dominate."""
CHANGE_SHARE = 0.03
"""Threshold on the change of a wheel's reading in 20 ms, relative to its largest reading, above which the
wheel accelerates or brakes."""
FORM_ERROR_RMS = 0.006
"""RMS form error, in units of the noise, of any model in the direction of any effect: it is no evidence of
the effect."""
MAX_FORM_ERROR_WIDTHS = 0.0125
"""Upper bound of the form error in the effect's widths. Both are multiplied by the effect's
`form_error_factor`."""
FORM_ERROR_SHARE = 0.005
"""Share of the response to a cause of usual `form_weight` that is a form error in the direction of any other
effect."""
EXEMPT_RESPONSE_RMS = 1.8
"""RMS of that response, in units of the noise, up to which the gates protect sufficiently against its form
error."""
MAX_FORM_ERROR_FACTOR = 2.5
"""Largest factor by which the responses of active causes raise `FORM_ERROR_RMS`."""
FEW_SPEED_CHANGES = 8
"""Number of speed changes up to which a drive may have too few of them to predict one from the others: a leg
there and back has four, 10 s as the tool advises at least 9, 12 s of an exciting drive 11, a contest drive
17."""
MAX_HELD_OUT_RATIO = 1.25
"""Ratio of a channel's held-out error to the residual at the working point, above which the remaining data
were too few to predict it: on a leg there and back it is up to 5."""
PRIOR_SHRINKAGES = (0.3, 0.1, 0.03)
"""Factors on the prior widths of all directions except the model's own that are tried in that case."""
WANDER_SHARES = (0.0, 0.02, 0.04, 0.07)
"""Sizes of slowly varying floor friction, RMS relative to Coulomb friction, that are compared."""


def estimate_whitener(
    problem: Problem,
    linear: LinearModel,
    extra: Sequence[ColumnGroup],
    before: Whitener | None,
    unknown: Sequence[str] = (),
    tolerant: bool = True,
) -> Whitener:
    """Estimate the noise: the residual that nothing in the catalogue explains.

    extra: probes. before: the previous whitener, whose noise model is the start of the estimation.

    tolerant: whether a small deviation of every inactive effect counts as noise. A search needs that. The
    last fit does not: causes would come out too small, and base numbers that resemble an effect would hardly
    count.

    unknown: probes that were found to act; their curves are part of the noise, so that no known cause is
    named for their effect.
    """
    order = VAR_ORDER if problem.features.width > BIN_S / 2 else VAR_ORDER_SHORT_BINS
    pieces = [Piece.of(problem, linear, bins, order) for bins in split_into_pieces(problem.features)]
    known = [linear.jacobian, *(each.columns for each in (*linear.groups, *extra))]
    floors, event, regimes = problem.features.floors, problem.features.event, classify_regimes(problem)
    noise = (
        before.noise
        if before is not None
        else white_noise(np.maximum(linear.residual.std(axis=0), floors), regimes)
    )
    unexplained, wander = linear.residual, 0.0
    has_few_changes = len(runs_of_true(regimes == CHANGING)) <= FEW_SPEED_CHANGES
    residual_rms = np.maximum(_rms_by_regime(unexplained, regimes), floors) if has_few_changes else None
    for _ in range(1 if before is not None else 2):
        unexplained, wander = _estimate_unexplained(noise, known, pieces, linear.target, residual_rms, event)
        noise = fit_noise_model(unexplained, order, floors, regimes, event)
    base = noise.whiten(linear.jacobian[: len(problem.base)])
    last_group = {each.name: index for index, each in enumerate(linear.groups)}
    group_of_column = [index for index, each in enumerate(linear.groups) for _ in each.columns]
    names = [linear.groups[index].name for index in group_of_column]
    columns = np.concatenate([linear.jacobian[:0], *(each.columns for each in linear.groups)])
    white = noise.whiten(columns)
    width = problem.features.width / BIN_S
    strength = active_response_rms(linear.cause_responses, noise)
    parts = form_error_parts(names, base, white, strength, width)[:, None, None]
    counted = [i for i, index in enumerate(group_of_column) if last_group[names[i]] == index]  # one variant
    held_out_variance = ((parts[counted] * columns[counted]) ** 2).sum(axis=0)
    wandering = []
    for piece in pieces:
        wandering_columns = np.concatenate([wander * piece.friction, piece.creep])
        held_out_variance[piece.bins] += (piece.inside(wandering_columns) ** 2).sum(axis=0)
        wandering.append(piece.whitened(noise, wandering_columns))
    unnamed = [noise.whiten(each.columns) for each in extra if each.name in unknown]
    common = np.concatenate([white[:0], *unnamed, *([parts * white] if tolerant else [])])
    return Whitener.of(noise, wandering, common, unexplained, held_out_variance, wander)


def active_response_rms(responses: Mapping[str, Array], noise: NoiseModel) -> float:
    """RMS, in units of the noise, of the responses (bins, channels) to the active causes, each weighted by
    how inexact its form is: a latency is wrong in its size only."""
    weights = [form_weight(name) for name in responses]
    powers = [float((noise.whiten(each) ** 2).mean()) for each in responses.values()]
    return math.sqrt(sum(weight**2 * power for weight, power in zip(weights, powers, strict=True)))


def form_error_rms(strength: float, width: float = 1.0) -> float:
    """RMS form error, in units of the noise, of the active causes in the direction of any effect.

    strength: see `active_response_rms`. width: of a bin, in units of the 20 ms to which all errors refer.
    """
    return FORM_ERROR_SHARE * math.sqrt(max(strength**2 / width - EXEMPT_RESPONSE_RMS**2, 0.0))


def form_error_parts(
    names: Sequence[str], base: Array, columns: Array, strength: float = 0.0, width: float = 1.0
) -> Array:
    """The share of each whitened column that counts as form error, (columns,).

    names: the cause of each column. base: the whitened columns of base numbers, which absorb a part under
    their unit priors. strength: response to the active causes; see `active_response_rms`. width: of a bin, in
    units of the 20 ms to which all errors refer.
    """
    factor = min(math.hypot(1.0, form_error_rms(strength, width) / FORM_ERROR_RMS), MAX_FORM_ERROR_FACTOR)
    size = int(np.prod(columns.shape[1:]))
    plain, rows = base.reshape(len(base), size), columns.reshape(len(columns), size)
    cross = rows @ plain.T
    absorbed = np.einsum("ij,ji->i", cross, np.linalg.solve(np.eye(len(plain)) + plain @ plain.T, cross.T))
    rms = np.sqrt(np.maximum((rows**2).sum(axis=1) - absorbed, 1e-9) / (size * width))
    form = np.array([form_error_factor(name) for name in names])
    return np.asarray(form * factor * np.minimum(MAX_FORM_ERROR_WIDTHS, FORM_ERROR_RMS / rms), float)


def classify_regimes(problem: Problem) -> NDArray[np.intp]:
    """Regime of each bin (bins,): standing, steady, changing or creeping; steady throughout if there are no
    wheels."""
    features = problem.features
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    if not wheels:
        return np.full(len(features.time), STEADY)
    speed = features.measured[:, wheels]
    speed = speed / np.maximum(np.abs(speed).max(axis=0), 1e-9)
    moving = _dilate((np.abs(speed) > STANDSTILL_SHARE).any(axis=1), 2, 2)
    changing = _dilate(
        (np.abs(np.gradient(speed, axis=0)) > CHANGE_SHARE * features.width / BIN_S).any(axis=1), 2, 3
    )
    creeping = _dilate((np.abs(speed) < CREEP_SHARE).any(axis=1), 1, 1)
    driving = np.where(changing, CHANGING, np.where(creeping, CREEPING, STEADY))
    return np.where(moving, driving, STANDING)


def _dilate(flags: NDArray[np.bool_], before: int, after: int) -> NDArray[np.bool_]:
    """The flags, extended by so many bins before and after each run of them."""
    wide = flags.copy()
    for shift in range(1, before + 1):
        wide[:-shift] |= flags[shift:]
    for shift in range(1, after + 1):
        wide[shift:] |= flags[:-shift]
    return wide


def _estimate_unexplained(
    noise: NoiseModel,
    known: Sequence[Array],
    pieces: Sequence[Piece],
    target: Array,
    residual_rms: Array | None,
    event: int,
) -> tuple[Array, float]:
    """The held-out error, (bins, channels), and the expected size of slowly varying friction.

    known: directions, the model's own first. residual_rms: for a drive with few changes of speed, the
    residual at the working point (bins, channels), RMS over its regime; else None.

    In a drive with four ramps none can be predicted from the others if two hundred directions may differ: the
    error is then unknown dynamics, as smooth as a model, and under such noise smooth errors of a model cost
    nothing. In that case the priors of all directions except the model's own are narrowed to the width that
    predicts best.
    """
    goal = noise.whiten(target)
    parts = []
    for piece in pieces:
        columns = np.concatenate([piece.friction, *(each[:, piece.span] for each in known)])
        white, bins = piece.whitened(noise, columns), piece.bins
        parts.append(
            RecordingPart.of(piece.inside(columns), white, target[bins], goal[bins], len(piece.friction))
        )
    wander = expected_wander_share([log_evidence_of_wander(parts, share) for share in WANDER_SHARES])

    def error_with_shrinkage(shrinkage: float) -> Array:
        """The held-out error with the prior widths of all directions except the model's own shrunk."""
        widths = np.repeat([1.0, shrinkage], [len(known[0]), sum(len(each) for each in known[1:])])
        return held_out_error(parts, widths, wander, event)

    error = error_with_shrinkage(1.0)
    if residual_rms is not None and _worst_channel_ratio(error, residual_rms) > MAX_HELD_OUT_RATIO:
        ratio = partial(_worst_channel_ratio, residual_rms=residual_rms)
        error = min((error, *map(error_with_shrinkage, PRIOR_SHRINKAGES)), key=ratio)
    return error, wander


def _worst_channel_ratio(error: Array, residual_rms: Array) -> float:
    """RMS of an error relative to the residual, in the channel with the largest ratio."""
    return float(np.sqrt(((error / residual_rms) ** 2).mean(axis=0)).max())


def _rms_by_regime(values: Array, regimes: NDArray[np.intp]) -> Array:
    """RMS of each channel over the bins of a regime, in each of its bins."""
    levels = np.empty_like(values)
    for regime in np.unique(regimes):
        rows = regimes == regime
        levels[rows] = np.sqrt((values[rows] ** 2).mean(axis=0))
    return levels


def expected_wander_share(evidence: Sequence[float]) -> float:
    """Posterior RMS size of slowly varying friction, relative to Coulomb friction, from the log evidence of
    each of `WANDER_SHARES` and a uniform prior over them.

    40 s determine the size. 12 s do not: the most likely size was 0 in most of them, since everything that is
    fitted beside it takes its place, and a cause was named on 7 of 160 clean drives (on 2 with the mean).
    """
    weights = np.exp(np.array(evidence) - max(evidence))
    return float(np.sqrt(weights @ np.square(WANDER_SHARES) / weights.sum()))
