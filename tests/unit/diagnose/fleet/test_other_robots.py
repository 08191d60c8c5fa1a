"""A recording whose robot.toml is another robot's."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnoses import make_cause, make_diagnosis
from raccoon.diagnose.fleet.other_robots import CHECK_ROBOT_TOML, with_doubted_robot
from raccoon.diagnose.result import CauseResult, ParameterResult, Verdict

TRACK = ("drive.track_width", 1.375)
K_E = ("motor.back_emf_constant", 1.274)
RADIUS = ("drive.wheel_radius", 0.868)


def cause(id_: str, factor: float, where: str | None = None) -> CauseResult:
    found = make_cause(id_, {"factor": ParameterResult(factor, 0.02, "", 1.0)})
    return replace(found, where=where, change=20.0, unabsorbed=5.0)


@pytest.mark.parametrize(
    ("causes", "doubted"),
    [
        ([TRACK, K_E, RADIUS], True),  # one far off, and two that compensate for it
        ([TRACK, ("drive.inertia", 0.5)], True),
        ([TRACK, K_E], False),
        ([("drive.inertia", 1.8)], False),  # a payload
        ([("drive.track_width", 1.2), ("motor.back_emf_constant", 1.1), RADIUS], False),
    ],
)
def test_several_numbers_of_the_whole_robot_that_are_off_are_no_faults(
    causes: list[tuple[str, float]], doubted: bool
) -> None:
    """Half of the K_E and two thirds of the lengths were `explained`, by K_E and dry friction with a
    probability of 1 and with wrong numbers."""
    rub = cause("friction.load_dependent", 0.2)
    found = replace(
        make_diagnosis(), verdict=Verdict.EXPLAINED, causes=(*(cause(*each) for each in causes), rub)
    )
    said = with_doubted_robot(found)
    assert said.verdict is (Verdict.PARTLY if doubted else Verdict.EXPLAINED)
    assert [each.explanation.endswith(CHECK_ROBOT_TOML) for each in said.causes] == [doubted] * len(
        said.causes
    )
    assert [each.name for each in said.causes] == [each.name for each in found.causes]


def test_numbers_of_one_wheel_are_not_another_robots() -> None:
    sides = tuple(cause("motor.back_emf_constant", 1.5, side) for side in ("left", "right"))
    found = replace(
        make_diagnosis(), verdict=Verdict.EXPLAINED, causes=(*sides, cause("drive.track_width", 1.1))
    )
    assert with_doubted_robot(found) == found


def test_an_unknown_verdict_stays() -> None:
    found = replace(
        make_diagnosis(), verdict=Verdict.UNKNOWN, causes=tuple(cause(*each) for each in (TRACK, K_E, RADIUS))
    )
    assert with_doubted_robot(found).verdict is Verdict.UNKNOWN
