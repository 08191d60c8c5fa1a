"""A reference in a wrong scale is one fault."""

from __future__ import annotations

import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.diagnose.recordings.plausibility.reference_scale import (
    TRACK_BY_REFERENCE,
    explain_by_reference_scale,
)
from raccoon.diagnose.result import CauseResult

TRACK = make_cause("drive.track_width", factor_parameters(1.1, 0.001))
RADIUS = make_cause("drive.wheel_radius", factor_parameters(1.102, 0.012))


def told(*causes: CauseResult, reference: bool = True) -> list[str]:
    identified = {TRACK_BY_REFERENCE: factor_parameters(1.1, 0.001)["factor"]} if reference else {}
    return [
        each.explanation
        for each in explain_by_reference_scale(make_diagnosis(*causes, identified=identified)).causes
    ]


def test_both_lengths_that_are_off_alike_are_asked_after() -> None:
    """Each was sure, and to be written into robot.toml, of a camera that saw 11 cm in 10."""
    for said, given in zip(told(TRACK, RADIUS), (TRACK, RADIUS), strict=True):
        assert said.startswith(given.explanation)
        assert "truth.x and truth.y are 10.0 % too long, that alone explains drive.track_width and" in said


@pytest.mark.parametrize(
    "causes",
    [
        (TRACK,),
        (TRACK, make_cause("drive.wheel_radius", factor_parameters(1.03, 0.012))),
        (TRACK, make_cause("drive.wheel_radius@left", factor_parameters(1.1, 0.012))),
        (TRACK, make_cause("motor.back_emf_constant", factor_parameters(1.1, 0.012))),
    ],
)
def test_others_are_causes_of_their_own(causes: tuple[CauseResult, ...]) -> None:
    assert told(*causes) == [each.explanation for each in causes]


def test_without_a_reference_nothing_is_asked() -> None:
    assert told(TRACK, RADIUS, reference=False) == [TRACK.explanation, RADIUS.explanation]
