"""One fault of a recording that looks like several causes: said once, and pointed to from the others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from raccoon.diagnose.result import Diagnosis, ParameterResult

MIN_RELATIVE_ERROR = 0.01
"""Part by which a reading is off from which it is asked what that made."""
MAX_SIGMAS_APART = 2.5
"""Standard deviations within which two numbers are the same fault's."""


def attribute_to_one_fault(
    found: Diagnosis, primary: str, explanation: str, explained: Collection[str], see: str
) -> Diagnosis:
    """A diagnosis in which the cause of the name `first` says what the fault is, and those of the names
    `others` say `see` behind their own sentence."""
    explanations = {primary: explanation} | {
        each.name: f"{each.explanation} {see}" for each in found.causes if each.name in explained
    }
    causes = tuple(
        replace(each, explanation=explanations.get(each.name, each.explanation)) for each in found.causes
    )
    return replace(found, causes=causes)


def inverse_with_error(factor: ParameterResult) -> tuple[float, str]:
    """1 over a factor, and in words by how much that is not 1."""
    inverse = 1.0 / factor.value
    size = f"{100.0 * abs(inverse - 1.0):.1f} +- {100.0 * inverse * factor.std / factor.value:.1f} %"
    return inverse, size
