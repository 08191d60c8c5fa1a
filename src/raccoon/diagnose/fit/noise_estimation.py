"""Noise of what nothing in the catalogue explains, at a working point.

The residual of a model also holds what a missing effect does, and noise estimated from it would hide that
effect. So all directions in which the model may differ, probes among them, are fitted first, and what they
leave is taken for noise. But a fit of two hundred directions also swallows noise, most of all in the few
moments in which everything acts at once: reversals, wheels that break loose. There its residual is several
times too small. What counts is therefore the error with which each half second is *foreseen* by a fit of all
the others.
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
"""Bins of 20 ms that the noise's memory has."""
VAR_ORDER_SHORT_BINS = 12
"""The same of bins of a quarter of that. With 6, two of six faults that a wheel loop drove with had a small
friction beside them, with 12 one."""
STANDSTILL_SHARE = 0.03
"""Of the largest reading of a wheel: below it the wheel is taken to stand."""
CREEP_SHARE = 0.15
"""Part of the largest reading of a wheel: below it stick and slip rule."""
CHANGE_SHARE = 0.03
"""Change of a wheel's reading in 20 ms, of its largest: above it the wheel speeds up or brakes."""
FORM_ERROR_RMS = 0.006
"""Error, in units of the noise, that any model has in the direction of any effect: no evidence of it."""
MAX_FORM_ERROR_WIDTHS = 0.0125
"""Most of that, as a part of the effect's width. Both are multiplied by the effect's `form_error_factor`."""
FORM_ERROR_SHARE = 0.005
"""Of the response to a cause of usual `form_weight`, its error of form in the direction of any other
effect."""
EXEMPT_RESPONSE_RMS = 1.8
"""Root mean square of that response, in units of the noise, up to which the gates are enough against it."""
MAX_FORM_ERROR_FACTOR = 2.5
"""Most by which that raises what is faint."""
FEW_SPEED_CHANGES = 8
"""Changes of speed up to which a drive may show too few of them to foresee one from the others: a leg there
and back has four, 10 s as the tool advises 9 at least, 12 s of an exciting drive 11, a contest drive 17."""
MAX_HELD_OUT_RATIO = 1.25
"""Times what a working point leaves, of one channel, from which what is foreseen is worse than that for want
of anything to foresee it from: on a leg there and back it is up to 5."""
PRIOR_SHRINKAGES = (0.3, 0.1, 0.03)
"""Parts of their usual size in which all directions but the model's own are tried then."""
WANDER_SHARES = (0.0, 0.02, 0.04, 0.07)
"""Of Coulomb friction, by which a floor may let it wander: those that are compared."""


def estimate_whitener(
    problem: Problem,
    linear: LinearModel,
    extra: Sequence[ColumnGroup],
    before: Whitener | None,
    unknown: Sequence[str] = (),
    tolerant: bool = True,
) -> Whitener:
    """Noise of what nothing in the catalogue explains.

    tolerant: whether a little of every effect that is off is noise. A search needs it; a last fit does not:
    causes would be found too small by it, and base numbers that resemble an effect would hardly count.

    unknown: probes that were found to matter; from then on their curves are part of the noise, so that no
    known cause is blamed for what they do.
    """
    order = VAR_ORDER if problem.features.width > BIN_S / 2 else VAR_ORDER_SHORT_BINS
    slow = [Piece.of(problem, linear, bins, order) for bins in split_into_pieces(problem.features)]
    known = [linear.jacobian, *(each.columns for each in (*linear.groups, *extra))]
    floors, event, regimes = problem.features.floors, problem.features.event, classify_regimes(problem)
    noise = (
        before.noise
        if before is not None
        else white_noise(np.maximum(linear.residual.std(axis=0), floors), regimes)
    )
    rest, wander = linear.residual, 0.0
    few = len(runs_of_true(regimes == CHANGING)) <= FEW_SPEED_CHANGES
    left = np.maximum(_rms_by_regime(rest, regimes), floors) if few else None
    for _ in range(1 if before is not None else 2):
        rest, wander = _estimate_unexplained(noise, known, slow, linear.target, left, event)
        noise = fit_noise_model(rest, order, floors, regimes, event)
    own = noise.whiten(linear.jacobian[: len(problem.base)])
    last = {each.name: place for place, each in enumerate(linear.groups)}
    places = [place for place, each in enumerate(linear.groups) for _ in each.columns]
    names = [linear.groups[place].name for place in places]
    columns = np.concatenate([linear.jacobian[:0], *(each.columns for each in linear.groups)])
    white = noise.whiten(columns)
    width = problem.features.width / BIN_S
    parts = form_error_parts(names, own, white, active_response_rms(linear.cause_responses, noise), width)[
        :, None, None
    ]
    one = [i for i, place in enumerate(places) if last[names[i]] == place]  # of variants one
    spread = ((parts[one] * columns[one]) ** 2).sum(axis=0)
    wandering = []
    for piece in slow:
        every = np.concatenate([wander * piece.friction, piece.creep])
        spread[piece.bins] += (piece.inside(every) ** 2).sum(axis=0)
        wandering.append(piece.whitened(noise, every))
    unnamed = [noise.whiten(each.columns) for each in extra if each.name in unknown]
    common = np.concatenate([white[:0], *unnamed, *([parts * white] if tolerant else [])])
    return Whitener.of(noise, wandering, common, rest, spread, wander)


def active_response_rms(responses: Mapping[str, Array], noise: NoiseModel) -> float:
    """Root mean square, in units of the noise, of the responses (bins, channels) to causes that are on, each
    counted for as much as its form is inexact: a latency is wrong by nothing but its size."""
    weights = [form_weight(name) for name in responses]
    powers = [float((noise.whiten(each) ** 2).mean()) for each in responses.values()]
    return math.sqrt(sum(weight**2 * power for weight, power in zip(weights, powers, strict=True)))


def form_error_rms(strength: float, width: float = 1.0) -> float:
    """Error of form, in units of the noise, in the direction of any effect, of causes that do so much.

    strength: see `active_response_rms`. width: of a bin, in 20 ms, for which all errors are given.
    """
    return FORM_ERROR_SHARE * math.sqrt(max(strength**2 / width - EXEMPT_RESPONSE_RMS**2, 0.0))


def form_error_parts(
    names: Sequence[str], base: Array, columns: Array, strength: float = 0.0, width: float = 1.0
) -> Array:
    """The part of each whitened column that no model is expected to get right, (columns,).

    names: the cause of each column. base: the whitened columns of base numbers, which absorb what they can
    under their unit priors. strength: how much the causes that are on do; see `active_response_rms`.
    width: of a bin, in 20 ms, for which all errors are given.
    """
    worse = min(math.hypot(1.0, form_error_rms(strength, width) / FORM_ERROR_RMS), MAX_FORM_ERROR_FACTOR)
    size = int(np.prod(columns.shape[1:]))
    plain, rows = base.reshape(len(base), size), columns.reshape(len(columns), size)
    cross = rows @ plain.T
    absorbed = np.einsum("ij,ji->i", cross, np.linalg.solve(np.eye(len(plain)) + plain @ plain.T, cross.T))
    rms = np.sqrt(np.maximum((rows**2).sum(axis=1) - absorbed, 1e-9) / (size * width))
    form = np.array([form_error_factor(name) for name in names])
    return np.asarray(form * worse * np.minimum(MAX_FORM_ERROR_WIDTHS, FORM_ERROR_RMS / rms), float)


def classify_regimes(problem: Problem) -> NDArray[np.intp]:
    """Whether each bin belongs to standing, steady driving or a change; without wheels all is steady."""
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
    wide = flags.copy()
    for shift in range(1, before + 1):
        wide[:-shift] |= flags[shift:]
    for shift in range(1, after + 1):
        wide[shift:] |= flags[:-shift]
    return wide


def _estimate_unexplained(
    noise: NoiseModel,
    known: Sequence[Array],
    slow: Sequence[Piece],
    target: Array,
    left: Array | None,
    event: int,
) -> tuple[Array, float]:
    """The foreseen error, (bins, channels), and the share of wandering friction that is expected.

    known: directions, the model's own first. left: of a drive with few changes of speed, how
    much a working point leaves, (bins, channels), on average over its regime.

    A drive with four ramps foresees none of them from the others, once two hundred directions may differ: the
    error is then what is not known, as smooth as a model is, and beside such noise smooth errors of a model
    cost nothing. There all but the model's own are kept as small as foresees best.
    """
    goal = noise.whiten(target)
    parts = []
    for piece in slow:
        columns = np.concatenate([piece.friction, *(each[:, piece.span] for each in known)])
        white, bins = piece.whitened(noise, columns), piece.bins
        parts.append(
            RecordingPart.of(piece.inside(columns), white, target[bins], goal[bins], len(piece.friction))
        )
    wander = expected_wander_share([log_evidence_of_wander(parts, share) for share in WANDER_SHARES])

    def foreseen(part: float) -> Array:
        """The error with all but the model's own so much smaller."""
        sizes = np.repeat([1.0, part], [len(known[0]), sum(len(each) for each in known[1:])])
        return held_out_error(parts, sizes, wander, event)

    rest = foreseen(1.0)
    if left is not None and _worst_channel_ratio(rest, left) > MAX_HELD_OUT_RATIO:
        rest = min((rest, *map(foreseen, PRIOR_SHRINKAGES)), key=partial(_worst_channel_ratio, left=left))
    return rest, wander


def _worst_channel_ratio(error: Array, left: Array) -> float:
    """How large an error is, in parts of what is left, of the channel where that is most."""
    return float(np.sqrt(((error / left) ** 2).mean(axis=0)).max())


def _rms_by_regime(values: Array, regimes: NDArray[np.intp]) -> Array:
    """Root mean square of each channel over the bins of a regime, in each of its bins."""
    levels = np.empty_like(values)
    for regime in np.unique(regimes):
        rows = regimes == regime
        levels[rows] = np.sqrt((values[rows] ** 2).mean(axis=0))
    return levels


def expected_wander_share(evidence: Sequence[float]) -> float:
    """Root mean square share of wandering friction by the log evidence of `WANDER_SHARES`, all alike before.

    40 s tell which it is. 12 s do not: the likeliest share was 0 in most of them, as all that is fitted
    beside it takes its place, and a cause was named on 7 of 160 clean ones (now on 2).
    """
    weights = np.exp(np.array(evidence) - max(evidence))
    return float(np.sqrt(weights @ np.square(WANDER_SHARES) / weights.sum()))
