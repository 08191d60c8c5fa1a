"""Comparison of two fits of one recording: by log evidence, and by prediction of held-out data.

A *lead* is the difference of log evidence between two fits, in which the contribution of each half second (an
*event*) is limited.
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
"""Number of blocks of time, each of which is predicted by a fit of all others."""
MAX_EVENT_LEAD = 4.0
"""Largest log evidence that one event (half a second) may contribute."""


def log_evidence_lead(problem: Problem, fit: Fit, other: Fit) -> float:
    """Log evidence of `fit` over `other`, with each event's contribution limited to `MAX_EVENT_LEAD`.

    A wheel that breaks loose a moment too late is a large error of one moment, and any parameter that shifts
    that moment would seem to explain much. A real cause acts again and again.
    """
    of_readings = problem.reading_evidence_at(fit.point) - problem.reading_evidence_at(other.point)
    return (
        of_readings
        + fit.evidence
        - other.evidence
        - event_excess(problem, fit.whitened_residual, other.whitened_residual)
    )


def nested_lead(problem: Problem, fit: Fit, less: Fit) -> float:
    """`log_evidence_lead` of a fit over a nested one, which lacks some of its causes. The determinant of the
    curvature of the shared coordinates counts as equal in both.

    That determinant (the posterior uncertainty of the shared coordinates) is computed from the columns at
    either point. With backlash, whose response is a staircase, it changes the log evidence by several units
    from stair to stair, independently of the causes.
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
    """The part of the log likelihood ratio of two whitened residuals that lies beyond the limit of single
    events."""
    events = _lead_by_event(problem, white, other)
    return float((events - _clip_events(events)).sum())


def _lead_by_event(problem: Problem, white: Array, other: Array) -> Array:
    """Log likelihood of one whitened residual over another in each event, (events,)."""
    gains, features = 0.5 * (other**2 - white**2), problem.features
    return np.add.reduceat(gains, np.arange(0, len(gains), features.event * features.measured.shape[1]))


def _clip_events(events: Array) -> Array:
    """The log likelihoods of events, clipped to +-MAX_EVENT_LEAD."""
    return np.clip(events, -MAX_EVENT_LEAD, MAX_EVENT_LEAD)


def block_grams(fit: Fit) -> list[Gram]:
    """Gram matrices of a fit's columns and target in each held-out block of time."""
    target, columns = fit.target, fit.jacobian[fit.free]
    return [Gram.of(columns[:, part].T, target[part]) for part in split_rows(len(target), HELD_OUT_BLOCKS)]


@dataclass(frozen=True, slots=True)
class HeldOutPrediction:
    """A fit's prediction of held-out data. residual (rows,): the whitened residual of each block of time,
    predicted by a fit of all others. prior_cost: half the sum of squared base coordinates, since robot.toml's
    values are data as well."""

    residual: Array
    prior_cost: float

    @classmethod
    def of(cls, fit: Fit) -> HeldOutPrediction:
        """Predict each block of a fit's data from all others."""
        base = fit.point.base
        return cls(
            held_out_residual(fit.jacobian[fit.free], fit.target, HELD_OUT_BLOCKS), 0.5 * float(base @ base)
        )


def held_out_lead(problem: Problem, one: HeldOutPrediction, other: HeldOutPrediction) -> float:
    """Log predictive score of one fit over another, with each event clipped as in `log_evidence_lead`."""
    return (
        other.prior_cost
        - one.prior_cost
        + float(_clip_events(_lead_by_event(problem, one.residual, other.residual)).sum())
    )
