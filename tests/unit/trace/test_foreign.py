import math
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.config import parse_robot
from raccoon.core.errors import TraceError
from raccoon.trace.columns import inputs_of
from raccoon.trace.foreign.fleet_steps import read_fleet_steps
from raccoon.trace.foreign.motor_steps import FILTER_SHARE, read_motor_steps
from raccoon.trace.foreign.optiodom import read_robot, read_run
from raccoon.trace.header import robot_table
from raccoon.trace.loading import load_run

METADATA = "type,diff,\nngear,43.7,\nencRes,64,\nLi,0.2,\nDi,0.085,0.083\n"
RUN = "0,0,0,3.1,0,0\n0.05,0.01,0,3.14,10,12\n0.1,0.02,0,-3.1,-4,5\n"
FLEET = (
    "t_s,left_command_V,right_command_V,left_current_A,right_current_A,"
    "left_velocity_m_per_s,right_velocity_m_per_s,battery_V\n"
)


def session(folder: Path, metadata: str = METADATA, run: str = RUN) -> Path:
    (folder / "metadata.csv").write_text(metadata)
    (folder / "run-01.csv").write_text(run)
    return folder


def test_optiodom_counts_ticks_up_and_unwraps_the_heading(tmp_path: Path) -> None:
    run = read_run(session(tmp_path) / "run-01.csv")
    np.testing.assert_array_equal(run["motor.0.position"], [0, 12, 17])  # left is the last column
    np.testing.assert_array_equal(run["motor.1.position"], [0, 10, 6])
    np.testing.assert_allclose(run["truth.heading"], [3.1, 3.14, 2 * math.pi - 3.1])
    assert [inputs.position[:2] for inputs in inputs_of(run)] == [(0, 0), (12, 10), (17, 6)]


def test_optiodom_robot_has_the_geometry_of_its_metadata(tmp_path: Path) -> None:
    robot = read_robot(session(tmp_path) / "metadata.csv")
    tick = 2 * math.pi / (43.7 * 64)
    left, right = (robot.motor(port).radians_per_tick for port in (robot.drive.left, robot.drive.right))
    radius = robot.model.drive.wheel_radius.value
    assert left is not None
    assert right is not None
    assert left.value * radius == pytest.approx(tick * 0.083 / 2)
    assert right.value * radius == pytest.approx(tick * 0.085 / 2)
    assert robot.model.drive.track_width.value == 0.2
    assert parse_robot(robot_table(robot)) == robot  # a model.toml or a header that holds it can be read


@pytest.mark.parametrize(
    ("metadata", "run", "message"),
    [
        (METADATA.replace("diff", "omni"), RUN, r"type is \['omni'\]"),
        (METADATA.replace("43.7", "-1"), RUN, r"ngear is \['-1'\]: allowed are numbers above 0"),
        (METADATA.replace("0.083", ""), RUN, "Di is"),
        (METADATA, "0,0,0,0,0\n", "line 1: 5 values: expected are"),
        (METADATA, RUN + "0.15,x,0,0,0,0\n", "line 4: truth.x is 'x'"),
        (METADATA, RUN + "0.01,0,0,0,0,0\n", "row 3: t is 0.01: it goes back"),
        (METADATA, "\n", "no row of numbers"),
    ],
)
def test_optiodom_says_what_is_wrong(tmp_path: Path, metadata: str, run: str, message: str) -> None:
    with pytest.raises(TraceError, match=message):
        load_run(session(tmp_path, metadata, run) / "run-01.csv")


def motor_steps(folder: Path, raw: list[float], first: float, start: float = 0.0) -> Path:
    """A file as the controller's filter writes it, whose time begins at `start` s."""
    lines, filtered = ["time_s,command_percent,velocity_rad_s"], first
    for index, speed in enumerate([math.nan, *raw]):
        if index:
            filtered = FILTER_SHARE * filtered + (1.0 - FILTER_SHARE) * speed
        lines.append(f"{start + index / 100:.4f},15.0000,{filtered:.4f}")
    path = folder / "motor_2_cmd_15.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_motor_steps_undo_the_filter_and_skip_what_says_nothing(tmp_path: Path) -> None:
    raw = [0.0] * 10 + [-2.0, -2.0, 0.0, -4.0, -2.0, 0.0, 0.0, -6.0]
    recording = read_motor_steps(motor_steps(tmp_path, raw, -500.0))
    speed = recording["motor.2.speed"]
    expected = [math.nan] + [0.0] * 10 + [-2, -2, math.nan, -2, -2, math.nan, math.nan, -2]
    np.testing.assert_allclose(speed, expected, atol=2e-4)
    np.testing.assert_array_equal(recording["motor.2.duty"], 0.15)
    assert recording["motor.2.speed_recorded"][0] == -500.0
    stale, repeated, backwards = recording.problems
    assert "motor 2: the first sample is stale: a filter decays from -500.0 rad/s over 5 samples" in stale
    assert "3 samples (16 %) repeat" in repeated
    assert "a command of 15 % turns it backwards" in backwards


def test_motor_steps_that_are_in_order_have_no_problems(tmp_path: Path) -> None:
    recording = read_motor_steps(motor_steps(tmp_path, [0.0] * 10 + [1.0] * 20, 0.0))
    assert recording.problems == []
    np.testing.assert_allclose(recording["motor.2.speed"][11:], 1.0, atol=2e-4)


@pytest.mark.parametrize("start", [0.0, 5.0])
def test_a_motor_that_turns_back_is_reported(tmp_path: Path, start: float) -> None:
    """The time before the first sample is no way of the motor."""
    recording = read_motor_steps(motor_steps(tmp_path, [3.0] * 10 + [-1.0] * 10, 0.0, start))
    assert recording.problems == [f"motor 2: it turns back at {start + 0.1:.2f} s under a constant command"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,velocity\n0,1\n", "expected are time_s,command_percent,velocity_rad_s"),
        ("time_s,command_percent,velocity_rad_s\n0,1,nan\n", "line 2: velocity_rad_s is 'nan'"),
        ("time_s,command_percent,velocity_rad_s\n0,1,2\n", "at least 3"),
        (
            "time_s,command_percent,velocity_rad_s\n1,1,2\n0,1,2\n0,1,2\n",
            "line 3: time_s is 0.0: must go up",
        ),
    ],
)
def test_motor_steps_say_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "steps.csv").write_text(text)
    with pytest.raises(TraceError, match=message):
        read_motor_steps(tmp_path / "steps.csv")


def test_fleet_steps_have_the_columns_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    path.write_text(FLEET + "0.001,2,-2,0.5,-0.4,0.03,-0.06,11.4\n0.002,2,-2,0.5,-0.4,0.03,-0.06,11.3\n")
    recording = read_fleet_steps(path, wheel_radius=0.03)
    expected = {
        "t": 0.001, "battery.voltage": 11.4, "motor.0.voltage": 2, "motor.1.voltage": -2,
        "motor.0.current": 0.5, "motor.1.current": -0.4, "motor.0.speed": 1.0, "motor.1.speed": -2.0,
        "motor.1.rim_speed": -0.06,
    }  # fmt: skip
    assert {name: recording[name][0] for name in expected} == pytest.approx(expected)
    assert recording.problems == []
    with pytest.raises(ValueError, match="wheel_radius is 0"):
        read_fleet_steps(path, wheel_radius=0.0)


def test_fleet_steps_are_a_file_for_each_robot(tmp_path: Path) -> None:
    """Four of 22 robots that come one after the other were said to be one whose friction jumped."""
    path = tmp_path / "robot-07.csv"
    path.write_text(FLEET + "0.001,2,-2,0.5,-0.4,0.03,-0.06,11.4\n0.002,2,-2,0.5,-0.4,0.03,-0.06,11.3\n")
    assert load_run(path).whose == "robot-07"


def test_fleet_steps_report_dead_sensors_and_spikes(tmp_path: Path) -> None:
    rim = [0.1, 0.1, 0.1, -3.3, -3.3, 0.2, 0.2, 0.3, 1.4, 1.5]  # a jump that lasts is none
    rows = [f"{0.001 * index},2,2,0.5,0.0,{speed},0.1,11.4" for index, speed in enumerate(rim)]
    (tmp_path / "robot.csv").write_text(FLEET + "\n".join(rows) + "\n")
    recording = read_fleet_steps(tmp_path / "robot.csv")
    assert np.isnan(recording["motor.1.current"]).all()
    np.testing.assert_array_equal(np.isnan(recording["motor.0.speed"]), [0, 0, 0, 1, 1, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(recording["motor.0.rim_speed"], rim)
    assert recording.problems == [
        "motor 0: -3.3 m/s is impossible between the values before and after it",
        "motor 1: the current is 0.0 A at most: dead",
    ]


def test_run_with_a_single_row(tmp_path: Path) -> None:
    assert len(read_run(session(tmp_path, run="0,0,0,0,0,0\n") / "run-01.csv")) == 1
