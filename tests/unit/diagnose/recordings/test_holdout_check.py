"""Recordings to judge on that are no use: each is refused for what it is, or said to be of no use."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from blind.tophats import tophat
from raccoon.core.config import RobotConfig
from raccoon.core.errors import HoldoutError
from raccoon.diagnose.recordings.channels.volt_commands import duties_of_stiff_battery
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from unit.diagnose.axes import motor

Columns = dict[str, np.ndarray]
ROBOT = RobotConfig()


@pytest.fixture(scope="module")
def drive() -> Columns:
    return dict(make(4, seconds=6.0).columns)


@pytest.fixture(scope="module")
def other() -> Columns:
    return dict(make(5, seconds=6.0).columns)


@pytest.mark.parametrize(
    ("gone", "said"),
    [
        ("battery", "battery.voltage is missing or broken in it, and not in the recording"),
        ("gyro", "imu.gyro.z is missing or broken in it"),
        ("bemf", "motor.0.bemf, motor.1.bemf are missing or broken in it"),
        ("duty", "it holds neither commands nor a reference, and the recording that is diagnosed a drive"),
    ],
)
def test_one_that_lacks_a_channel_is_refused_by_its_name(
    gone: str, said: str, drive: Columns, other: Columns
) -> None:
    """Each was a traceback, but the last."""
    less = {name: each for name, each in other.items() if gone not in name and "position" not in name}
    with pytest.raises(HoldoutError, match=said):
        diagnose_recording(drive, ROBOT, holdout=less)


@pytest.mark.usefixtures("few_causes", "known_controller")
def test_what_only_the_other_one_has_is_not_looked_at(drive: Columns, other: Columns) -> None:
    less = {name: each for name, each in drive.items() if "gyro" not in name}
    found = diagnose_recording(less, ROBOT, holdout=other)
    assert [each.name for each in found.channels] == ["motor.0.bemf", "motor.1.bemf", "battery.voltage"]


@pytest.mark.parametrize("begins", [-0.3, 1.7e9])
def test_the_same_samples_by_another_clock_are_no_other_recording(drive: Columns, begins: float) -> None:
    """One export from 0 and one in seconds since 1970 agreed with each other."""
    with pytest.raises(HoldoutError, match="its samples are those of the recording that is diagnosed"):
        diagnose_recording(drive, ROBOT, holdout={**drive, "t": drive["t"] + begins})


def test_encoders_are_not_compared_with_counts_of_back_emf(drive: Columns) -> None:
    with pytest.raises(HoldoutError, match=r"motor\.0\.bemf, motor\.1\.bemf are missing"):
        diagnose_recording(drive, ROBOT, holdout=make(6, seconds=6.0, encoders=True).columns)


def test_an_error_of_the_other_recording_is_said_of_that(drive: Columns, other: Columns) -> None:
    with pytest.raises(HoldoutError, match="millivolts"):
        diagnose_recording(drive, ROBOT, holdout={**other, "battery.voltage": 1e3 * other["battery.voltage"]})


def test_a_copy_of_a_recording_does_not_judge_it(drive: Columns) -> None:
    part = {name: each[200:900] for name, each in drive.items()}
    for copy in (dict(drive), part):
        with pytest.raises(HoldoutError, match="its samples are those of the recording that is diagnosed"):
            diagnose_recording(drive, ROBOT, holdout=copy)


@pytest.mark.parametrize("kind", ["tophats", "motors"])
def test_one_of_another_kind_is_refused(kind: str, drive: Columns) -> None:
    """A drive beside a motor was no error, and the motor then said to lack what it had."""
    holdout = tophat(3, seconds=4.0) if kind == "tophats" else motor(5, 0.008)
    with pytest.raises(HoldoutError, match="a drive with its commands: name one of the same kind"):
        diagnose_recording(drive, ROBOT, holdout=holdout)
    with pytest.raises(HoldoutError, match="single motors: name one of the same kind"):
        diagnose_recording(motor(6, 0.008), ROBOT, holdout=drive)


def test_tophats_say_that_they_are_judged_by_themselves() -> None:
    found = diagnose_recording(tophat(3, seconds=4.0), ROBOT, holdout=tophat(4, seconds=4.0))
    assert any(each.startswith("the holdout was not used: a recording that holds") for each in found.notes)
    assert not diagnose_recording(tophat(3, seconds=4.0), ROBOT).notes


def test_a_motor_is_not_judged_on_one_without_its_current() -> None:
    less = {name: each for name, each in motor(7, 0.008).items() if "current" not in name}
    with pytest.raises(HoldoutError, match=r"motor\.\d\.current is missing or broken in it"):
        diagnose_recording(motor(6, 0.008), ROBOT, holdout=less)


@pytest.mark.usefixtures("few_causes", "known_controller")
def test_another_robot_is_asked_after_where_nothing_was_found(drive: Columns) -> None:
    """The verdict was that the simulation is wrong in an unknown way, and no word of the other recording."""
    other = dict(make(5, seconds=6.0).columns)
    other |= {f"motor.{side}.bemf": 1.15 * other[f"motor.{side}.bemf"] for side in (0, 1)}
    found = diagnose_recording(drive, ROBOT, holdout=other)
    assert not found.causes
    assert any("nothing was found in this one: is it the same robot" in each for each in found.notes)


def test_volts_of_two_recordings_are_shares_of_one_battery(drive: Columns) -> None:
    """Each had the largest of its own, so 9 V in one of them were the 8 V of the other."""

    def in_volts(most: float) -> Columns:
        return {"t": drive["t"]} | {f"motor.{port}.voltage": most * drive["motor.0.duty"] for port in (0, 1)}

    largest = float(np.abs(drive["motor.0.duty"]).max())
    changed, stiff, _ = duties_of_stiff_battery(in_volts(8.0 / largest), ROBOT, in_volts(9.0 / largest))
    later, _, _ = duties_of_stiff_battery(in_volts(9.0 / largest), stiff)
    assert stiff.model.battery.open_circuit_voltage.value == pytest.approx(9.0)
    np.testing.assert_allclose(changed["motor.0.duty"] * 9.0, later["motor.0.duty"] * 8.0)
