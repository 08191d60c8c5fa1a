from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnoses import make_diagnosis
from raccoon.core.schema import Bounds
from raccoon.diagnose.fleet.other_robots import ROBOT_TOML_QUESTION
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.reports import html
from raccoon.diagnose.reports.cause_text import describe_cause, explanation_sentence
from raccoon.diagnose.reports.html import render_page, save_html
from raccoon.diagnose.reports.pictures import cause_figure, curve_figure, error_figure
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.reports.unknown_text import shape_text
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
from raccoon.diagnose.select.detection_limits import format_detection_limit
from raccoon.sim.effects.effect import Parameter

TIME = np.linspace(0.0, 5.0, 400)
CAUSE = CauseResult(
    "motor.back_emf_constant", "left", 1, {"factor": ParameterResult(0.959, 0.004, "", 1.0)},
    Gain(4.2, 1.1, 0.93), 0.99, ("bemf.scale@left",),
    "The K_E (volts per speed) of the left motor is 4.1 % lower than assumed: calibrate the left motor "
    "(raccoon calibrate drive, raccoon tune wheels).",
)  # fmt: skip
FOUND = Diagnosis(
    Verdict.PARTLY,
    (ChannelResult("motor.0.bemf", "counts", 40.0, 11.0, 10.0, 0.4),),
    (CAUSE,),
    (
        Rejected("drive.slope", "explains none of the remaining error"),
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


@pytest.fixture
def words_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages whose figures are made but not turned into pictures, which takes half a second a page."""
    monkeypatch.setattr(html, "figure_to_base64_png", lambda _: "AAAA")


def test_no_number_of_a_page_is_a_power_of_ten_that_need_not_be(words_only: None) -> None:
    """A tophat's offset was -968.7 +- 6e+02 counts, and 99.6 times the noise were 1e+02."""
    number = {"offset": ParameterResult(-968.7, 602.0, "counts", 0.0)}
    found = replace(FOUND, causes=(replace(CAUSE, parameters=number, change=99.6, unabsorbed=99.7),))
    for text in (terminal_report(found), render_page(found, "a.csv")):
        assert "e+0" not in text
    assert "-970 +- 600 counts" in terminal_report(found)
    assert "most affected reading by 100 times its noise" in terminal_report(found)


def test_the_dot_of_the_largest_error_is_whole() -> None:
    """One cause near the noise had half of its dot beyond the frame."""
    little = replace(CAUSE, gain=Gain(1.03, 0.94, 0.5))
    axes = cause_figure(replace(FOUND, causes=(little,))).axes[0]
    right = axes.transData.transform((axes.get_xlim()[1], 0.0))[0]
    dot = axes.transData.transform((1.03, 0.0))[0]
    radius = 0.5 * np.sqrt(70.0) / 72.0 * axes.figure.dpi
    assert right - dot > radius


def test_pictures_say_what_is_compared() -> None:
    """Before, too, what robot.toml leaves open is refitted: that is not the simulation as it was."""
    for found, plain in ((FOUND, "without the causes"), (replace(FOUND, causes=()), "before")):
        errors, curve = error_figure(found), curve_figure(FOUND.curves[0], found)
        legends = [each.get_legend() for each in (*errors.axes, *curve.axes)]
        said = [text.get_text() for each in legends if each is not None for text in each.get_texts()]
        assert plain in said
        assert f"simulated, {plain}" in said
        assert not any("as it was" in each for each in said)


@pytest.mark.usefixtures("words_only")
def test_it_is_said_when_a_channel_is_furthest_off_and_whether_the_rest_is_white() -> None:
    early = np.where(np.abs(TIME - 1.7) < 0.2, 1.0, 0.0)
    curve = Curve("motor.0.bemf", "counts", TIME, 3.0 * TIME, early, 3.0 * TIME + early)
    assert curve.worst == 1.75
    channel = replace(FOUND.channels[0], rmse_after=20.0, whiteness_p=1e-5)
    found = replace(FOUND, channels=(channel,), curves=(curve,))
    assert "largest error around 1.8 s" in terminal_report(found)
    assert "not white (p 1e-05), largest error around 1.8 s" in render_page(found, "run")
    assert "largest error" not in terminal_report(FOUND)  # noise is not worth a word
    assert "white (p 0.4)" in render_page(FOUND, "run")
    # Of a tophat it was never asked, and said to be 0.
    found = replace(found, channels=(replace(channel, whiteness_p=np.nan),))
    assert "white (p" not in render_page(found, "run").partition("As text")[0]
    assert ">largest error around 1.8 s" in render_page(found, "run")
    assert found.to_dict()["channels"][0]["whiteness_p"] is None


@pytest.mark.usefixtures("words_only")
def test_what_white_means_is_said_where_it_is_said() -> None:
    assert "White: each error is independent" in render_page(FOUND, "run")
    axis = replace(FOUND, curves=())  # of an axis nobody asks
    assert "White:" not in render_page(axis, "run")
    assert "what is left" not in render_page(axis, "run")


def test_bars_say_whole_numbers_and_hide_no_digit_behind_the_line() -> None:
    (channel,) = FOUND.channels
    near, far = replace(channel, rmse_before=3740.0), replace(channel, rmse_before=10.0, rmse_after=9.72)
    figures = [error_figure(replace(FOUND, channels=(each,))) for each in (near, far)]
    texts = [text for each in figures for text in each.axes[0].texts]
    assert [text.get_text() for text in texts] == ["374", "1.1", "1.0", "0.97"]
    assert all(text.get_bbox_patch().get_facecolor()[3] == 1.0 for text in texts)


def test_what_no_cause_describes_has_a_size_and_a_place() -> None:
    (shape,) = FOUND.shapes
    assert shape.size.value == pytest.approx(0.02)
    assert shape.size.std == pytest.approx(0.001 * np.sqrt(2.0))
    assert shape_text(shape) == (
        "error of the gyro's reading varies by 0.0200 +- 0.0014 rad/s over the speed, "
        "highest at 5 rad/s of the wheels: does the controller shake: is it screwed down?"
    )


@pytest.mark.usefixtures("words_only")
def test_what_a_recording_cannot_show_is_said_once() -> None:
    """A tophat that saw one surface, and geometry without turns, said why twice."""
    reason = "not identifiable: analog.0: only one surface was seen"
    notes = (reason, "only one way", "another thing", "not checked, since only one way: drive.track_width")
    rejected = (
        Rejected("tophat.gain@0", reason),
        Rejected("drive.track_width", "not identifiable: only one way"),
    )
    lost = replace(FOUND, notes=notes, rejected=rejected)
    for said in (terminal_report(lost), render_page(lost, "run").partition("As text")[0]):
        assert [said.count(each) for each in ("only one surface was seen", "only one way")] == [1, 1]
        assert "another thing" in said


@pytest.mark.parametrize(
    ("share", "said"), [(0.12, "12 % of"), (0.001, "The remaining error depends on: heading")]
)
def test_a_share_of_nothing_is_not_said_to_be_left(share: float, said: str) -> None:
    assert said in terminal_report(replace(FOUND, unexplained=Unexplained(share, ("heading",))))


def test_the_terminal_says_cause_number_evidence_refusals_and_what_to_do() -> None:
    text = terminal_report(FOUND)
    for part in (
        "K_E (volts per speed) of the left motor is 4.1 % lower", "0.9590 +- 0.0040",
        "4.20 times the noise without it, 1.10 with it",
        "1. One of these, which cannot be told apart here: motor.back_emf_constant@left or bemf.scale@left.",
        "If it is motor.back_emf_constant@left, the K_E (volts",
        "0.99 that it is motor.back_emf_constant@left and",
        "12 % of the error's power remains; it depends on: heading",
        "Sensor: motor.1.current shows", "imu.gyro_scale: not identifiable: imu.gyro.z is missing",
        "To learn more: ten counted full turns.", "0.120 +- 0.010 ohm", "Note: a note.",
    ):  # fmt: skip
        assert part in text


def test_before_the_causes_of_another_robot_it_is_asked_whose_the_recording_is() -> None:
    """They began with "calibrate the motors", and the question was the last note."""
    far = [
        replace(CAUSE, id=name, where=None, parameters={"factor": ParameterResult(factor, 0.01, "", 1.0)})
        for name, factor in (("motor.back_emf_constant", 0.667), ("drive.track_width", 1.376))
    ]
    note = f"motor.back_emf_constant is off by -33 %: {ROBOT_TOML_QUESTION}"
    other = replace(FOUND, causes=tuple(far), notes=(note,))
    asked = (
        "Is this recording of the robot of robot.toml "
        "(motor.back_emf_constant -33 %, drive.track_width +38 %)? If not"
    )
    text = terminal_report(other)
    assert text.startswith(asked)
    assert note not in text
    page = render_page(other, "run")
    assert page.index(asked) < page.index("Causes, and")
    own = replace(other, causes=tuple(far[:1]))
    assert note in terminal_report(own)
    assert asked not in terminal_report(own)


def test_the_page_says_the_same_with_pictures_and_without_markup_from_names(tmp_path: Path) -> None:
    save_html(FOUND, tmp_path / "out.html", "run <1>")
    text = (tmp_path / "out.html").read_text()
    assert text.count("data:image/png;base64,") == 4
    assert "run &lt;1&gt;" in text
    assert "shows &lt;no&gt; current" in text
    for part in (
        "The K_E (volts per speed) of the left motor is 4.1 % lower than assumed.",
        "<b>To do:</b> If it is K_E (left): calibrate the left motor (raccoon calibrate drive, ",
        "Error of the gyro&#39;s reading varies by 0.02", "it depends on heading",
        "lower than assumed; or it is scale of the back-EMF (left).", "cannot tell it from bemf.scale@left",
        "What was considered and not named",
        "explains none of the remaining error",
        "What this recording cannot show", "ten counted full turns", "a note",
    ):  # fmt: skip
        assert part in text


@pytest.mark.usefixtures("words_only")
def test_a_first_cause_that_others_can_stand_in_for_is_said_to_be_one() -> None:
    lag, other = replace(CAUSE, gain=Gain(1.11, 1.1, 0.01)), replace(CAUSE, where="right", rank=2)
    said = "without it, the other causes would compensate for it"
    for report in (terminal_report, lambda found: render_page(found, "run")):
        assert said in report(replace(FOUND, causes=(lag, other)))
        assert said not in report(replace(FOUND, causes=(lag,)))
        assert said not in report(replace(FOUND, causes=(CAUSE, replace(other, gain=lag.gain))))
        small = replace(CAUSE, gain=Gain(2.1, 1.0, 0.04))  # of much that could be gained a little, and missed
        assert said not in report(replace(FOUND, causes=(small, other)))


@pytest.mark.usefixtures("words_only")
def test_of_a_cause_that_the_reference_shows_it_is_said_that_the_errors_do_not() -> None:
    radius = replace(CAUSE, id="drive.wheel_radius", gain=Gain(0.91, 0.9, 0.01))
    seen = {
        "left wheel's radius by the reference": ParameterResult(1.03, 0.005, "times robot.toml's", math.nan)
    }
    said = "the reference of the pose shows it (see"
    for report in (terminal_report, lambda found: render_page(found, "run")):
        assert said in report(replace(FOUND, causes=(radius,), identified=seen))
        assert said not in report(replace(FOUND, causes=(radius,)))
        assert said not in report(replace(FOUND, causes=(CAUSE,), identified=seen))


@pytest.mark.parametrize(
    ("id_", "name", "value", "little"),
    [
        ("actuation.latency", "seconds", 0.0026, True),
        ("actuation.latency", "seconds", 0.0031, False),
        ("imu.latency", "seconds", 0.0005, True),
        ("drive.wheel_slip", "time", 0.0016, True),
        ("bemf.filter_lag", "time_constant", 0.0016, False),  # of a filter it is what is left that matters
        ("actuation.deadband", "duty", 0.0018, True),
        ("actuation.deadband", "duty", 0.0026, False),
    ],
)
def test_a_lag_of_less_than_half_a_cycle_or_a_deadband_of_less_than_a_step_of_duty_does_not_matter(
    id_: str, name: str, value: float, little: bool
) -> None:
    """When in its cycle a controller reads made latencies of 2.6 ms of sound robots, and when in a pause a
    wheel breaks loose deadbands of 0.0018."""
    lag = replace(CAUSE, id=id_, where=None, parameters={name: ParameterResult(value, 1e-4, "s", 0.0)})
    assert replace(lag, change=1.6, unabsorbed=0.2).is_negligible is little
    text = terminal_report(replace(FOUND, causes=(replace(lag, change=1.6, unabsorbed=0.2),)))
    why = "less than half a cycle" if name != "duty" else "less than a step of the PWM"
    assert (f"too small to matter, {why}" in text) is little


@pytest.mark.parametrize(("value", "little"), [(0.001, False), (0.029, True), (0.034, False)])
def test_a_lag_matters_by_what_it_is_off_from_a_model_to_start_from(value: float, little: bool) -> None:
    """A simulation whose commands are 29 ms late, as the robot's are no more, does not fit."""
    number = ParameterResult(value, 1e-4, "s", 0.03)
    lag = replace(CAUSE, id="actuation.latency", where=None, parameters={"seconds": number}, change=1.6)
    assert lag.is_negligible is little


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize(("change", "said"), [(0.04, True), (0.06, False), (np.nan, False)])
def test_a_cause_that_does_not_matter_is_said_not_to(change: float, said: bool) -> None:
    small = replace(CAUSE, change=change, unabsorbed=0.6 * change)
    assert small.is_negligible is said
    found = replace(
        FOUND, verdict=Verdict.ADEQUATE if said else Verdict.EXPLAINED, causes=(small,), sensor_faults=()
    )
    text, shown = terminal_report(found), render_page(found, "run")
    assert ("real, but too small to matter" in text) is ("real, but too small to matter" in shown) is said
    headline = shown.partition('class="big">')[2].partition("<")[0]
    assert headline.startswith("The simulation fits" if said else "The K_E (volts per speed) of")
    assert ("<b>To do" in shown) is not said  # nobody at the table has time for it
    sizes = (
        "hanges the most affected reading by 0.04 times its noise, and all readings by 0.024 times "
        "the noise beyond what the tolerances in robot.toml explain"
    )
    assert (sizes in text) is (sizes in shown) is said
    was_driven = bool(np.isfinite(change))  # without a recorded drive nothing is said
    assert ("hanges the most affected" in text) is was_driven


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize("reason", ["not identifiable: it turned left only: turn right", ""])
def test_a_page_that_cannot_tell_says_at_its_head_why(reason: str) -> None:
    """It stood among the notes, below all tables."""
    rejected = (Rejected("drive.track_width", reason),) if reason else ()
    none = replace(FOUND, verdict=Verdict.NOT_IDENTIFIABLE, causes=(), sensor_faults=(), rejected=rejected)
    head = render_page(none, "run").partition("<h2")[0]
    assert ("It turned left only: turn right.</span>" if reason else "A note.</span>") in head


@pytest.mark.usefixtures("words_only")
def test_the_headline_says_what_else_it_may_be() -> None:
    two = replace(CAUSE, confounded_with=("bemf.scale@left", "drive.wheel_radius@left"))
    text = render_page(replace(FOUND, causes=(two,)), "run")
    assert "; or it is scale of the back-EMF (left) or wheel radius (left)." in text
    assert "<b>To do:</b> If it is K_E (left): calibrate the left motor" in text
    assert '<a href="#next">below</a>.</p>' in text
    assert '<h2 id="next">Record this' in text
    known = replace(FOUND, causes=(replace(CAUSE, confounded_with=()),), unexplained=Unexplained(0.0))
    alone = render_page(known, "run")
    assert "; or it is" not in alone
    assert "acts as well" not in alone
    beside = render_page(replace(known, unexplained=Unexplained(0.2, ("wheel angle left",))), "run")
    assert "acts as well: it depends on the angle of the left wheel.</p>" in beside.partition("<h2")[0]
    assert "<b>To do:</b> Calibrate the left motor" in alone


@pytest.mark.usefixtures("words_only")
def test_a_lag_that_another_may_have_a_part_of_is_not_said_to_be_alone() -> None:
    part = replace(CAUSE, beside=("bemf.scale@left",))
    text, shown = (report(replace(FOUND, causes=(part,))) for report in (terminal_report, _page))
    assert "0.99 that it is motor.back_emf_constant@left, alone or with bemf.scale@left beside it\n" in text
    assert "One of these or some of each, which" in text
    assert "; a part of it may be scale of the back-EMF (left)." in shown
    assert "; or it is" not in shown
    both = replace(part, confounded_with=(*CAUSE.confounded_with, "drive.wheel_radius@left"))
    text, shown = (report(replace(FOUND, causes=(both,))) for report in (terminal_report, _page))
    assert "alone or with bemf.scale@left beside it, and none of the others\n" in text
    assert "; or it is wheel radius (left); a part of it may be scale of the back-EMF (left)." in shown
    assert "none of the others" not in terminal_report(replace(FOUND, causes=(part,)))


def test_the_page_has_every_key_of_the_json() -> None:
    told = (Path(__file__).parents[4] / "docs" / "diagnosis.md").read_text("utf-8")
    table = told.partition("| key | holds |")[2].partition("\n\n")[0]
    named = set(re.findall(r"`(\w+)`", table))
    by_name = FOUND.to_dict() | {"identified": None}

    def keys(value: object) -> set[str]:
        if isinstance(value, dict):
            return set(value) | set().union(*map(keys, value.values()))
        return set().union(*map(keys, value)) if isinstance(value, list) else set()

    assert keys(by_name) - {"factor"} <= named


def _page(found: Diagnosis) -> str:
    return render_page(found, "run")


def test_on_a_phone_a_number_keeps_its_deviation_and_a_reason_stands_under_its_causes(
    words_only: None,
) -> None:
    shown = render_page(FOUND, "run")
    assert "0.9590&nbsp;&plusmn;&nbsp;0.0040" in shown
    assert len(re.findall(r'<table class="pairs">\s*<tr><td><code>', shown)) == 2
    assert (
        ".pairs td { display:block;"
        in shown.partition("@media (max-width: 40rem)")[2].partition("</style>")[0]
    )


@pytest.mark.usefixtures("words_only")
def test_a_page_without_causes_still_has_a_headline_and_says_it_once() -> None:
    empty = make_diagnosis()
    text = render_page(empty, "run")
    shown, _, as_text = text.partition("<pre")
    assert shown.count("nothing that matters is wrong") == 1
    assert "nothing that matters is wrong" in as_text
    assert "data:image" not in text
    assert "The simulation is wrong; these causes explain a part of the error." in render_page(FOUND, "run")


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize("errors", [(1.29, 1.30), (0.85, 0.85), (1.0, 0.999)])
def test_data_that_does_not_show_a_cause_is_said_not_to(errors: tuple[float, float]) -> None:
    cause = replace(CAUSE, gain=Gain(*errors, 0.0))
    for text in (
        terminal_report(replace(FOUND, causes=(cause,))),
        render_page(replace(FOUND, causes=(cause,)), "run"),
    ):
        shown = text.partition("<pre")[0]
        assert "are predicted as well: confirm it in a second" in shown
        assert "times the noise without it" not in shown
    small = replace(cause, change=0.04)
    assert "held-out data" not in terminal_report(replace(FOUND, causes=(small,)))
    assert "without it, 93 % of the possible improvement is lost" in render_page(FOUND, "run")


def test_a_cause_without_rivals_is_not_one_of_several() -> None:
    text = terminal_report(replace(FOUND, causes=(replace(CAUSE, confounded_with=()),)))
    assert "1. The K_E (volts per speed) of the left motor" in text
    assert "One of these" not in text
    assert "probability 0.99\n" in text


def test_what_robot_toml_could_do_as_well_is_said_so() -> None:
    cause = replace(CAUSE, change=3.3, unabsorbed=0.005)
    text = terminal_report(replace(FOUND, causes=(cause,)))
    assert "3.3 times its noise; the tolerances in robot.toml could explain nearly all of that" in text


def test_a_large_change_is_no_power_of_ten() -> None:
    text = terminal_report(replace(FOUND, causes=(replace(CAUSE, change=440.0, unabsorbed=178.0),)))
    assert "by 440 times its noise, and all readings by 178 times" in text


def test_a_finding_is_a_note_and_no_advice() -> None:
    found = replace(FOUND, suggested_manoeuvres=("the commands never change: drive", "ten turns"))
    text = terminal_report(replace(found, notes=("the commands never change: drive",)))
    assert text.count("the commands never change") == 1
    assert "Note: the commands never change: drive." in text
    assert "To learn more: ten turns." in text


@pytest.mark.parametrize(("power", "said"), [(1e-9, False), (1e-3, False), (1.0, True)])
def test_a_size_of_a_thousand_and_more_is_said_of_nothing(power: float, said: bool) -> None:
    """They were not found any more once large numbers had all their digits."""
    size = format_detection_limit(
        Parameter("gain", "counts", 0.0, Bounds(), 10.0), power, 8.0
    )  # of a team's own effect
    rejected = (Rejected("team.hum", f"not visible in this recording; would show {size}"),)
    assert (size in terminal_report(replace(FOUND, rejected=rejected))) == said


@pytest.mark.usefixtures("words_only")
def test_what_is_wholly_unknown_comes_with_something_to_do() -> None:
    reason = "not visible in this recording: a usual deviation would not show"
    lost = replace(
        FOUND, verdict=Verdict.UNKNOWN, causes=(), unexplained=Unexplained(0.0), shapes=(),
        rejected=(Rejected("motor.heating", f"{reason}; would show from about 3.9e+19 % on"),
                  Rejected("drive.inertia", f"{reason}; would show from about 210 % on")),
    )  # fmt: skip
    for text in (terminal_report(lost), render_page(lost, "run")):
        assert "raccoon excite --record again.jsonl.gz" in text
        assert "ten counted full turns" not in text  # it would show a cause that nobody has named
        assert "would show from" not in text
    known = terminal_report(replace(lost, unexplained=Unexplained(0.3, ("heading",))))
    assert "ten counted full turns" in known
    assert "210 %" in known
    assert "e+19" not in known  # no robot is that far off


def number(value: float, nominal: float = 0.0, std: float = 0.001) -> ParameterResult:
    return ParameterResult(value, std, "", nominal)


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize(
    ("id_", "values", "what", "todo"),
    [
        ("battery.open_circuit_voltage", [7.3, 6.8], "more than the 6.80 V", "Put open_circuit_"),
        ("battery.open_circuit_voltage", [6.3, 6.8], "only 6.30 V", "Charge it, or put"),
        ("battery.internal_resistance", [0.001, 0.05], "sags less than assumed", "Put internal_"),
        ("battery.internal_resistance", [0.12, 0.05], "sags more", "Take a fresh battery"),
        ("motor.armature_resistance", [1.2, 1.0], "20.0 % higher", "Look for worn brushes"),
        ("motor.armature_resistance", [0.8, 1.0], "20.0 % lower", "Calibrate the left motor (raccoon"),
        ("friction.coulomb", [0.099, 0.18], "only 0.099 N m instead of 0.180", "Keep it in a model.toml"),
        ("friction.coulomb", [0.23, 0.18], "0.230 N m instead of 0.180", "Check axles"),
        ("friction.viscous", [0.002, 0.004], "is only 0.0020", "Keep it in a model.toml"),
        ("friction.viscous", [0.008, 0.004], "is 0.0080", "Check bearings"),
        ("bemf.offset", [-7.0, 2.0], "-7 counts at standstill, not +2", "Calibrate its offset (raccoon"),
        ("bemf.filter_lag", [0.03, 0.0225], "30 ms instead of 22.5 ms", "Keep it in a model.toml"),
    ],
)  # fmt: skip
def test_a_sentence_and_its_advice_fit_both_signs(
    id_: str, values: list[float], what: str, todo: str
) -> None:
    assert_told(id_, {"number": number(*values)}, what, todo)


def test_a_number_that_robot_toml_has_once_is_put_there_where_it_is_that_of_both_sides() -> None:
    """Put there for one wheel, the friction of the other one was the next cause."""
    for id_, value, nominal, key in (
        ("friction.coulomb", 0.1, 0.18, "coulomb = 0.1"),
        ("bemf.filter_lag", 0.03, 0.0225, "filter_time_constant = 0.03"),
    ):
        both, left = (
            explanation_sentence(id_, where, {"number": number(value, nominal)}) for where in (None, "left")
        )
        assert both.endswith(f": put {key} into [model.{id_.partition('.')[0]}] of robot.toml.")
        assert key not in left
        assert left.endswith("(--save-model), since robot.toml has one number for both wheels.")


def assert_told(id_: str, numbers: dict[str, ParameterResult], what: str, todo: str) -> None:
    """Text and page say both; the page apart from each other."""
    where = None if id_.startswith(("battery", "drive")) else "left"
    cause = replace(
        CAUSE, id=id_, where=where, parameters=numbers, explanation=explanation_sentence(id_, where, numbers),
        confounded_with=(),
    )  # fmt: skip
    assert what in describe_cause(cause).what
    html = render_page(replace(FOUND, causes=(cause,), channels=(), curves=(), shapes=()), "run")
    assert f"<b>To do:</b> {todo}" in html
    assert what in html.partition("<h2>")[0]  # the headline
    assert describe_cause(cause).todo not in html.partition("<h2>")[0]


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize(
    ("along_x", "along_y", "way"),
    [
        (-0.00002, 0.039, "pulls to the left with 0.039 N m"),
        (0.001, -0.039, "pulls to the right with 0.039 N m"),
        (0.039, 0.0, "pulls forward with"),
        (-0.039, 0.001, "pulls back with"),
        (-0.03, -0.03, "pulls back and to the right with 0.042 N m"),
    ],
)
def test_a_slope_has_a_size_and_a_direction(along_x: float, along_y: float, way: str) -> None:
    assert_told(
        "drive.slope", {"along_x": number(along_x), "along_y": number(along_y)}, way, "Level the table"
    )


@pytest.mark.usefixtures("words_only")
@pytest.mark.parametrize(
    ("dry", "viscous", "what", "todo"),
    [
        (0.0002, 0.6, "wheel speed-dependent friction is 60 % above its mean for", "rubs when it turns for"),
        (-0.2, 0.0, "wheel dry friction is 20 % above its mean backwards and", "rubs when it turns back"),
        (0.2, 0.3, "dry friction is 20 % above its mean forwards", "rubs when it turns forwards"),
        (0.2, -0.3, "30 % above its mean backwards", "rubs in one direction only"),
    ],
)  # fmt: skip
def test_friction_by_direction_names_the_kind_and_the_way(
    dry: float, viscous: float, what: str, todo: str
) -> None:
    numbers = {"asymmetry": number(dry), "viscous_asymmetry": number(viscous)}
    assert_told("friction.direction_dependent", numbers, what, "Look for something that " + todo)


def test_every_cause_of_a_drive_has_a_sentence_and_an_action() -> None:
    for each in drive_causes():
        numbers = {one.name: number(0.1) for one in each.effect.parameters}
        cause = replace(
            CAUSE, id=each.id, where=each.where, parameters=numbers,
            explanation=explanation_sentence(each.id, each.where, numbers),
        )  # fmt: skip
        said = describe_cause(cause)
        assert str(said) == cause.explanation
        assert said.todo
        assert not {"{", "}", ": "} & set(said.what), said.what
        assert ": " not in said.what + said.todo


@pytest.mark.usefixtures("words_only")
def test_a_sentence_of_another_kind_of_recording_stays_whole() -> None:
    own = replace(CAUSE, explanation="Dry friction of 0.3 V brakes the axis: a worn screw.")
    assert describe_cause(own).what == "Dry friction of 0.3 V brakes the axis: a worn screw"
    assert describe_cause(own).todo == ""
    lag = replace(CAUSE, explanation=f"{CAUSE.explanation} With imu.latency beside it this is the sum.")
    assert describe_cause(lag).what.endswith("lower than assumed")
    assert describe_cause(lag).more == "With imu.latency beside it this is the sum."
    html = render_page(replace(FOUND, causes=(lag,), channels=(), curves=(), shapes=()), "run")
    assert "lower than assumed; or it is scale of the back-EMF (left)." in html
    assert "lower than assumed. With imu.latency beside it this is the sum." in html
    assert (
        describe_cause(lag).todo == "calibrate the left motor (raccoon calibrate drive, raccoon tune wheels)"
    )


@pytest.mark.usefixtures("words_only")
def test_every_picture_of_a_page_can_be_moved_on_a_narrow_screen() -> None:
    """Scaled to the width of a phone, their letters were four pixels high."""
    text = render_page(FOUND, "run")
    assert text.count('<div class="picture"><img') == text.count("<img") > 0
