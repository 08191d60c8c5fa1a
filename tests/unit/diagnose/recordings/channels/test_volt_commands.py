"""Commands in volts: of a driver that makes them of its battery as it read it, and of one that keeps them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.generator import make
from blind.hidden import draw
from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings import drive as drive_diagnosis
from raccoon.diagnose.recordings.channels.volt_commands import (
    BY_READING_NOTE,
    duties_by_battery_reading,
    explains_better,
)
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.drive import Drive
from raccoon.diagnose.result import ChannelResult, Diagnosis, Verdict
from raccoon.sim.effects.parameters import Parameters

Columns = dict[str, NDArray[np.float64]]
ROBOT = RobotConfig()


def in_volts(columns: Columns, supply: NDArray[np.float64] | float) -> Columns:
    """The same drive with volts for duties, as a driver with this supply makes them."""
    kept = {name: each for name, each in columns.items() if ".duty" not in name}
    return kept | {f"motor.{port}.voltage": columns[f"motor.{port}.duty"] * supply for port in (0, 1)}


def read_last(columns: Columns) -> NDArray[np.float64]:
    known = np.isfinite(columns["battery.voltage"])
    row = np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))
    row[: int(np.argmax(known))] = int(np.argmax(known))
    return columns["battery.voltage"][row]


def test_volts_over_what_was_read_last_are_the_duties_that_were_given() -> None:
    drive = dict(make(3, [], seconds=4.0).columns)
    found = duties_by_battery_reading(in_volts(drive, read_last(drive)), ROBOT)
    assert found is not None
    assert not any(".voltage" in name for name in found if name.startswith("motor."))
    for port in (0, 1):
        np.testing.assert_allclose(found[f"motor.{port}.duty"], drive[f"motor.{port}.duty"], atol=1e-12)


@pytest.mark.parametrize("change", [{}, {"battery.voltage": 3.0}], ids=["not read", "of another battery"])
def test_without_a_reading_of_their_battery_volts_are_no_duties(change: dict[str, float]) -> None:
    drive = in_volts(dict(make(3, [], seconds=4.0).columns), 6.8)
    del drive["battery.voltage"]
    drive |= {name: np.full(len(drive["t"]), value) for name, value in change.items()}
    assert duties_by_battery_reading(drive, ROBOT) is None


@pytest.mark.usefixtures("known_controller")
def test_a_driver_that_reads_its_battery_does_not_hide_it() -> None:
    """It was said that the driver hides the battery, and what it lacks was friction, a limit and lags."""
    hidden = draw("battery.open_circuit_voltage", np.random.default_rng(2))
    drive = dict(make(14, [hidden], seconds=6.0).columns)
    found = diagnose_recording(in_volts(drive, read_last(drive)), ROBOT)
    assert [each.name for each in found.causes] == ["battery.open_circuit_voltage"]
    number = found.causes[0].parameters["voltage"]
    assert number.value == pytest.approx(hidden.values["voltage"], abs=0.07)  # this robot's own is beside it
    assert BY_READING_NOTE in found.notes
    assert found.model is not None


def test_what_is_judged_on_a_drive_by_duty_is_taken_by_its_readings_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where that did not explain it, an error of the other recording came after minutes."""
    drive, asked = dict(make(3, [], seconds=4.0).columns), []

    def partly(drive: Drive) -> Diagnosis:
        asked.append(drive.columns)
        return told(Verdict.PARTLY, 8.0)

    monkeypatch.setattr(drive_diagnosis, "_diagnose", partly)
    found = diagnose_recording(
        in_volts(drive, read_last(drive)), ROBOT, holdout=dict(make(5, seconds=4.0).columns)
    )
    assert BY_READING_NOTE in found.notes
    assert ["motor.0.duty" in each for each in asked] == [True]


def test_a_model_that_volts_leave_unused_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = in_volts(dict(make(3, [], seconds=4.0).columns), 6.8)
    del drive["battery.voltage"]
    monkeypatch.setattr(drive_diagnosis, "diagnose", lambda *_, **__: told(WHOLE, 8.0))
    model = Parameters.from_robot(ROBOT)
    assert drive_diagnosis.NO_MODEL in diagnose_recording(drive, ROBOT, model=model).notes
    assert drive_diagnosis.NO_MODEL not in diagnose_recording(drive, ROBOT).notes


def told(verdict: Verdict, error: float, *names: str) -> Diagnosis:
    """A diagnosis that leaves so much of a wheel's reading beside these causes."""
    channel = ChannelResult("motor.0.bemf", "counts", 100.0, error, 4.0)
    return make_diagnosis(
        *(make_cause(each, said="") for each in names), verdict=verdict, channels=(channel,)
    )


RESISTANCE, LATENCY, SLIP = "battery.internal_resistance", "actuation.latency", "drive.wheel_slip"
WHOLE, PART = Verdict.EXPLAINED, Verdict.PARTLY


@pytest.mark.parametrize(
    ("exact", "by_reading", "better"),
    [
        (told(WHOLE, 8.0, LATENCY), told(WHOLE, 16.0, LATENCY), True),
        (told(WHOLE, 16.0), told(WHOLE, 8.0, LATENCY, SLIP), False),
        (told(WHOLE, 8.1, LATENCY), told(WHOLE, 8.0, LATENCY, SLIP), True),
        (told(WHOLE, 8.0, LATENCY, SLIP), told(WHOLE, 8.1, LATENCY), False),
        (told(WHOLE, 8.1), told(WHOLE, 8.0, RESISTANCE), False),  # which it could not name
        (told(WHOLE, 8.1, LATENCY), told(PART, 8.0, LATENCY), True),
        (told(PART, 8.0), told(WHOLE, 8.1, LATENCY), False),
        (replace(told(WHOLE, 8.0), channels=()), told(WHOLE, 8.0, LATENCY), False),
    ],
)
def test_a_driver_keeps_its_volts_where_that_explains_the_drive_better(
    exact: Diagnosis, by_reading: Diagnosis, better: bool
) -> None:
    assert explains_better(exact, by_reading) is better
