"""robot.toml names the port, and nothing else is opened in its place."""

import math
from pathlib import Path

import pytest

from raccoon import RobotConfig, deg, open_robot, seq, straight, turn, wait
from raccoon.core.config import ControllerConfig
from raccoon.core.errors import HardwareError

MISSION = seq(wait(0.5), straight(0.10), turn(deg(45)))


@pytest.mark.parametrize("kind", ["sim", "emulator", "emulator-raccoon"])
def test_one_mission_runs_on_the_simulator_and_on_both_emulated_firmwares(kind: str) -> None:
    config = RobotConfig(controller=ControllerConfig(port=kind))
    with open_robot(config, seed=2) as robot:
        robot.run(MISSION)
        assert robot.pose.x == pytest.approx(0.10, abs=0.005)
        assert math.degrees(robot.pose.heading) == pytest.approx(45.0, abs=0.5)


@pytest.mark.parametrize("kind", ["wombat", "wombat-raccoon", "create"])
def test_missing_hardware_is_an_error_not_a_simulation(kind: str) -> None:
    config = RobotConfig(controller=ControllerConfig(port=kind))
    with pytest.raises((HardwareError, ImportError)), open_robot(config):
        pass  # pragma: no cover - there is no such controller here


def test_the_path_of_robot_toml_is_opened() -> None:
    config = RobotConfig(controller=ControllerConfig(port="create", device="/dev/not-plugged-in"))
    with pytest.raises(HardwareError, match="/dev/not-plugged-in"), open_robot(config):
        pass  # pragma: no cover - there is no such device


def test_a_run_is_recorded_where_asked(tmp_path: Path) -> None:
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    with open_robot(config, record=tmp_path / "run") as robot:
        robot.run(wait(0.05))
        robot.note("halfway")
        robot.run(wait(0.05))
    assert [path.name for path in tmp_path.iterdir()] == ["run.jsonl.gz"]
