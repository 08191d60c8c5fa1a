"""`raccoon excite`: advice in words, and a rehearsal on a simulated robot that has a fault."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from raccoon.cli.main import main
from raccoon.core.config import RobotConfig
from raccoon.diagnose.experiment import advice as experiment_advice
from raccoon.diagnose.experiment.advice import Advice
from raccoon.diagnose.experiment.manoeuvres import CHECKUP, MANOEUVRES, manoeuvre
from raccoon.sim.effects.model_file import save_model
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.loading import load_run

Excite = Callable[..., int]
ROBOT_TOML = '[controller]\nport = "wombat"\n'


@pytest.fixture
def robot_toml(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT_TOML)
    return path


@pytest.fixture
def excite(robot_toml: Path) -> Excite:
    """`raccoon excite` of that robot, with these words."""
    return lambda *words: main(["excite", "--robot", str(robot_toml), *map(str, words)])


def test_the_advice_names_the_nearest_rival(
    excite: Excite, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert excite("--cause", "friction.viscous") == 0
    said, doing = capsys.readouterr()
    assert "s: what creep would show" in doing
    assert "hardest to tell from" in said.splitlines()[0]
    evidence = [float(each) for each in re.findall(r"evidence +([\d.]+)", said)]
    assert evidence == sorted(evidence, reverse=True)
    assert evidence[0] > 30.0
    assert "\nA drive with an evidence of 30 or more is decisive.\n" in said
    best = said.partition("  ")[0]
    assert said.endswith(f"\nnothing was driven: --record FILE drives '{best}' and records it\n")


def test_the_nearest_other_cause_is_none_of_the_given_rivals(
    excite: Excite, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It read as if the rival that was asked about had been left out."""
    advice = Advice("steps", 40.0, 0.1, 9.6, "drive.backlash@left")
    monkeypatch.setattr(experiment_advice, "rank_manoeuvres", lambda *_, **__: [advice])
    assert excite("--cause", "imu.latency", "--rival", "drive.wheel_slip") == 0
    said = capsys.readouterr().out.splitlines()[0]
    assert said.endswith("9.6 s, besides drive.wheel_slip hardest to tell from drive.backlash@left")
    assert excite("--cause", "imu.latency") == 0
    assert capsys.readouterr().out.splitlines()[0].endswith("9.6 s, hardest to tell from drive.backlash@left")


@pytest.mark.usefixtures("few_causes")
def test_a_fault_that_was_rehearsed_is_found(
    robot_toml: Path,
    excite: Excite,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    short = manoeuvre("steps")[:1200]
    monkeypatch.setitem(MANOEUVRES, "steps", lambda: short)
    model, run = tmp_path / "model.toml", tmp_path / "run.jsonl.gz"
    late = Parameters(RobotConfig(), {("actuation.latency", None): {"seconds": 0.03}})
    save_model(late, model)
    assert excite("--manoeuvre", "steps", "--simulate", "--model", model, "--record", run) == 0
    capsys.readouterr()
    assert main(["diagnose", str(run), "--robot", str(robot_toml)]) == 0
    said = capsys.readouterr().out
    assert "30 ms late" in said


def test_another_seed_is_another_drive_of_the_same_robot(
    excite: Excite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns, short = [], manoeuvre("steps")[:300]
    monkeypatch.setitem(MANOEUVRES, "steps", lambda: short)
    for name, seed in (("a", "0"), ("b", "0"), ("c", "5")):
        run = tmp_path / f"{name}.jsonl.gz"
        command = ["--manoeuvre", "steps", "--simulate"]
        assert excite(*command, "--seed", seed, "--record", run) == 0
        columns.append(load_run(run).recording.columns)
    gyros = [each["imu.gyro.z"] for each in columns]
    np.testing.assert_array_equal(gyros[0], gyros[1])
    assert not np.array_equal(gyros[0], gyros[2])
    np.testing.assert_array_equal(columns[0]["motor.0.duty"], columns[2]["motor.0.duty"])
    assert excite(*command, "--seed", "-1") == 2


def test_a_simulated_drive_says_its_seed(excite: Excite, tmp_path: Path) -> None:
    run = tmp_path / "run.jsonl"
    assert excite("--manoeuvre", "still", "--simulate", "--seed", "7", "--record", run) == 0
    header = json.loads(gzip.decompress((tmp_path / "run.jsonl.gz").read_bytes()).splitlines()[0])
    assert header["seed"] == 7


def test_the_file_that_was_written_is_named_and_not_another_that_is_there(
    excite: Excite, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    short = manoeuvre("still")[:20]
    monkeypatch.setitem(MANOEUVRES, "still", lambda: short)
    other = tmp_path / "run.csv"
    other.write_text("t\n0\n")
    command = ["--manoeuvre", "still", "--simulate"]
    assert excite(*command, "--record", other) == 0
    assert capsys.readouterr().out.endswith(f"{other}.jsonl.gz: recorded 'still'\n")
    assert excite(*command, "--cause", "drive.backlash") == 2
    assert "--manoeuvre still is driven whatever the cause; leave one out" in capsys.readouterr().err


def test_a_robot_with_tophats_drives_a_model_that_names_none(
    robot_toml: Path, excite: Excite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = manoeuvre("steps")[:100]
    monkeypatch.setitem(MANOEUVRES, "steps", lambda: short)
    robot_toml.write_text(ROBOT_TOML + "[tophat.front]\nanalog = 0\n")
    model, run = tmp_path / "model.toml", tmp_path / "run.jsonl.gz"
    model.write_text('[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.2 }\n')
    assert excite("--manoeuvre", "steps", "--simulate", "--model", model, "--record", run) == 0
    assert run.exists()


def test_a_file_of_effects_alone_is_a_fault_of_the_robot_of_robot_toml(
    robot_toml: Path, excite: Excite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was one of the default robot, and its diagnosis six causes that tell the two apart."""
    short = manoeuvre("still")[:20]
    monkeypatch.setitem(MANOEUVRES, "still", lambda: short)
    fault, run = tmp_path / "fault.toml", tmp_path / "run.jsonl.gz"
    robot_toml.write_text(ROBOT_TOML + "[model.battery]\nopen_circuit_voltage = 8.2\n")
    fault.write_text('[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.2 }\n')
    assert excite("--manoeuvre", "still", "--simulate", "--model", fault, "--record", run) == 0
    assert np.median(load_run(run).recording.columns["battery.voltage"]) == pytest.approx(8.2, abs=0.02)


def test_a_simulated_robot_has_the_free_space_that_the_drive_needs(
    robot_toml: Path, excite: Excite, tmp_path: Path
) -> None:
    run = tmp_path / "run.jsonl.gz"
    robot_toml.write_text('[controller]\nport = "sim"\nrate_hz = 50.0\n')
    assert excite("--manoeuvre", "circles", "--record", run) == 0
    # A wall of the usual table would hold it at -0.51.
    assert load_run(run).recording.columns["truth.y"].min() < -0.52


def test_a_model_of_a_real_robot_is_refused(
    excite: Excite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert excite("--manoeuvre", "spin", "--model", tmp_path / "model.toml") == 2
    assert "add --simulate" in capsys.readouterr().err


def test_without_a_question_it_is_the_checkup_and_what_that_would_show(
    excite: Excite, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    a_quarter = manoeuvre(CHECKUP)[:2000]
    monkeypatch.setitem(MANOEUVRES, CHECKUP, lambda: a_quarter)
    assert excite() == 0
    head, _, *causes = capsys.readouterr().out.splitlines()
    assert head.startswith("checkup: ")
    assert re.search(r"drive\.backlash +from about 0\.00\d+ rad on", "\n".join(causes))


def test_a_drive_that_needs_more_room_than_there_is_is_not_driven(
    excite: Excite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run.jsonl.gz"
    assert excite("--simulate", "--within", "0.5", "--record", run) == 2
    assert "--within 0.5: checkup needs 0.79 m" in capsys.readouterr().err
    assert not run.exists()


def test_a_recording_that_is_there_is_kept_and_nothing_is_driven(
    excite: Excite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run.jsonl.gz"
    run.write_bytes(b"kept")
    assert excite("--simulate", "--record", run) == 2
    assert "it already exists; choose another name" in capsys.readouterr().err
    assert run.read_bytes() == b"kept"


@pytest.mark.parametrize("wrong", [("--within", "nan"), ("--within", "-1"), ("--seconds", "0")])
def test_room_and_time_are_numbers_above_0(
    excite: Excite, capsys: pytest.CaptureFixture[str], wrong: tuple[str, str]
) -> None:
    assert excite(*wrong) == 2
    assert f"{wrong[0]} is {float(wrong[1])}: allowed are numbers above 0" in capsys.readouterr().err


def test_a_drive_that_lasts_longer_than_allowed_is_not_driven(
    excite: Excite, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run.jsonl.gz"
    assert excite("--simulate", "--seconds", "20", "--record", run) == 2
    assert "--seconds 20: checkup takes 39.6 s" in capsys.readouterr().err
    assert not run.exists()


def test_an_evidence_that_does_not_decide_is_said_not_to(
    excite: Excite, capsys: pytest.CaptureFixture[str]
) -> None:
    assert excite("--cause", "drive.inertia", "--within", "0.03") == 0
    spin, said, _ = capsys.readouterr().out.splitlines()
    assert spin.startswith("spin")
    assert "None of them is decisive (that needs an evidence of 30" in said


def test_a_drive_that_shows_nothing_is_not_to_be_repeated(
    excite: Excite, capsys: pytest.CaptureFixture[str]
) -> None:
    """Back and forth never turns: many of it say as little of the track as one."""
    assert excite("--cause", "drive.track_width", "--within", "0.3", "--seconds", "8") == 0
    said = capsys.readouterr().out
    assert "None of them shows it, however often it is driven" in said


def test_a_base_without_a_gyro_is_promised_nothing_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    create = tmp_path / "create.toml"
    create.write_text('[controller]\nport = "create"\n')
    assert main(["excite", "--robot", str(create), "--manoeuvre", "creep", "--within", "0.01"]) == 2
    assert "no gyro: its drive shows less" in capsys.readouterr().out


def test_a_rival_of_nothing_is_refused(excite: Excite, capsys: pytest.CaptureFixture[str]) -> None:
    assert excite("--rival", "imu.latency") == 2
    assert "name the --cause" in capsys.readouterr().err


def test_room_and_an_empty_battery_are_said_before_a_robot_drives(
    robot_toml: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It drove off at once, as a robot does whose team believes that it only advises."""
    short = manoeuvre("spin")[80:100]
    monkeypatch.setitem(MANOEUVRES, "spin", lambda: short)
    robot_toml.write_text(
        '[controller]\nport = "emulator-raccoon"\n[model.battery]\nopen_circuit_voltage = 5.0\n'
    )
    command = ["excite", "--robot", str(robot_toml), "--manoeuvre", "spin", "--record"]
    assert main([*command, str(tmp_path / "run")]) == 0
    said = capsys.readouterr().err
    room, battery = said.splitlines()
    assert re.fullmatch(
        r"the robot will drive: put it on the floor with 0\.\d\d m free .* on every side", room
    )
    assert re.match(r"battery: [45]\.\d\d V is below the weakest battery of the match \(6.10 V\)", battery)
    robot_toml.write_text('[controller]\nport = "emulator-raccoon"\n')
    assert main([*command, str(tmp_path / "full"), "--simulate"]) == 0
    assert capsys.readouterr().err == ""
