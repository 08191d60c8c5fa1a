"""Comparison of two fits of one recording: by log evidence, and by prediction of held-out data.

A *lead* is the log evidence of one fit over another, with what a single event may add to it limited.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram, held_out_residual, split_rows
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.problem import Problem

Array = NDArray[np.float64]

HELD_OUT_BLOCKS = 8
"""Blocks of time, each of which is predicted by a fit of all others."""
MAX_EVENT_LEAD = 4.0
"""Largest log evidence that half a second may give."""


def log_evidence_lead(problem: Problem, fit: Fit, other: Fit) -> float:
    """Log evidence of `fit` over `other`, with each half second's share limited to `MAX_EVENT_LEAD`.

    A wheel that breaks loose a moment too late is a large error of one moment, and any parameter that shifts
    that moment would seem to explain much. What a cause really does, it does again and again.
    """
    of_readings = problem.reading_evidence_at(fit.point) - problem.reading_evidence_at(other.point)
    return (
        of_readings
        + fit.evidence
        - other.evidence
        - event_excess(problem, fit.whitened_residual, other.whitened_residual)
    )


def nested_lead(problem: Problem, fit: Fit, less: Fit) -> float:
    """`log_evidence_lead` of a fit over a nested one, which lacks some of its causes, with the determinant of
    the shared coordinates taken as equal.

    That determinant, their certainty, comes from their columns at either point. Beside wheels with play,
    whose response is a staircase, it differs from stair to stair by several of log evidence, which are no
    merit of a cause.
    """
    lead = log_evidence_lead(problem, fit, less)
    if not (fit.is_finite and less.is_finite):
        return lead
    spans = fit.point.spans()
    dropped = [row for name in spans if name not in less.point.active for row in spans[name]]
    shared = np.delete(np.arange(len(fit.jacobian)), dropped)
    _, logdet = np.linalg.slogdet(fit.curvature[np.ix_(shared, shared)])
    _, logdet_nested = np.linalg.slogdet(less.curvature)
    return lead + 0.5 * float(logdet - logdet_nested)


def event_excess(problem: Problem, white: Array, other: Array) -> float:
    """Log likelihood of one whitened residual over another beyond what single events may give."""
    events = _lead_by_event(problem, white, other)
    return float((events - _clip_events(events)).sum())


def _lead_by_event(problem: Problem, white: Array, other: Array) -> Array:
    """Log likelihood of one whitened residual over another in each half second, (events,)."""
    gains, features = 0.5 * (other**2 - white**2), problem.features
    return np.add.reduceat(gains, np.arange(0, len(gains), features.event * features.measured.shape[1]))


def _clip_events(events: Array) -> Array:
    """The events' log likelihoods clipped to what half a second may give."""
    return np.clip(events, -MAX_EVENT_LEAD, MAX_EVENT_LEAD)


def block_grams(fit: Fit) -> list[Gram]:
    """Inner products of a fit's columns and target in each held-out block of time."""
    target, columns = fit.target, fit.jacobian[fit.free]
    return [Gram.of(columns[:, part].T, target[part]) for part in split_rows(len(target), HELD_OUT_BLOCKS)]


@dataclass(frozen=True, slots=True)
class HeldOutPrediction:
    """How well a fit predicts held-out data. residual (rows,): whitened residual of each block of time,
    predicted by a fit of all others. prior_cost: half the squared base coordinates, since what robot.toml
    says is data as well."""

    residual: Array
    prior_cost: float

    @classmethod
    def of(cls, fit: Fit) -> HeldOutPrediction:
        """Predict each block of a fit's data."""
        base = fit.point.base
        return cls(
            held_out_residual(fit.jacobian[fit.free], fit.target, HELD_OUT_BLOCKS), 0.5 * float(base @ base)
        )


def held_out_lead(problem: Problem, one: HeldOutPrediction, other: HeldOutPrediction) -> float:
    """Log predictive score of one fit over another; each half second is clipped as in `log_evidence_lead`."""
    return (
        other.prior_cost
        - one.prior_cost
        + float(_clip_events(_lead_by_event(problem, one.residual, other.residual)).sum())
    )
