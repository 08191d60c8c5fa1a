"""Short drives of one blind robot, with another battery each time: what they tell as one."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import pytest

from blind.generator import Blind, make
from blind.hidden import Hidden
from blind.plant import NEUTRAL
from csv_files import write_csv_file
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.result import Verdict
from raccoon.sim.effects.parameters import Parameters
from simulated_drives import BLIND_CONTROLLER

known = partial(diagnose, firmware=BLIND_CONTROLLER)
VOLTS = (6.8, 6.6, 6.95, 6.5)
HOT = Hidden("motor.heating", None, {"gain": 1.0}, {"heat_gain": 1.0, "heat_tau": 14.0})
WEAK = Hidden("motor.back_emf_constant", "left", {"factor": 0.9}, {"ke_l": 0.9 * NEUTRAL["ke_l"]})


def drives(hidden: Hidden, count: int, seconds: float) -> list[Blind]:
    days = [Hidden("day", None, {}, {"voc": volts}) for volts in VOLTS[:count]]
    return [make(9000 + day, [hidden, each], seconds=seconds, robot=4) for day, each in enumerate(days)]


def test_motors_that_heat_show_in_three_drives_of_seven_seconds_and_not_in_one() -> None:
    """Among what makes a robot slower, and what may be another in each drive."""
    kinds = ("motor.", "battery.", "friction.", "drive.slope", "drive.inertia", "imu.gyro_bias")
    asked = [each for each in drive_causes() if each.id.startswith(kinds)]
    first, *others = (each.columns for each in drives(HOT, 3, 7.0))
    assert known(first, RobotConfig(), causes=asked).verdict is Verdict.ADEQUATE
    found = known(first, RobotConfig(), more=others, causes=asked)
    (heating,) = found.causes
    assert heating.name == "motor.heating"
    gain = heating.parameters["gain"]
    assert gain.value == pytest.approx(1.0, abs=2.5 * gain.std)
    own = ("each recording began", "each of several recordings has its own")
    unasked = {each.id for each in found.rejected if any(why in each.reason for why in own)}
    assert {"drive.slope", "battery.open_circuit_voltage", "imu.gyro_bias"} <= unasked


def test_two_batteries_are_no_cause_of_both_drives() -> None:
    """One of 0.05 ohm and one of 0.16 were one of 0.13 ohm, with a probability of 1."""
    days = [Hidden("day", None, {}, {"rint": ohm}) for ohm in (0.05, 0.16)]
    first, other = (make(9000 + day, [each], seconds=7.0, robot=4).columns for day, each in enumerate(days))
    found = known(first, RobotConfig(), more=[other])
    assert found.causes == ()
    (told,) = (each for each in found.notes if each.startswith("the recordings do not share a battery"))
    low, high = (float(each) for each in re.findall(r"(\d\.\d+) ohm", told))
    assert (low, high) == pytest.approx((0.05, 0.16), abs=0.015)


def test_drives_are_fitted_together_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a robot of which only motors are asked after: the way is the same, and shorter."""
    asked = [each for each in drive_causes() if each.id.startswith("motor.")]
    monkeypatch.setattr("raccoon.diagnose.recordings.drive.drive_causes", lambda: asked)
    files = [
        write_csv_file(tmp_path / f"{day}.csv", each.columns) for day, each in enumerate(drives(WEAK, 2, 5.0))
    ]
    out, model = tmp_path / "out.json", tmp_path / "model.toml"
    saved = ["--json", str(out), "--save-model", str(model)]
    assert main(["diagnose", "--together", *map(str, files), *saved]) == 0
    found = json.loads(out.read_text())
    assert [each["id"] for each in found["causes"]] == ["motor.back_emf_constant"]
    assert "Note: recordings that are fitted together: 1 0.csv, 2 1.csv" in capsys.readouterr().out
    parameters = Parameters.from_model_file(model)
    assert parameters.value("motor.back_emf_constant", "factor", "left") == pytest.approx(0.9, abs=0.03)
    assert parameters.provenance.recording == "2 recordings together"
