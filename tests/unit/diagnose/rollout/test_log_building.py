"""What a log is understood to be before anything is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.battery_timing import BATTERY_AFTER_COMMAND_NOTE
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.log_building import build_log

ROBOT = RobotConfig()


def driven_straight_and_turned_on_one_wheel() -> dict[str, np.ndarray]:
    """Ten seconds: a second forwards and one back, and every four seconds a turn on the left wheel alone."""
    time = 0.005 * np.arange(2000)
    way = np.where(time % 2.0 < 1.0, 0.8, -0.8)
    duty = {0: way, 1: np.where(time % 4.0 < 3.0, way, 0.0)}
    keep = np.exp(-0.005 / 0.03)
    speed = {port: lfilter([1.0 - keep], [1.0, -keep], 5.5 * each) for port, each in duty.items()}
    drive = ROBOT.model.drive
    counts = ROBOT.model.left.back_emf_constant.value / BEMF_VOLTS_PER_COUNT
    noise = np.random.default_rng(1)
    turn = drive.wheel_radius.value / drive.track_width.value * (speed[1] - speed[0])
    columns = {"t": time, "imu.gyro.z": turn + 0.003 * noise.standard_normal(len(time))}
    for port, each in duty.items():
        columns[f"motor.{port}.duty"] = each
        columns[f"motor.{port}.bemf"] = counts * speed[port] + 3.0 * noise.standard_normal(len(time))
    return columns


def test_a_motor_of_the_other_sign_is_no_robot_in_a_hand_all_the_time() -> None:
    """What it did straight ahead turned the robot "as no wheel did", and too little was left to be judged."""
    columns = driven_straight_and_turned_on_one_wheel()
    assert not build_log([columns], ROBOT, None).held
    other = {name: -each if name.startswith("motor.1") else each for name, each in columns.items()}
    with pytest.raises(TraceError, match=r"motor 1 turns the other way .* inverted = true under"):
        build_log([other], ROBOT, None)


@pytest.mark.parametrize("made_by", [None, "simulator", "wombat-stock", "wombat-raccoon-21"])
def test_a_wheel_that_stood_is_said_and_left_out_whoever_made_the_recording(made_by: str | None) -> None:
    """Of a recording that names its firmware, as raccoon's own do, it was forgotten again."""
    columns = driven_straight_and_turned_on_one_wheel()
    del columns["imu.gyro.z"]
    unplugged = (columns["t"] >= 4.3) & (columns["t"] < 5.9)
    columns["motor.0.bemf"] = np.where(unplugged, np.sin(50.0 * columns["t"]), columns["motor.0.bemf"])
    log = build_log([columns], ROBOT, None if made_by is None else FIRMWARES[made_by])
    ((column, text),) = log.stalls
    assert column == "motor.0.duty"
    assert text.startswith("from 4.3 to 5.9 s motor 0 (left) did not turn")
    left = log.wheel("left")
    assert left is not None
    assert np.isnan(left.values[unplugged]).all()
    assert any(start <= 4.35 and end >= 5.85 for start, end in log.lost)


@pytest.mark.parametrize("named_beside", [True, False])
def test_a_logger_of_ones_own_may_read_the_battery_after_the_command(named_beside: bool) -> None:
    """Of a CSV whose firmware was said with --port that was found out, and forgotten again."""
    columns = driven_straight_and_turned_on_one_wheel()
    sag = np.zeros(len(columns["t"]))
    for port in (0, 1):
        duty, volts = columns[f"motor.{port}.duty"], BEMF_VOLTS_PER_COUNT * columns[f"motor.{port}.bemf"]
        sag += 0.1 * duty * (6.8 * duty - volts) / 1.8
    columns["battery.voltage"] = 6.8 - sag
    made_by = replace(FIRMWARES["wombat-raccoon-21"], is_named_by_recording=not named_beside)
    assert (BATTERY_AFTER_COMMAND_NOTE in build_log([columns], ROBOT, made_by).notes) is named_beside
