"""Causes and diagnoses as a search hands them on, for tests of what is done with them then."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from raccoon.diagnose.reports.cause_text import explanation_sentence
from raccoon.diagnose.result import CauseResult, Diagnosis, Gain, ParameterResult, Unexplained, Verdict

Numbers = Mapping[str, ParameterResult]


def factor_parameters(value: float, std: float = 0.01) -> Numbers:
    """The number of a cause that is a factor."""
    return {"factor": ParameterResult(value, std, "", 1.0)}


def make_cause(
    name: str, numbers: Numbers | None = None, said: str | None = None, **other: Any
) -> CauseResult:
    """A cause that is sure and matters, by id or id@where. said: by default what a report says of it."""
    id_, _, where = name.partition("@")
    values = numbers or {}
    if said is None:
        said = explanation_sentence(id_, where or None, values)
    plain = CauseResult(id_, where or None, 1, values, Gain(3.0, 1.0, 0.9), 1.0, (), said, 2.0, 1.0)
    return replace(plain, **other)


def make_diagnosis(*causes: CauseResult, **other: Any) -> Diagnosis:
    """A diagnosis in which they explain everything, or nothing is wrong."""
    verdict = Verdict.EXPLAINED if causes else Verdict.ADEQUATE
    return replace(Diagnosis(verdict, (), causes, (), Unexplained(0.0), (), 0.1), **other)
