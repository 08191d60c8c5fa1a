from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import diagnoses
from raccoon.diagnose.fleet.series import _are_outliers, _median_std
from raccoon.diagnose.fleet.summary import FleetCause, FleetNumber, fleet_of
from raccoon.diagnose.reports import html_fleet
from raccoon.diagnose.reports.fleet_text import fleet_report
from raccoon.diagnose.reports.html_fleet import save_fleet_html
from raccoon.diagnose.result import (
    CauseResult,
    Diagnosis,
    ParameterResult,
    Rejected,
    SensorFault,
    Verdict,
)
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.provenance import Origin

JUDGED = tuple(
    Rejected(each, "explains none of the remaining error")
    for each in ("battery.discharge", "motor.heating", "friction.viscous", "drive.inertia", "bemf.offset")
)


def cause(name: str, value: float, unit: str = "ohm", said: str = "It sags: charge it.") -> CauseResult:
    numbers = {"resistance": ParameterResult(value, 0.004, unit, 0.05)}
    return diagnoses.make_cause(name, numbers, said, probability=0.99, change=math.nan)


def diagnosis(*causes: CauseResult, back_emf: float = 1.08, broken: bool = False) -> Diagnosis:
    return diagnoses.make_diagnosis(
        *causes,
        rejected=JUDGED,
        identified={"motor.0.back_emf": ParameterResult(back_emf, 0.003, "V s/rad", float("nan"))},
        sensor_faults=(SensorFault("motor.1.current", "dead", "it is dead"),) if broken else (),
    )


def jumps(each: FleetCause | FleetNumber) -> list[int]:
    """The first recording after each jump of a number that is steady between them."""
    (course,) = each.series.courses
    assert not any(piece.creeps for piece in course.pieces)
    return [piece.first for piece in course.pieces[1:]]


@pytest.fixture
def weeks() -> dict[str, Diagnosis]:
    """Ten weeks of one robot: a battery that ages, a motor replaced before week 6, a slope once."""
    rng = np.random.default_rng(1)
    found = {}
    for week in range(10):
        causes = [cause("battery.internal_resistance", 0.06 + 0.012 * week + 0.002 * rng.standard_normal())]
        if week == 3:
            causes.append(cause("drive.slope", 0.02))
        motor = (1.02 if week >= 6 else 1.08) + 0.003 * rng.standard_normal()
        found[f"week-{week}.csv"] = diagnosis(*causes, back_emf=motor, broken=week == 8)
    return found


def test_a_recording_that_cannot_tell_speaks_neither_for_a_cause_nor_against_it() -> None:
    battery = cause("battery.internal_resistance", 0.1)
    silent = replace(diagnosis(), verdict=Verdict.NOT_IDENTIFIABLE)
    weeks = {f"{week}.csv": diagnosis(battery) if week < 7 else silent for week in range(14)}
    (found,) = fleet_of(weeks).causes
    assert found.share == 1.0
    assert found.series.courses == ()


def test_what_creeps_what_jumps_and_what_was_once(weeks: dict[str, Diagnosis]) -> None:
    fleet = fleet_of(weeks)
    causes = {each.name: each for each in fleet.causes}
    battery = causes["battery.internal_resistance"]
    assert battery.common
    ((aged,),) = (each.pieces for each in battery.series.courses)
    assert aged.creeps
    assert aged.end == pytest.approx(0.168, abs=0.01)
    assert causes["drive.slope"].recordings == ("week-3.csv",)
    assert not causes["drive.slope"].common
    (motor,) = fleet.numbers
    assert jumps(motor) == [6]
    text = fleet_report(fleet)
    assert "Battery resistance in ohm creeps from 0.06" in text
    assert "motor.0.back_emf in V s/rad jumps from 1.08" in text
    assert "with week-6.csv" in text
    assert "motor.1.current: dead" in text


def test_what_went_back_to_normal_is_not_common() -> None:
    """Seven of ten days had it, and the head said so of a robot that was repaired."""
    days = {
        f"{day}.csv": diagnosis(cause("battery.internal_resistance", 0.16 + 1e-4 * day))
        if day < 7
        else diagnosis()
        for day in range(10)
    }
    fleet = fleet_of(days)
    (battery,) = fleet.causes
    assert (jumps(battery), battery.common) == ([7], False)
    assert "70 % (until 6.csv)" in fleet_report(fleet)
    later = {name: each for name, each in days.items() if name != "9.csv"} | {"9.csv": days["0.csv"]}
    assert fleet_of(later).causes[0].common


def test_a_cause_is_of_the_recordings_since_its_part_was_replaced() -> None:
    """Of eight weeks three had a new motor that is strong, and the head said it of all, with what the old one
    was to be done about; of three weeks with a new bad one all were named."""
    weak, strong = (
        cause("motor.back_emf_constant@left", each, said=f"It is {each}.") for each in (0.94, 1.06)
    )
    before = {f"{week}.csv": diagnosis(weak) for week in range(5)}
    other = {f"{week}.csv": diagnosis(strong) for week in range(5, 8)}
    (found,) = fleet_of(before | other).causes
    assert found.common
    text = fleet_report(fleet_of(before | other))
    assert "(common), 0.94 to 1.06" in text
    assert "6.csv: It is 1.06." in text
    assert "It is 0.94." not in text
    (found,) = fleet_of({name: diagnosis() for name in before} | other).causes
    assert not found.common
    assert (found.standing.since, found.standing.until) == ("5.csv", "")
    sound = {f"{week}.csv": diagnosis(*[strong] * (week == 6)) for week in range(5, 10)}
    assert "(mostly until 4.csv)" in fleet_report(fleet_of(before | sound))


def test_what_differs_from_run_to_run_either_way_is_no_robots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A battery that was charged now more and now less than assumed was common, with what to write into
    robot.toml for all."""
    monkeypatch.setattr(html_fleet, "figure_to_base64_png", lambda _: "AAAA")
    volts = (6.4, 7.5, 6.8, 6.5, 7.6, 6.3, 7.7, 7.2)
    name = "battery.open_circuit_voltage"
    charged = {
        f"run{run}": diagnosis(
            *[
                diagnoses.make_cause(
                    name, {"voltage": ParameterResult(each, 0.02, "V", 6.8)}, f"It is {each} V."
                )
            ]
            * (each != 6.8)
        )
        for run, each in enumerate(volts)
    }
    fleet = fleet_of(charged)
    (found,) = fleet.causes
    assert (found.share, found.common) == (0.875, False)
    text = fleet_report(fleet)
    assert "88 % (lower than assumed in 3, higher in 4; another charge each time?), 6.3 to 7.7 V" in text
    assert "run0: It is 6.4 V.\n  run1: It is 7.5 V." in text
    save_fleet_html(fleet, tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert (
        "No cause is common to most recordings. Battery voltage: lower than assumed in 3, higher in 4."
        in page
    )


def test_a_number_that_is_not_named_is_as_it_was_refitted() -> None:
    """A motor of 0.94 that was replaced by one of 1.02 jumped to 1, what robot.toml says of it."""
    key = ("motor.back_emf_constant", "left")
    model = Parameters().with_effect(*key, factor=1.02)
    model = model.with_origin(*key, Origin({"factor": 0.004}, "refitted"))
    weak = diagnoses.make_cause("motor.back_emf_constant@left", diagnoses.factor_parameters(0.94, 0.004))
    found = {
        f"run{run}": diagnosis(weak) if run < 4 else replace(diagnosis(), model=model) for run in range(8)
    }
    (motor,) = fleet_of(found).causes
    assert jumps(motor) == [4]
    assert motor.series.courses[0].pieces[1].start == pytest.approx(1.02)
    assert not motor.common


def test_one_robot_of_many_is_far_from_the_others() -> None:
    fleet = {f"robot-{i}.csv": diagnosis(back_emf=1.08 + 0.002 * (i % 3) - 0.15 * (i == 4)) for i in range(8)}
    (motor,) = fleet_of(fleet).numbers
    assert motor.series.outliers == ("robot-4.csv",)
    assert motor.series.courses == ()


@pytest.mark.parametrize(("count", "odd"), [(3, ()), (4, ("run1",))])
def test_of_three_recordings_none_is_far_from_the_others(count: int, odd: tuple[str, ...]) -> None:
    """Of three numbers that scatter two are often much nearer to each other: one of four such was odd."""
    name, values = "battery.internal_resistance", (0.12, 0.19, 0.122, 0.121)[:count]
    fleet = {f"run{i}": diagnosis(cause(name, value)) for i, value in enumerate(values)}
    (found,) = fleet_of(fleet).causes
    assert found.series.outliers == odd


def test_numbers_in_other_units_count_and_are_not_compared() -> None:
    fleet = {str(i): diagnosis(cause("friction.coulomb@left", 0.008, "N m")) for i in range(4)}
    fleet["volts"] = diagnosis(cause("friction.coulomb@left", 0.3, "V"))
    (friction,) = fleet_of(fleet).causes
    assert friction.share == 1.0
    assert friction.unit == "N m"
    assert max(friction.values) < 0.01


def test_the_page_counts_what_the_terminal_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that names it in volts was left out of the page's count: 21 of 22 beside `common to 22 of 22`."""
    monkeypatch.setattr(html_fleet, "figure_to_base64_png", lambda _: "AAAA")
    named = diagnosis(cause("friction.coulomb@left", 0.008, "N m"))
    fleet = {str(i): diagnosis() if i % 2 else named for i in range(9)}
    fleet |= {"2": diagnosis(cause("friction.coulomb@left", 0.3, "V")), "none": diagnosis()}
    save_fleet_html(fleet_of(fleet), tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert ">5 of 10<" in page
    assert "Dry friction (left): 5 of 10 recordings." in page


def test_the_headline_says_of_two_of_four_which(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was "Dry friction (left): some: wed, thu"."""
    monkeypatch.setattr(html_fleet, "figure_to_base64_png", lambda _: "AAAA")
    named = diagnosis(cause("friction.coulomb@left", 0.008, "N m"))
    fleet = {"mon": diagnosis(), "tue": diagnosis(), "wed": named, "thu": named}
    save_fleet_html(fleet_of(fleet), tmp_path / "fleet.html")
    assert "Dry friction (left): wed, thu." in (tmp_path / "fleet.html").read_text()


def test_the_page_and_the_table_hold_it_all(weeks: dict[str, Diagnosis], tmp_path: Path) -> None:
    save_fleet_html(fleet_of(weeks), tmp_path / "fleet.html", {"bad.csv": "it is <empty>"})
    page = (tmp_path / "fleet.html").read_text()
    assert "data:image/png;base64," in page
    assert "it is &lt;empty&gt;" in page
    assert "1 without a diagnosis." in page
    assert "creeps from" in page
    table = json.loads(json.dumps(fleet_of(weeks).to_dict()))
    assert set(table) == {"recordings", "robots", "causes", "numbers"}
    assert table["robots"] == {"": list(weeks)}
    ((piece,),) = (each["pieces"] for each in table["causes"][0]["courses"])
    assert (piece["first"], piece["last"]) == ("week-0.csv", "week-9.csv")
    assert piece["start"] < piece["end"]


def test_a_column_of_the_page_in_which_nothing_stands_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(html_fleet, "figure_to_base64_png", lambda _: "AAAA")
    fleet = {f"run{i}": diagnosis(cause("bemf.scale", 1.06)) for i in range(4)}
    columns = ("far from the others", "not distinguishable from", "sensors")
    for found, there in ((fleet, ()), (fleet | {"run4": diagnosis(broken=True)}, ("sensors",))):
        save_fleet_html(fleet_of(found), tmp_path / "fleet.html")
        page = (tmp_path / "fleet.html").read_text()
        assert [each for each in columns if f"<th>{each}</th>" in page] == list(there)
        assert '<td class="number">1.06 ohm</td>' in page


def test_the_fewer_before_a_change_are_not_odd_ones_out() -> None:
    values = [1.001, 1.003, 1.002, 1.064, 1.060, 1.062, 1.061, 1.063]
    fleet = {f"run{i}": diagnosis(cause("bemf.scale", each), back_emf=each) for i, each in enumerate(values)}
    found = fleet_of(fleet)
    assert [jumps(each) for each, _ in found.courses] == [[3], [3]]
    assert not any(each.series.outliers for each, _ in found.courses)
    fleet["run1"] = diagnosis(cause("bemf.scale", 1.3), back_emf=1.003)
    assert "run1" in fleet_of(fleet).causes[0].series.outliers


def test_one_that_does_not_creep_with_the_others_is_far_from_them() -> None:
    values = [0.06 + 0.02 * week for week in range(12)]
    values[4] += 0.05
    fleet = {
        f"week{i}": diagnosis(cause("battery.internal_resistance", each)) for i, each in enumerate(values)
    }
    (battery,) = fleet_of(fleet).causes
    ((aged,),) = (each.pieces for each in battery.series.courses)
    assert aged.creeps
    assert battery.series.outliers == ("week4",)


def test_what_is_not_known_well_is_not_far_from_the_others() -> None:
    """Four deviations, of the others' spread and its own in squares; one that says none has none."""
    assert _are_outliers([0.39, 0.41, 0.41, -0.56, -0.57], 0.1, np.array([0.0, math.nan, 0.1, 0.1, 0.1])) == [
        False, True, False, False, True,
    ]  # fmt: skip


def test_a_robots_middle_is_as_sure_as_its_recordings_say_or_scatter() -> None:
    def of(values: list[float], std: float) -> float:
        return _median_std([ParameterResult(each, std, "", 1.0) for each in values])

    assert of([1.0], 0.1) == pytest.approx(0.1)
    assert of([1.0, 1.1], 0.1) == pytest.approx(0.1 / math.sqrt(2.0))
    assert of([1.0, 1.4], 0.1) == pytest.approx(0.2)  # deviation of two numbers 0.4 / sqrt 2, of their mean
    assert of([1.0, 1.4], math.nan) == pytest.approx(0.2)


def test_equal_numbers_have_the_deviation_of_one() -> None:
    fleet = {str(i): diagnosis(back_emf=1.08) for i in range(5)}
    (motor,) = fleet_of(fleet).numbers
    assert motor.series.spread == 0.003
    assert "1.08 +- 0.003" in fleet_report(fleet_of(fleet))


def test_a_jump_is_seen_beside_one_odd_recording() -> None:
    """A motor that was replaced, and a run with something else wrong that hides it: nearly 30 spreads off."""
    rng = np.random.default_rng(7)
    values = 1.0 + 0.04 * (np.arange(10) >= 6) + 0.002 * rng.standard_normal(10)
    values[2] -= 0.06
    fleet = {f"run{i}": diagnosis(back_emf=float(each)) for i, each in enumerate(values)}
    (motor,) = fleet_of(fleet).numbers
    assert jumps(motor) == [6]
    assert motor.series.courses[0].pieces[0].end == pytest.approx(1.0, abs=0.003)
    assert motor.series.outliers == ("run2",)


@pytest.mark.parametrize(
    "silent",
    [
        Rejected("battery.internal_resistance", "not identifiable: battery.voltage is missing"),
        Rejected("battery.*", "not identifiable: motor.0.duty is missing"),
        Rejected("battery.internal_resistance", "not visible in this recording: too slow"),
        replace(cause("drive.slope", 0.02), confounded_with=("battery.internal_resistance",)),
    ],
)
def test_a_recording_that_cannot_tell_does_not_speak_against_a_cause(silent: Rejected | CauseResult) -> None:
    """A battery that every recording shows which has its voltage is common, and did not come and go."""
    battery = cause("battery.internal_resistance", 0.12)
    other = replace(diagnosis(), rejected=(silent,)) if isinstance(silent, Rejected) else diagnosis(silent)
    fleet = {f"run{i}": other if i in (0, 1, 4, 5, 7) else diagnosis(battery) for i in range(8)}
    found = next(each for each in fleet_of(fleet).causes if each.name == "battery.internal_resistance")
    assert found.share == 1.0
    assert found.series.courses == ()


def test_what_only_one_side_cannot_tell_speaks_of_the_other() -> None:
    reason = "not identifiable at the left: motor.0.bemf is missing; at the right: it is as assumed"
    half = replace(diagnosis(), rejected=(Rejected("bemf.scale", reason),))
    (found,) = fleet_of({"one": diagnosis(cause("bemf.scale@right", 1.05)), "two": half}).causes
    assert found.share == 0.5
    (found,) = fleet_of({"one": diagnosis(cause("bemf.scale@left", 1.05)), "two": half}).causes
    assert found.share == 1.0


def test_what_most_recordings_do_not_tell_a_cause_from_is_said_with_it(tmp_path: Path) -> None:
    """A left motor that is 6 % weak, named in three runs as a right one that is strong, or the left."""
    named = cause("motor.back_emf_constant@right", 1.06, "")
    unsure = replace(named, confounded_with=("motor.back_emf_constant@left", "drive.track_width"))
    other = replace(named, confounded_with=("motor.back_emf_constant@left",))
    fleet = {f"run{i}": diagnosis() for i in range(5)}
    fleet |= {"run5": diagnosis(unsure), "run6": diagnosis(other), "run7": diagnosis(named)}
    (found,) = fleet_of(fleet).causes
    assert found.rivals == ("motor.back_emf_constant@left",)
    text = fleet_report(fleet_of(fleet))
    assert "1.06; not distinguishable from K_E (left)" in text
    assert "K_E (right) (or K_E (left)) jumps from 0.05 to 1.06 with run5" in text
    save_fleet_html(fleet_of(fleet), tmp_path / "fleet.html")
    assert "<td>K_E (left)</td>" in (tmp_path / "fleet.html").read_text()


def of_robots(**numbers: list[float]) -> tuple[dict[str, Diagnosis], dict[str, str]]:
    """A week's drives of each robot and whose they are. numbers: K_E of each; below 1.05 it is named."""
    found, robots = {}, {}
    for robot, values in numbers.items():
        for day, value in enumerate(values):
            weak = [cause("motor.back_emf_constant@left", value, "")] if value < 1.05 else []
            found[f"{robot}/day{day}.csv"] = diagnosis(*weak, back_emf=value)
            robots[f"{robot}/day{day}.csv"] = robot
    return found, robots


def test_another_robot_is_no_motor_that_was_replaced() -> None:
    """Of five drives of one robot and then five of another K_E was said to jump with the sixth."""
    spread = 0.002 * np.random.default_rng(2).standard_normal((2, 5))
    fleet = fleet_of(*of_robots(red=[*(1.08 + spread[0])], blue=[*(1.02 + spread[1])]))
    (motor,) = fleet.numbers
    assert motor.series.courses == ()
    assert motor.series.outliers == ()
    assert motor.series.spread < 0.005
    assert motor.series.levels == pytest.approx({"red": 1.08, "blue": 1.02}, abs=0.004)
    (weak,) = fleet.causes
    assert (weak.robots, weak.of_robots, weak.common) == (("blue",), 2, False)
    text = fleet_report(fleet)
    assert "K_E (left) [motor.back_emf_constant@left]: 50 % (only robot blue), 1.0" in text
    assert re.search(r"motor\.0\.back_emf +1\.0[12]\d* to 1\.0[78]\d* \+- 0\.00", text)


def test_a_motor_is_replaced_in_the_robot_that_has_it(tmp_path: Path) -> None:
    spread = 0.002 * np.random.default_rng(3).standard_normal((2, 6))
    blue = np.where(np.arange(6) < 3, 1.08, 1.02) + spread[1]
    fleet = fleet_of(*of_robots(red=[*(1.08 + spread[0])], blue=[*blue]))
    (motor,) = fleet.numbers
    assert [each.robot for each in motor.series.courses] == ["blue"]
    text = fleet_report(fleet)
    jump = r"  blue: motor\.0\.back_emf in V s/rad jumps from 1\.0[78]\d* to 1\.0[12]\d* with blue/day3\.csv"
    assert re.search(jump, text)
    assert "red: " not in text
    save_fleet_html(fleet, tmp_path / "fleet.html")
    assert "blue: motor.0.back_emf" in (tmp_path / "fleet.html").read_text()
    courses = fleet.to_dict()["numbers"][0]["courses"]
    assert [(each["robot"], each["pieces"][1]["first"]) for each in courses] == [("blue", "blue/day3.csv")]


def test_one_robot_of_several_is_far_from_the_other_robots() -> None:
    rng = np.random.default_rng(4)
    levels = {"a": 1.08, "b": 1.081, "c": 1.079, "d": 0.9, "e": 1.082}
    drives = {name: [*(each + 0.002 * rng.standard_normal(3))] for name, each in levels.items()}
    (motor,) = fleet_of(*of_robots(**drives)).numbers
    assert motor.series.outliers == ("robot d",)


def test_what_most_robots_have_is_common_however_many_recordings_each_has() -> None:
    fleet = fleet_of(*of_robots(red=[1.01] * 2, blue=[1.02] * 2, green=[1.08] * 9))
    (weak,) = fleet.causes
    assert weak.share < 0.4
    assert weak.common
    assert "(common to 2 of 3 robots)" in fleet_report(fleet)


def test_a_battery_that_aged_and_was_replaced_is_said_with_when() -> None:
    """It was neither a jump nor creeping, and nothing was said."""
    rng = np.random.default_rng(5)
    values = 0.06 + 0.014 * (np.arange(12) % 6) + 0.003 * rng.standard_normal(12)
    drives = [diagnosis(cause("battery.internal_resistance", float(each))) for each in values]
    text = fleet_report(fleet_of({f"w{week}": each for week, each in enumerate(drives)}))
    assert re.search(
        r"Battery resistance in ohm creeps from 0\.0[56]\d* to 0\.1[23]\d*, jumps to 0\.0[56]\d* "
        r"with w6 and creeps to 0\.1[23]\d* \(a battery ages; another battery, or its contacts\?\)",
        text,
    )


def test_a_recording_that_names_nothing_has_the_number_of_its_own_robot() -> None:
    """What robot.toml says of K_E differs between robots: that of the first was taken for all."""
    mine = cause("motor.back_emf_constant@left", 0.8, "")
    other = replace(mine, parameters={"factor": replace(mine.parameters["resistance"], nominal=0.9)})
    found = {f"red/{day}": diagnosis(mine) for day in range(6)}
    found |= {f"blue/{day}": diagnosis(other) if day > 2 else diagnosis() for day in range(6)}
    (weak,) = fleet_of(found, {name: name.split("/")[0] for name in found}).causes
    (course,) = weak.series.courses
    before, after = course.pieces
    assert course.robot == "blue"
    assert (before.end, after.start) == pytest.approx((0.9, 0.8))
