from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.generator import Blind, make
from blind.hidden import draw
from blind.plant import NEUTRAL
from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.hypotheses.base_coordinates import with_default_stds
from raccoon.diagnose.recordings import drive as drive_diagnosis
from raccoon.diagnose.recordings.channels.counters import (
    CounterBemf,
    counters_named_in_errors,
    with_counter_bemf,
)
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.kind import Kind, kind_of
from raccoon.diagnose.result import CauseResult, Diagnosis, ParameterResult, Verdict

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def drive() -> Blind:
    """A drive whose right motor has another K_E."""
    hidden = draw("motor.back_emf_constant", np.random.default_rng(8))
    return make(8, [hidden], seconds=4.0)


@pytest.fixture
def weak_right(drive: Blind) -> Columns:
    return dict(drive.columns)


def without(columns: Columns, *words: str) -> Columns:
    return {name: each for name, each in columns.items() if not any(word in name for word in words)}


def test_columns_of_different_lengths_are_refused_by_name() -> None:
    columns = {"t": np.arange(3.0), "motor.0.duty": np.zeros(3), "motor.0.bemf": np.zeros(2)}
    with pytest.raises(TraceError, match=r"column motor\.0\.bemf has shape \(2,\): it must be \(3,\) as t"):
        diagnose_recording(columns, ROBOT)


@pytest.mark.usefixtures("known_controller")
def test_volts_instead_of_duty_hide_the_battery_and_nothing_else(weak_right: Columns) -> None:
    known = np.isfinite(weak_right["battery.voltage"])
    battery = np.interp(weak_right["t"], weak_right["t"][known], weak_right["battery.voltage"][known])
    volts = without(weak_right, "duty", "battery")
    for port in (0, 1):
        volts[f"motor.{port}.voltage"] = weak_right[f"motor.{port}.duty"] * battery
    assert kind_of(volts, ROBOT) is Kind.DRIVE
    found = diagnose_recording(volts, ROBOT)
    assert [each.name for each in found.causes] == ["motor.back_emf_constant@right"]
    reasons = {each.id: each.reason for each in found.rejected}
    assert "motor.N.voltage is recorded instead" in reasons["battery.internal_resistance"]


@pytest.mark.usefixtures("few_causes", "known_controller")
def test_without_gyro_and_battery_the_rest_is_named_and_the_columns_too(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "gyro", "battery"), ROBOT)
    assert [each.name for each in found.causes] == ["motor.back_emf_constant@right"]
    reasons = {each.id: each.reason for each in found.rejected}
    assert reasons["imu.gyro_scale"] == "not identifiable: imu.gyro.z is missing"
    assert reasons["battery.discharge"] == "not identifiable: battery.voltage is missing"
    assert any(each.startswith("not checked, since imu.gyro.z is missing: ") for each in found.notes)


@pytest.mark.usefixtures("known_controller")
def test_counters_stand_in_for_the_reading_that_they_sum(drive: Blind) -> None:
    found = diagnose_recording(without(dict(drive.columns), "bemf"), ROBOT)
    assert [each.name for each in found.causes] == ["motor.back_emf_constant@right"]
    counted = found.causes[0].parameters["factor"]
    assert counted.value == pytest.approx(drive.robot["ke_r"] / NEUTRAL["ke_r"], abs=0.01)
    said = "motor.0.bemf and motor.1.bemf are missing: derived from motor.0.position and motor.1.position"
    assert any(each.startswith(said) for each in found.notes)


def test_a_counter_is_differenced_around_its_row() -> None:
    """In the middle of the rows that it sums, so nothing comes early or late; a tick is worth what it is."""
    time = 0.005 * np.arange(60)
    ticks = np.cumsum(np.linspace(0.0, 590.0, 60)) * 0.005 / 0.25
    columns: Columns = {"t": time, "motor.0.position": ticks, "motor.1.speed": np.ones(60)}
    counted = with_counter_bemf(columns, ROBOT, replace(SI_WORDS, position_counts_seconds=0.25))
    reading = counted.columns["motor.0.bemf"]
    known = np.isfinite(reading)
    assert known.sum() == 19
    assert reading[known] == pytest.approx(np.linspace(0.0, 590.0, 60)[known])
    assert counted.counters == ("motor.0.position",)
    assert "motor.1.bemf" not in counted.columns


def test_a_counter_in_whole_ticks_hides_what_is_below_one_in_the_rows_it_is_taken_over() -> None:
    """A sound robot of which only such counters were kept had a dead zone for sure, of 36 counts. Times as
    they are written make rows that are a hair too short, of which five were taken for three."""
    time = 0.004999 * np.arange(200)
    columns: Columns = {"t": time, "motor.0.position": np.floor(1000.0 * time), "motor.1.speed": np.ones(200)}
    counted = with_counter_bemf(columns, ROBOT, SI_WORDS)
    assert counted.hidden_counts == pytest.approx(1.0 / 0.015)
    assert int(np.isfinite(counted.columns["motor.0.bemf"]).sum()) == 66


@pytest.mark.parametrize("first", [0, 1, 2])
def test_a_counter_that_is_read_less_often_tells_the_same_and_nothing_of_a_gap(first: int) -> None:
    """Read in every second row it told nothing at all, and over a gap half of a speed that the wheel had."""
    rows = np.arange(first, 400)
    there = (rows < 160) | (rows >= 240)
    every_other = {"t": 0.005 * rows, "motor.0.position": np.where(rows % 2 == 0, 5.0 * rows, np.nan)}
    gap = {"t": 0.005 * rows[there], "motor.0.position": np.cumsum(5.0 * there)[there]}
    for columns, fewest in ((every_other, 60), (gap, 100)):
        reading = with_counter_bemf(columns, ROBOT, SI_WORDS).columns["motor.0.bemf"]
        known = reading[np.isfinite(reading)]
        assert len(known) >= fewest
        assert known == pytest.approx(1000.0 * SI_WORDS.position_counts_seconds)


def test_a_zone_as_narrow_as_a_tick_is_the_counters() -> None:
    def zone(counts: float) -> CauseResult:
        return make_cause("bemf.dead_zone", {"counts": ParameterResult(counts, 1.0, "counts", 0.0)})

    counted = CounterBemf({}, ("motor.0.position",), 10.0)
    narrow = counted.annotate(make_diagnosis(zone(12.0)))
    assert narrow.causes == ()
    assert narrow.verdict is Verdict.ADEQUATE
    assert any("whole ticks of motor.0.position" in each.reason for each in narrow.rejected)
    wide = counted.annotate(make_diagnosis(zone(25.0)))
    assert [each.id for each in wide.causes] == ["bemf.dead_zone"]


def test_without_any_wheel_nothing_is_identifiable(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "bemf", "position"), ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert any("motor.0.bemf or motor.0.speed" in each.reason for each in found.rejected)


def test_without_any_wheel_it_is_said_what_to_record(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "bemf", "position"), ROBOT)
    assert (
        "record the back-EMF of both motors (motor.0.bemf and motor.1.bemf)" in found.suggested_manoeuvres[0]
    )
    assert {"imu.*", "battery.*"} <= {each.id for each in found.rejected}


@pytest.mark.usefixtures("few_causes", "known_controller")
def test_the_reading_of_one_side_is_not_known_where_only_the_other_is_recorded(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "motor.0.bemf", "motor.0.position"), ROBOT)
    reasons = {each.id: each.reason for each in found.rejected}
    start = "not identifiable at the left: motor.0.bemf is missing"
    assert reasons["bemf.scale"].startswith(f"{start}; at the right: ")
    assert "motor.0.bemf is missing: causes that only this wheel shows are not checked" in found.notes


def test_numbers_without_std_are_as_well_known_as_by_default() -> None:
    model = {"motor": {"armature_resistance": 3.6, "right": {"back_emf_constant": 1.0}}}
    robot = parse_robot({"model": {**model, "bemf": {"offset": -4.0}, "friction": {"coulomb": 0.0}}})
    opened, keys = with_default_stds(robot)
    assert opened.model.left.armature_resistance.std == pytest.approx(0.06)
    assert opened.model.bemf.offset.std == 1.0
    assert opened.model.friction.coulomb.std == 0.0
    assert opened.model.left.back_emf_constant == robot.model.left.back_emf_constant
    assert set(keys) == {
        "model.motor.left.armature_resistance", "model.motor.right.armature_resistance",
        "model.motor.right.back_emf_constant", "model.bemf.offset",
    }  # fmt: skip
    assert with_default_stds(ROBOT) == (ROBOT, ())


def test_numbers_without_std_are_said_in_one_note(
    weak_right: Columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = parse_robot({"model": {"motor": {"armature_resistance": 1.8}, "imu": {"gyro_scale": 1}}})
    asked: list[RobotConfig] = []

    def said(_: Columns, robot: RobotConfig, **__: object) -> Diagnosis:
        asked.append(robot)
        return make_diagnosis()

    monkeypatch.setattr(drive_diagnosis, "diagnose", said)
    found = diagnose_recording(weak_right, robot)
    assert asked == [with_default_stds(robot)[0]]
    notes = [each for each in found.notes if "no std" in each]
    assert len(notes) == 1
    assert "no std for model.motor.armature_resistance, model.imu.gyro_scale: " in notes[0]


def test_commands_of_another_robot_are_an_error(weak_right: Columns) -> None:
    other = {name.replace("motor.1", "motor.3"): each for name, each in weak_right.items()}
    with pytest.raises(TraceError, match=r"motor\.1\.duty is not in the recording"):
        diagnose_recording(other, ROBOT)


def test_what_is_wrong_with_a_counter_is_said_of_the_counter() -> None:
    """motor.0.bemf was said to be in another unit, of a file that had no such column."""
    columns = {"t": np.zeros(2), "motor.0.position": np.zeros(2), "motor.1.bemf": np.zeros(2)}
    with pytest.raises(TraceError) as told, counters_named_in_errors(columns):
        raise TraceError("motor.0.bemf and motor.1.bemf are 1.9 times too large")
    assert str(told.value) == (
        "motor.0.bemf (as motor.0.position advances) and motor.1.bemf are 1.9 times too large"
    )
    with pytest.raises(HoldoutError, match=r"motor\.0\.bemf is"), counters_named_in_errors(columns):
        raise HoldoutError("motor.0.bemf is of another recording")
