"""`raccoon excite`: advice in words, and a rehearsal on a simulated robot that has a fault."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from raccoon.cli.main import main
from raccoon.core.config import RobotConfig
from raccoon.sim.model_file import save_model
from raccoon.sim.parameters import Parameters

ROBOT_TOML = '[controller]\nport = "wombat"\n'


@pytest.fixture
def robot_toml(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT_TOML)
    return path


def test_the_advice_names_the_nearest_rival(robot_toml: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["excite", "--robot", str(robot_toml), "--cause", "friction.viscous"]) == 0
    said = capsys.readouterr().out
    assert "least told from" in said.splitlines()[0]
    evidence = [float(each) for each in re.findall(r"evidence +([\d.]+)", said)]
    assert evidence == sorted(evidence, reverse=True)
    assert evidence[0] > 0.0


def test_a_fault_that_was_rehearsed_is_found(
    robot_toml: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, run = tmp_path / "model.toml", tmp_path / "run.jsonl.gz"
    late = Parameters(RobotConfig(), {("actuation.latency", None): {"seconds": 0.03}})
    save_model(late, model)
    command = ["excite", "--robot", str(robot_toml), "--manoeuvre", "steps", "--simulate"]
    assert main([*command, "--model", str(model), "--record", str(run)]) == 0
    capsys.readouterr()
    assert main(["diagnose", str(run), "--robot", str(robot_toml)]) == 0
    said = capsys.readouterr().out
    assert "30 ms late" in said


def test_a_robot_with_tophats_drives_a_model_that_names_none(robot_toml: Path, tmp_path: Path) -> None:
    robot_toml.write_text(ROBOT_TOML + "[tophat.front]\nanalog = 0\n")
    model, run = tmp_path / "model.toml", tmp_path / "run.jsonl.gz"
    model.write_text('[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.2 }\n')
    command = ["excite", "--robot", str(robot_toml), "--manoeuvre", "steps", "--simulate"]
    assert main([*command, "--model", str(model), "--record", str(run)]) == 0
    assert run.exists()


def test_a_model_of_a_real_robot_is_refused(
    robot_toml: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["excite", "--robot", str(robot_toml), "--manoeuvre", "spin"]
    assert main([*command, "--model", str(tmp_path / "model.toml")]) == 2
    assert "add --simulate" in capsys.readouterr().err


def test_without_a_question_it_says_what_to_ask(robot_toml: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["excite", "--robot", str(robot_toml)]) == 2
    assert "--manoeuvre" in capsys.readouterr().err
