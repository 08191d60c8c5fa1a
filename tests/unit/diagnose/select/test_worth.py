"""What a cause is worth beside others, whose columns differ from one stair of a rough misfit to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.select.fit_comparison import log_evidence_lead, nested_lead

PLAY, SCALE = "drive.backlash", "bemf.scale@left"


def _fits(problem: Problem, stair: float, cost: float = 40.0) -> tuple[Fit, Fit]:
    """A fit with play and a scale, and the one without the scale, which costs so much more. stair: times its
    own by which the response to play is larger at the point of the second."""
    rng = np.random.default_rng(4)
    count = len(problem.base) + 3
    columns = rng.normal(size=(count, problem.features.measured.size))
    white = np.ones(columns.shape[1])
    point = problem.nominal().with_cause(SCALE, np.array([0.1])).with_cause(PLAY, np.array([0.1, 0.0]))
    fit = Fit(point, white, columns, 100.0, np.ones(count, bool))
    kept = np.delete(columns, len(problem.base), axis=0)  # the scale was taken first
    kept[-2] *= stair
    less = Fit(point.without_cause(SCALE), white, kept, 100.0 + cost, np.ones(count - 1, bool))
    return fit, less


def test_a_cause_is_worth_the_same_from_whichever_stair_it_is_left_out(problem: Problem) -> None:
    """A scale of one wheel worth 13 had 9.9 where it needed 11."""
    fit, less = _fits(problem, 1.0)
    own = fit.jacobian[len(problem.base)]
    assert nested_lead(problem, fit, less) == pytest.approx(log_evidence_lead(problem, fit, less))
    assert nested_lead(problem, fit, less) == pytest.approx(20.0 - 0.5 * np.log(1.0 + own @ own), abs=0.1)
    _, higher = _fits(problem, 20.0)
    assert log_evidence_lead(problem, fit, higher) > log_evidence_lead(problem, fit, less) + 2.5
    assert nested_lead(problem, fit, higher) == pytest.approx(nested_lead(problem, fit, less))


def test_a_fit_that_gives_no_numbers_is_worth_nothing(problem: Problem) -> None:
    fit, less = _fits(problem, 1.0)
    assert nested_lead(problem, replace(fit, cost=np.inf), less) == -np.inf
