"""One fault of a recording that looks like several causes: explained at one, and referred to by the
others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from raccoon.diagnose.result import Diagnosis, ParameterResult

MIN_RELATIVE_ERROR = 0.01
"""Least relative error of a scale that explains anything."""
MAX_SIGMAS_APART = 2.5
"""Standard deviations within which two values agree with one fault."""


def attribute_to_one_fault(
    found: Diagnosis, primary: str, explanation: str, explained: Collection[str], see: str
) -> Diagnosis:
    """The diagnosis with `explanation` as the explanation of the cause `primary`, and `see` appended to those
    of the causes `explained`."""
    explanations = {primary: explanation} | {
        each.name: f"{each.explanation} {see}" for each in found.causes if each.name in explained
    }
    causes = tuple(
        replace(each, explanation=explanations.get(each.name, each.explanation)) for each in found.causes
    )
    return replace(found, causes=causes)


def inverse_with_error(factor: ParameterResult) -> tuple[float, str]:
    """The inverse of a factor, and its difference from 1 in percent with its standard deviation, as text."""
    inverse = 1.0 / factor.value
    size = f"{100.0 * abs(inverse - 1.0):.1f} +- {100.0 * inverse * factor.std / factor.value:.1f} %"
    return inverse, size
