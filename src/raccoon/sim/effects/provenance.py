"""Provenance of a model's numbers: what found them, in which recording, and how certain they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from raccoon.core.schema import NOT_NEGATIVE, Bounds, named, number, word


@dataclass(frozen=True, slots=True)
class Origin:
    """Provenance of one effect. std: standard deviations of its parameters, each in the parameter's unit."""

    std: Mapping[str, float] = named("of the parameter", "standard deviation", NOT_NEGATIVE)
    source: str = word("", "how the numbers were found")
    probability: float = number(1.0, "1", "that this effect is there and not another", Bounds(0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Provenance:
    """Provenance of a whole model; empty if unknown."""

    recording: str = word("", "what was diagnosed")
    by: str = word("", "program and version")
    date: str = word("", "day, such as 2026-03-01")
    verdict: str = word("", "what the diagnosis said")


UNKNOWN = Provenance()
