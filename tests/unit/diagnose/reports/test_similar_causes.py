"""Tests of what may change as much as what is named first."""

from __future__ import annotations

import math
from typing import Any

import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.diagnose.reports.similar_causes import causes_of_similar_size
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import CauseResult, ParameterResult

FIRST = "drive.turn_scrub"


def _two(size: float, other: float, std: float = 0.001, **more: Any) -> list[CauseResult]:
    """One cause said to change `size` with a number of 0.01 +- std, and behind it one said to change `other`,
    whose number is sure."""
    numbers = {"torque": ParameterResult(0.01, std, "N m", 0.0)}
    first = make_cause(FIRST, numbers, unabsorbed=size)
    return [
        first,
        make_cause(
            "motor.back_emf_constant@right",
            factor_parameters(0.9, 0.001),
            **{"unabsorbed": other, "rank": 2} | more,
        ),
    ]


@pytest.mark.parametrize(
    ("causes", "alike"),
    [
        (_two(0.95, 0.92), True),
        (_two(0.95, 0.5), False),
        (_two(0.95, 0.5, std=0.005), True),  # half of the number is its deviation, so half of the change
        (_two(0.95, 1.3), True),  # what may be no fault counts for less, and stands behind what it exceeds
        (_two(0.95, 0.92, change=0.01), False),  # it does not matter
        (_two(0.95, 0.0), False),
        (_two(math.nan, math.nan), False),  # no drive
    ],
)
def test_causes_change_as_much_where_their_numbers_allow_for_it(
    causes: list[CauseResult], alike: bool
) -> None:
    assert causes_of_similar_size(causes) == (tuple(causes[1:]) if alike else ())


def test_the_surer_number_of_a_pair_says_how_sure_its_change_is() -> None:
    first = make_cause(
        "drive.slope",
        {
            "along_x": ParameterResult(0.0001, 0.001, "N m", 0.0),
            "along_y": ParameterResult(0.05, 0.001, "N m", 0.0),
        },
        unabsorbed=1.0,
    )
    assert causes_of_similar_size([first, make_cause(FIRST, factor_parameters(1.1), unabsorbed=0.7)]) == ()


def test_nothing_is_as_much_as_none_or_one() -> None:
    assert causes_of_similar_size([]) == ()
    assert causes_of_similar_size([make_cause(FIRST, factor_parameters(1.1))]) == ()


def test_a_report_says_it_of_the_first_alone() -> None:
    text = terminal_report(make_diagnosis(*_two(0.95, 0.92)))
    assert text.count("about as much as") == 1
    explained = "the noise beyond what the tolerances in robot.toml explain"
    assert f"all readings by 0.95 times {explained}, about as much as motor.back_emf" in text
    assert "about as much" not in terminal_report(make_diagnosis(*_two(0.95, 0.5)))
