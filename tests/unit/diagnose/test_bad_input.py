from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.errors import TraceError
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.log import log_from_columns
from raccoon.diagnose.manoeuvres import manoeuvre
from raccoon.diagnose.quality import check_units
from raccoon.diagnose.result import Verdict

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=8.0).columns)


def check(columns: Columns, robot: RobotConfig = ROBOT) -> None:
    check_units(log_from_columns(columns, robot), robot)


def test_a_good_recording_passes(good: Columns) -> None:
    check(good)


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("motor.0.duty", 100.0, "percent"),
        ("imu.gyro.z", 57.3, "degrees"),
        ("motor.1.bemf", 0.0033, "volts"),
        ("battery.voltage", 1 / 0.008862, "counts"),
        ("battery.voltage", 1000.0, "millivolts"),
        ("motor.0.bemf", -1.0, "opposite sign"),
        ("imu.gyro.z", -1.0, "swapped"),
    ],
)
def test_wrong_units_and_signs_are_said(good: Columns, column: str, factor: float, said: str) -> None:
    with pytest.raises(TraceError, match=said):
        check({**good, column: factor * good[column]})


def test_a_straight_line_says_nothing_of_the_gyros_sign() -> None:
    """A robot that pulls to the left while the right counter reads too little is wired well."""
    straight = dict(make(4, drive=manoeuvre("back and forth")).columns)
    straight["imu.gyro.z"] = straight["imu.gyro.z"] + 0.1 * straight["motor.0.duty"]
    straight["motor.1.bemf"] = 0.85 * straight["motor.1.bemf"]
    check(straight)


def test_empty() -> None:
    with pytest.raises(TraceError, match="empty"):
        diagnose({"t": np.zeros(0)}, ROBOT)


def test_two_samples(good: Columns) -> None:
    with pytest.raises(TraceError, match="2 samples"):
        diagnose({key: column[:2] for key, column in good.items()}, ROBOT)


def test_time_that_goes_back(good: Columns) -> None:
    time = good["t"].copy()
    time[100] = time[90]
    with pytest.raises(TraceError, match="must advance"):
        diagnose({**good, "t": time}, ROBOT)


def test_time_that_is_no_number(good: Columns) -> None:
    time = good["t"].copy()
    time[100] = np.nan
    with pytest.raises(TraceError, match="not a number"):
        diagnose({**good, "t": time}, ROBOT)


def test_no_commands(good: Columns) -> None:
    columns = {key: column for key, column in good.items() if "duty" not in key}
    with pytest.raises(TraceError, match="no commands"):
        diagnose(columns, ROBOT)


def test_another_robots_ports(good: Columns) -> None:
    with pytest.raises(TraceError, match=r"motor\.2\.duty is not in the recording"):
        diagnose(good, parse_robot({"drive": {"left": 2, "right": 3}}))


def test_constant_commands_cannot_tell(good: Columns) -> None:
    still = {**good, "motor.0.duty": 0.0 * good["t"], "motor.1.duty": 0.0 * good["t"]}
    still["motor.0.bemf"] = still["motor.1.bemf"] = 0.0 * good["t"]
    assert diagnose(still, ROBOT).verdict is Verdict.NOT_IDENTIFIABLE


def test_inverted_wiring_is_taken_away(good: Columns) -> None:
    robot = parse_robot({"motor": {"0": {"inverted": True}}})
    flipped = {**good, "motor.0.duty": -good["motor.0.duty"], "motor.0.bemf": -good["motor.0.bemf"]}
    plain, turned = log_from_columns(good, ROBOT), log_from_columns(flipped, robot)
    assert np.array_equal(plain.duty, turned.duty)
    assert np.array_equal(plain.channels[0].values, turned.channels[0].values, equal_nan=True)


def test_a_missing_channel_is_named(good: Columns) -> None:
    log = log_from_columns({key: each for key, each in good.items() if "gyro" not in key}, ROBOT)
    assert "imu.gyro.z" in log.missing
    assert log.channel("gyro") is None
