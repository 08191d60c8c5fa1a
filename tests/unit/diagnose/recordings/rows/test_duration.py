"""Pauses without rows, hours, and minutes of standing: what of a drive is simulated."""

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.log import arrange_columns
from raccoon.diagnose.recordings.kind import Kind
from raccoon.diagnose.recordings.rows.duration import MARGIN_S, MAX_DURATION_S, MAX_PAUSE_S, limit_duration
from raccoon.diagnose.recordings.rows.selection import select_rows, select_unique_rows_of_each

ROW = 0.01


def drive(seconds: float, driven: tuple[tuple[float, float], ...]) -> dict[str, np.ndarray]:
    """Commands that are there only where they change."""
    time = ROW * np.arange(round(seconds / ROW))
    duty = np.zeros(len(time))
    for start, end in driven:
        duty[(time >= start) & (time < end)] = 0.5
    changes = np.diff(duty, prepend=np.nan) != 0.0
    return {"t": time, "motor.0.duty": np.where(changes, duty, np.nan), "imu.gyro.z": np.arange(len(time))}


def test_a_pause_of_a_day_is_taken_for_some_seconds_and_said() -> None:
    columns = drive(4.0, ((0.0, 4.0),))
    late = {**columns, "t": columns["t"] + np.where(columns["t"] >= 2.0, 86400.0, 0.0)}
    found, (said,) = limit_duration(late)
    np.testing.assert_allclose(
        found["t"], columns["t"] + np.where(columns["t"] >= 2.0, MAX_PAUSE_S - ROW, 0.0)
    )
    assert said.startswith("no rows from 2.0 to 86402.0 s: it is shortened to 5 s")
    assert found["imu.gyro.z"] is late["imu.gyro.z"]


def test_what_is_short_stays_as_it_is() -> None:
    columns = drive(30.0, ((1.0, 28.0),))
    gap = {name: each[(columns["t"] < 10.0) | (columns["t"] > 14.9)] for name, each in columns.items()}
    for each in (columns, gap):
        found, said = limit_duration(each)
        assert said == ()
        np.testing.assert_array_equal(found["t"], each["t"])


def test_of_an_hour_that_part_is_taken_in_which_it_drives_most() -> None:
    columns = drive(3600.0, ((5.0, 15.0), (1700.0, 1990.0), (3000.0, 3001.0)))
    found, (said,) = limit_duration(columns)
    assert found["t"][-1] - found["t"][0] <= MAX_DURATION_S + ROW
    assert 1700.0 <= found["t"][0] < found["t"][-1] <= 1990.0
    assert found["motor.0.duty"][0] == 0.5  # which was commanded before
    assert said.startswith("of 3600 s only 1700.0 to 1940.0 s are used: at most 240 s are diagnosed")


def test_of_minutes_before_the_start_and_after_the_end_some_seconds_are_looked_at() -> None:
    found, (said,) = limit_duration(drive(230.0, ((95.0, 130.0),)))
    np.testing.assert_allclose(found["t"][[0, -1]], (95.0 - MARGIN_S, 130.0 + MARGIN_S), atol=2.0 * ROW)
    assert said == "of 230 s only 85.0 to 140.0 s are used: nothing is commanded before and after that"
    nothing = drive(400.0, ())
    assert limit_duration(nothing)[0]["t"] is nothing["t"]


def test_a_motor_that_was_told_to_brake_still_does_in_a_part() -> None:
    """All rows had a command then, and one without a word of the brake does not brake."""
    columns = drive(60.0, ((20.0, 25.0), (26.0, 30.0)))
    duty = columns["motor.0.duty"]
    columns |= {f"motor.{port}.brake": np.where(duty == 0.0, 1.0, np.nan) for port in (0, 1)}
    columns["motor.1.duty"] = duty
    found, (said,) = limit_duration(columns)
    assert "only 10.0 to 40.0 s" in said
    part = (columns["t"] >= found["t"][0]) & (columns["t"] <= found["t"][-1])
    whole, less = arrange_columns(columns, RobotConfig()).brake, arrange_columns(found, RobotConfig()).brake
    assert whole is not None
    assert less is not None
    np.testing.assert_array_equal(less, whole[part])
    assert less[0].all()


def test_what_is_no_time_is_left_to_be_refused() -> None:
    for time in ([0.0, np.nan, 2.0], [0.0, 9.0, 8.0]):
        columns = {"t": np.array(time), "motor.0.duty": np.zeros(3)}
        assert limit_duration(columns) == (columns, ())


def test_each_of_several_says_which_it_is() -> None:
    long = drive(230.0, ((95.0, 130.0),))
    found, said = select_unique_rows_of_each([drive(5.0, ((0.0, 5.0),)), long], Kind.DRIVE)
    assert [len(each["t"]) for each in found] == [500, 5500]
    assert [each.partition(": ")[0] for each in said] == ["recording 3"]
    late = {**long, "t": 1000.0 * long["t"]}
    with pytest.raises(TraceError, match=r"^recording 3: t advances by 10 s a sample"):
        select_unique_rows_of_each([long, late], Kind.DRIVE)


@pytest.mark.parametrize("effort", ["voltage", "force", "torque"])
def test_of_motors_as_much_is_looked_at_and_a_pause_stays_one(effort: str) -> None:
    columns = drive(300.0, ((20.0, 290.0),))
    columns[f"motor.2.{effort}"] = columns.pop("motor.0.duty")
    found, (said,) = select_rows(columns, Kind.MOTORS)
    assert said.startswith("of 300 s only 20.0 to 260.0 s are used")
    assert found[f"motor.2.{effort}"][0] == 0.5
    gap = {name: each[:9000] for name, each in found.items()}
    gap["t"] = gap["t"] + np.where(gap["t"] >= 50.0, 60.0, 0.0)
    assert select_rows(gap, Kind.MOTORS) == (gap, ())
    assert select_rows(columns, Kind.TOPHATS) == (columns, ())
