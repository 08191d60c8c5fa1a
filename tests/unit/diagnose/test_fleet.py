from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon.diagnose.fleet import common_causes, diagnose_all, fleet_dict, fleet_numbers
from raccoon.diagnose.fleet_changes import Form, change_of
from raccoon.diagnose.reports.fleet_text import fleet_report
from raccoon.diagnose.reports.html_fleet import save_fleet_html
from raccoon.diagnose.result import (
    CauseResult,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    SensorFault,
    Unexplained,
    Verdict,
)

JUDGED = tuple(
    Rejected(each, "explains nothing that is left")
    for each in ("battery.discharge", "motor.heating", "friction.viscous", "drive.inertia", "bemf.offset")
)


def cause(id_: str, value: float, where: str | None = None, unit: str = "ohm") -> CauseResult:
    numbers = {"resistance": ParameterResult(value, 0.004, unit, 0.05)}
    return CauseResult(id_, where, 1, numbers, Gain(3.0, 1.0, 0.8), 0.99, (), "It sags: charge it.")


def diagnosis(*causes: CauseResult, back_emf: float = 1.08, broken: bool = False) -> Diagnosis:
    return Diagnosis(
        Verdict.EXPLAINED if causes else Verdict.ADEQUATE,
        (),
        causes,
        JUDGED,
        Unexplained(0.0),
        (),
        0.1,
        identified={"motor.0.back_emf": ParameterResult(back_emf, 0.003, "V s/rad", float("nan"))},
        sensor_faults=(SensorFault("motor.1.current", "dead", "it is dead"),) if broken else (),
    )


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
    (found,) = common_causes(weeks)
    assert found.share == 1.0
    assert found.change is None


def test_what_creeps_what_jumps_and_what_was_once(weeks: dict[str, Diagnosis]) -> None:
    causes = {each.name: each for each in common_causes(weeks)}
    battery = causes["battery.internal_resistance"]
    assert battery.common
    assert battery.change is not None
    assert battery.change.form is Form.TREND
    assert battery.change.after == pytest.approx(0.168, abs=0.01)
    assert causes["drive.slope"].recordings == ("week-3.csv",)
    assert not causes["drive.slope"].common
    (motor,) = fleet_numbers(weeks)
    assert motor.change is not None
    assert (motor.change.form, motor.change.first) == (Form.STEP, 6)
    text = fleet_report(weeks, list(causes.values()))
    assert "battery.internal_resistance creeps from 0.06" in text
    assert "motor.0.back_emf jumps from 1.08" in text
    assert "with week-6.csv" in text
    assert "motor.1.current: dead" in text


def test_one_robot_of_many_is_far_from_the_others() -> None:
    fleet = {f"robot-{i}.csv": diagnosis(back_emf=1.08 + 0.002 * (i % 3) - 0.15 * (i == 4)) for i in range(8)}
    (motor,) = fleet_numbers(fleet)
    assert motor.outliers == ("robot-4.csv",)
    assert motor.change is None


def test_a_steady_number_does_not_change() -> None:
    rng = np.random.default_rng(3)
    changes = [change_of((1.0 + 0.05 * rng.standard_normal(12)).tolist(), [0.05] * 12) for _ in range(200)]
    assert sum(each is not None for each in changes) <= 2
    assert change_of([1.0, 1.0], [0.1, 0.1]) is None


def test_numbers_in_other_units_count_and_are_not_compared() -> None:
    fleet = {str(i): diagnosis(cause("friction.coulomb", 0.008, "left", "N m")) for i in range(4)}
    fleet["volts"] = diagnosis(cause("friction.coulomb", 0.3, "left", "V"))
    (friction,) = common_causes(fleet)
    assert friction.share == 1.0
    assert friction.unit == "N m"
    assert max(friction.values) < 0.01


def test_any_executor_keeps_the_order() -> None:
    with ThreadPoolExecutor(3) as pool:
        assert diagnose_all(lambda each: each * 2, list(range(20)), pool) == [2 * each for each in range(20)]
    assert diagnose_all(str, [1, 2]) == ["1", "2"]


def test_the_page_and_the_table_hold_it_all(weeks: dict[str, Diagnosis], tmp_path: Path) -> None:
    causes = common_causes(weeks)
    save_fleet_html(weeks, causes, tmp_path / "fleet.html", {"bad.csv": "it is <empty>"})
    page = (tmp_path / "fleet.html").read_text()
    assert "data:image/png;base64," in page
    assert "it is &lt;empty&gt;" in page
    assert "creeps from" in page
    table = json.loads(json.dumps(fleet_dict(weeks, causes)))
    assert set(table) == {"recordings", "causes", "numbers"}
    assert table["causes"][0]["change"]["form"] == "trend"


def test_the_fewer_before_a_change_are_not_odd_ones_out() -> None:
    values = [1.001, 1.003, 1.002, 1.064, 1.060, 1.062, 1.061, 1.063]
    fleet = {f"run{i}": diagnosis(cause("bemf.scale", each), back_emf=each) for i, each in enumerate(values)}
    (scale,), (motor,) = common_causes(fleet), fleet_numbers(fleet)
    for each in (scale, motor):
        assert each.change is not None
        assert (each.change.form, each.change.first) == (Form.STEP, 3)
        assert each.outliers == ()
    fleet["run1"] = diagnosis(cause("bemf.scale", 1.3), back_emf=1.003)
    assert "run1" in common_causes(fleet)[0].outliers


def test_one_that_does_not_creep_with_the_others_is_far_from_them() -> None:
    values = [0.06 + 0.02 * week for week in range(12)]
    values[4] += 0.05
    fleet = {
        f"week{i}": diagnosis(cause("battery.internal_resistance", each)) for i, each in enumerate(values)
    }
    (battery,) = common_causes(fleet)
    assert battery.change is not None
    assert battery.change.form is Form.TREND
    assert battery.outliers == ("week4",)


def test_equal_numbers_have_the_deviation_of_one() -> None:
    fleet = {str(i): diagnosis(back_emf=1.08) for i in range(5)}
    (motor,) = fleet_numbers(fleet)
    assert motor.spread == 0.003
    assert "1.08 +- 0.003" in fleet_report(fleet, [])


def test_a_jump_is_seen_beside_one_odd_recording() -> None:
    """A motor that was replaced, and a run with something else wrong that hides it: nearly 30 spreads off."""
    rng = np.random.default_rng(7)
    values = 1.0 + 0.04 * (np.arange(10) >= 6) + 0.002 * rng.standard_normal(10)
    values[2] -= 0.06
    fleet = {f"run{i}": diagnosis(back_emf=float(each)) for i, each in enumerate(values)}
    (motor,) = fleet_numbers(fleet)
    assert motor.change is not None
    assert (motor.change.form, motor.change.first) == (Form.STEP, 6)
    assert motor.change.before == pytest.approx(1.0, abs=0.003)
    assert motor.outliers == ("run2",)


@pytest.mark.parametrize("count", [5, 8, 12])
@pytest.mark.parametrize("kind", ["scattered", "heavy-tailed", "now and then", "one odd"])
def test_a_steady_series_is_hardly_ever_said_to_change(count: int, kind: str) -> None:
    """Numbers that scatter by more than they say, that are named on and off, or of which one is off."""
    rng = np.random.default_rng(count)
    said = 0
    for _ in range(100):
        series = 1.0 + 0.03 * rng.standard_normal(count)
        if kind == "heavy-tailed":
            series = 1.0 + 0.03 * rng.standard_t(2, count)
        elif kind == "now and then":
            series = np.where(rng.random(count) < 0.3, 1.0, 1.03 + 0.01 * rng.standard_normal(count))
        elif kind == "one odd":
            series[rng.integers(count)] += 1.0
        said += change_of(series.tolist(), [0.01] * count) is not None
    assert said <= 3


@pytest.mark.parametrize("count", [5, 6, 7])
def test_few_numbers_that_say_no_deviation_seem_to_change_in_one_of_a_hundred(count: int) -> None:
    """What five numbers leave of their scatter is often far too small: 3.8 % seemed to jump or creep."""
    rng = np.random.default_rng(count)
    silent = [float("nan")] * count
    said = sum(
        change_of((1.0 + 0.01 * rng.standard_normal(count)).tolist(), silent) is not None for _ in range(1000)
    )
    assert said <= 15
    one, two = (level + 0.01 * rng.standard_normal(count) for level in (1.0, 1.3))
    found = change_of([*one[:3], *two[3:]], silent)
    assert found is not None
    assert (found.form, found.first) == (Form.STEP, 3)


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
    found = next(each for each in common_causes(fleet) if each.name == "battery.internal_resistance")
    assert found.share == 1.0
    assert found.change is None


def test_what_only_one_side_cannot_tell_speaks_of_the_other() -> None:
    reason = "not identifiable at the left: motor.0.bemf is missing; at the right: it is as assumed"
    half = replace(diagnosis(), rejected=(Rejected("bemf.scale", reason),))
    (found,) = common_causes({"one": diagnosis(cause("bemf.scale", 1.05, "right")), "two": half})
    assert found.share == 0.5
    (found,) = common_causes({"one": diagnosis(cause("bemf.scale", 1.05, "left")), "two": half})
    assert found.share == 1.0


def test_what_most_recordings_do_not_tell_a_cause_from_is_said_with_it(tmp_path: Path) -> None:
    """A left motor that is 6 % weak, named in three runs as a right one that is strong, or the left."""
    named = cause("motor.back_emf_constant", 1.06, "right", "")
    unsure = replace(named, confounded_with=("motor.back_emf_constant@left", "drive.track_width"))
    other = replace(named, confounded_with=("motor.back_emf_constant@left",))
    fleet = {f"run{i}": diagnosis() for i in range(5)}
    fleet |= {"run5": diagnosis(unsure), "run6": diagnosis(other), "run7": diagnosis(named)}
    (found,) = causes = common_causes(fleet)
    assert found.rivals == ("motor.back_emf_constant@left",)
    text = fleet_report(fleet, causes)
    assert "1.06; not told from motor.back_emf_constant@left" in text
    assert "motor.back_emf_constant@right (or motor.back_emf_constant@left) jumps from " in text
    save_fleet_html(fleet, causes, tmp_path / "fleet.html")
    assert "<td>motor.back_emf_constant@left</td>" in (tmp_path / "fleet.html").read_text()
