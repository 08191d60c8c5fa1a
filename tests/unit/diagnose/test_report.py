from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon.diagnose.reports.html import page, save_html
from raccoon.diagnose.reports.terminal import shape_text, terminal_report
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Curve,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    SensorFault,
    Shape,
    Unexplained,
    Verdict,
)

TIME = np.linspace(0.0, 5.0, 400)
CAUSE = CauseResult(
    "motor.back_emf_constant", "left", 1, {"factor": ParameterResult(0.959, 0.004, "", 1.0)},
    Gain(4.2, 1.1, 0.93), 0.99, ("bemf.scale@left",),
    "The K_E of the left motor is 4.1 % lower than assumed: calibrate the left motor.",
)  # fmt: skip
FOUND = Diagnosis(
    Verdict.PARTLY,
    (ChannelResult("motor.0.bemf", "counts", 40.0, 11.0, 10.0, 0.4),),
    (CAUSE,),
    (
        Rejected("drive.slope", "explains nothing that is left"),
        Rejected("imu.gyro_scale", "not identifiable: imu.gyro.z is missing"),
    ),
    Unexplained(0.12, ("heading",)),
    ("ten counted full turns",),
    3.2,
    None,
    ("a note",),
    {"battery resistance": ParameterResult(0.12, 0.01, "ohm", 0.0)},
    (SensorFault("motor.1.current", "dead", "motor.1.current shows <no> current"),),
    (Curve("motor.0.bemf", "counts", TIME, np.sin(TIME), 0.8 * np.sin(TIME), np.sin(TIME)),),
    (
        Shape(
            "gyro over speed", "error of the gyro's reading", "rad/s", TIME, "rad/s of the wheels",
            0.02 * np.maximum(TIME - 4.0, 0.0), np.full(len(TIME), 0.001),
        ),
    ),
)  # fmt: skip


def test_it_is_said_when_a_channel_is_furthest_off_and_whether_the_rest_is_white() -> None:
    early = np.where(np.abs(TIME - 1.7) < 0.2, 1.0, 0.0)
    curve = Curve("motor.0.bemf", "counts", TIME, np.zeros(400), early, early)
    assert curve.worst == 1.75
    channel = replace(FOUND.channels[0], rmse_after=20.0, whiteness_p=1e-5)
    found = replace(FOUND, channels=(channel,), curves=(curve,))
    assert "furthest off around 1.8 s" in terminal_report(found)
    assert "not white (p 1e-05), furthest off around 1.8 s" in page(found, "run")
    assert "furthest off" not in terminal_report(FOUND)  # noise is not worth a word
    assert "white (p 0.4)" in page(FOUND, "run")


def test_what_no_cause_describes_has_a_size_and_a_place() -> None:
    (shape,) = FOUND.shapes
    assert shape.size.value == pytest.approx(0.02)
    assert shape.size.std == pytest.approx(0.001 * np.sqrt(2.0))
    assert shape_text(shape) == (
        "error of the gyro's reading varies by 0.02 +- 0.0014 rad/s over the speed, "
        "highest at 5 rad/s of the wheels"
    )


@pytest.mark.parametrize(
    ("share", "said"), [(0.12, "12 % of"), (0.001, "small here and depends on: heading")]
)
def test_a_share_of_nothing_is_not_said_to_be_left(share: float, said: str) -> None:
    assert said in terminal_report(replace(FOUND, unexplained=Unexplained(share, ("heading",))))


def test_the_terminal_says_cause_number_evidence_refusals_and_what_to_do() -> None:
    text = terminal_report(FOUND)
    for part in (
        "K_E of the left motor is 4.1 % lower", "0.959 +- 0.004", "4.20 without it, 1.10 with it",
        "cannot be told apart here from: bemf.scale@left",
        "12 % of the error's power is left; it depends on: heading",
        "Sensor: motor.1.current shows", "imu.gyro_scale: not identifiable: imu.gyro.z is missing",
        "To learn more: ten counted full turns.", "0.12 +- 0.01 ohm", "Note: a note.",
    ):  # fmt: skip
        assert part in text


def test_the_page_says_the_same_with_pictures_and_without_markup_from_names(tmp_path: Path) -> None:
    save_html(FOUND, tmp_path / "out.html", "run <1>")
    text = (tmp_path / "out.html").read_text()
    assert text.count("data:image/png;base64,") == 4
    assert "run &lt;1&gt;" in text
    assert "shows &lt;no&gt; current" in text
    for part in (
        "The K_E of the left motor is 4.1 % lower than assumed.", "<b>To do:</b> Calibrate the left motor.",
        "Error of the gyro&#39;s reading varies by 0.02", "it depends on heading",
        "lower than assumed; or bemf.scale@left acts instead.", "cannot tell it from bemf.scale@left",
        "What was considered and not named",
        "explains nothing that is left",
        "What this recording cannot show", "ten counted full turns", "a note",
    ):  # fmt: skip
        assert part in text


def test_a_first_cause_that_others_can_stand_in_for_is_said_to_be_one() -> None:
    lag, other = replace(CAUSE, gain=Gain(1.11, 1.1, 0.01)), replace(CAUSE, where="right", rank=2)
    said = "without it the others would make up for it"
    for report in (terminal_report, lambda found: page(found, "run")):
        assert said in report(replace(FOUND, causes=(lag, other)))
        assert said not in report(replace(FOUND, causes=(lag,)))
        assert said not in report(replace(FOUND, causes=(CAUSE, replace(other, gain=lag.gain))))
        small = replace(CAUSE, gain=Gain(2.1, 1.0, 0.04))  # of much that could be gained a little, and missed
        assert said not in report(replace(FOUND, causes=(small, other)))


@pytest.mark.parametrize(("change", "said"), [(0.04, True), (0.06, False), (np.nan, False)])
def test_a_cause_that_does_not_matter_is_said_not_to(change: float, said: bool) -> None:
    small = replace(CAUSE, change=change, unabsorbed=0.6 * change)
    assert small.little is said
    found = replace(
        FOUND, verdict=Verdict.ADEQUATE if said else Verdict.EXPLAINED, causes=(small,), sensor_faults=()
    )
    text, html = terminal_report(found), page(found, "run")
    assert ("real, but too small to matter" in text) is ("real, but too small to matter" in html) is said
    headline = html.partition('class="big">')[2].partition("<")[0]
    assert headline.startswith("The simulation fits" if said else "The K_E of the left motor")
    assert ("<b>To do" in html) is not said  # nobody at the table has time for it
    sizes = (
        "hanges readings by up to 0.04 times their noise (over all, 0.024 beyond what robot.toml leaves open)"
    )
    assert (sizes in text) is (sizes in html) is said
    assert ("hanges readings by" in text) is bool(np.isfinite(change))  # nothing where no drive was recorded


def test_the_headline_says_what_else_it_may_be() -> None:
    two = replace(CAUSE, confounded_with=("bemf.scale@left", "drive.wheel_radius@left"))
    text = page(replace(FOUND, causes=(two,)), "run")
    assert "; or one of bemf.scale@left, drive.wheel_radius@left acts instead." in text
    alone = page(replace(FOUND, causes=(replace(CAUSE, confounded_with=()),)), "run")
    assert "acts instead" not in alone


def test_a_page_without_causes_still_has_a_headline_and_says_it_once() -> None:
    empty = Diagnosis(Verdict.ADEQUATE, (), (), (), Unexplained(0.0), (), 0.1)
    text = page(empty, "run")
    shown, _, as_text = text.partition("<pre")
    assert shown.count("nothing that matters is wrong") == 1
    assert "nothing that matters is wrong" in as_text
    assert "data:image" not in text
    assert "The simulation is wrong; a part of it has a name." in page(FOUND, "run")
