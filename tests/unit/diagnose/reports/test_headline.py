"""What a report begins with."""

from __future__ import annotations

from dataclasses import replace

import pytest

from raccoon.diagnose.reports import html
from raccoon.diagnose.reports.html import render_page
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import SAME_ROBOT, Diagnosis, Rejected, SensorFault, Unexplained, Verdict


@pytest.fixture(autouse=True)
def words_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages whose figures are not turned into pictures."""
    monkeypatch.setattr(html, "figure_to_base64_png", lambda _: "AAAA")


def adequate(hidden: int) -> Diagnosis:
    reason = "not visible in this recording: a usual deviation would not show"
    rejected = [Rejected(f"some.{number}", reason) for number in range(hidden)]
    rejected.append(Rejected("motor.back_emf_constant", "explains nothing; would show from about 4.9 % on"))
    return Diagnosis(Verdict.ADEQUATE, (), (), tuple(rejected), Unexplained(0.0), (), 0.1)


def test_that_nothing_is_wrong_is_not_said_of_what_could_not_have_shown_it() -> None:
    sees, blind = (terminal_report(adequate(hidden)) for hidden in (2, 12))
    assert "nothing that matters is wrong" in sees
    assert "nothing that matters is wrong" not in blind
    assert "but that says little: of 13 causes 12 would not show" in blind
    for text in (sees, blind, render_page(adequate(2), "run")):
        assert "Errors from this size on would have shown: K_E 4.9 %." in text


def test_what_is_unknown_is_said_with_what_it_depends_on() -> None:
    found = replace(adequate(0), verdict=Verdict.UNKNOWN, unexplained=Unexplained(0.8, ("wheel angle left",)))
    said = "in a way that no known cause describes: it depends on the angle of the left wheel."
    assert terminal_report(found).splitlines()[0].endswith(said)
    assert render_page(found, "run").partition("<pre")[0].count(said) == 1
    nothing = replace(found, unexplained=Unexplained(0.8))
    assert "that no known cause describes." in terminal_report(nothing)


def test_a_motor_that_did_not_turn_comes_first() -> None:
    stood = SensorFault("motor.0.duty", "stood", "from 3.0 to 9.0 s motor 0 did not turn")
    found = replace(adequate(2), sensor_faults=(stood,))
    first, second, *_ = terminal_report(found).splitlines()
    assert first.endswith("the simulation fits this recording.")
    assert second == "  ! Motor: from 3.0 to 9.0 s motor 0 did not turn."
    assert '<p class="big">From 3.0 to 9.0 s motor 0 did not turn.</p>' in render_page(found, "run")
    assert 'class="head faulty"' in render_page(found, "run")
    assert 'class="head adequate"' in render_page(adequate(2), "run")


def test_a_held_out_recording_of_another_robot_is_asked_about_first() -> None:
    """It was the fourth note, below two causes with a probability of 1, of which none held there."""
    note = f"on the other recording the better model is off by 34.25 times the noise: {SAME_ROBOT}"
    found = replace(adequate(2), notes=("the gyro lags", note))
    asked = note.replace("on", "On", 1)
    assert terminal_report(found).splitlines()[0] == asked
    page = render_page(found, "run")
    assert terminal_report(found).count(SAME_ROBOT) == page.partition("<pre")[0].count(SAME_ROBOT) == 1
    assert page.index(asked) < page.index("the simulation fits".capitalize())
    assert "Note: the gyro lags." in terminal_report(found)
