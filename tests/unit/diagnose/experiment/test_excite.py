from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HardwareError
from raccoon.core.readings import Inputs
from raccoon.diagnose.experiment.drive_manoeuvre import drive_and_record
from raccoon.diagnose.experiment.manoeuvres import manoeuvre
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.trace.loading import load_run

ROBOT = RobotConfig()


def test_a_manoeuvre_is_driven_in_the_simulator_and_recorded(tmp_path: Path) -> None:
    robot = replace(ROBOT, controller=replace(ROBOT.controller, port="sim"))
    duty = manoeuvre("spin")[:200]
    drive_and_record(robot, duty, tmp_path / "run.jsonl.gz")
    columns = load_run(tmp_path / "run.jsonl.gz").recording.columns
    assert columns["t"][-1] - columns["t"][0] == pytest.approx(1.0, abs=0.02)
    assert np.nanmax(columns["motor.1.duty"]) == pytest.approx(0.8)
    assert np.nanmax(columns["motor.1.bemf"]) > 500.0


def test_where_there_is_a_recording_already_the_port_is_closed_again(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl.gz"
    path.write_bytes(b"kept")
    port = SimPort(Parameters.from_robot(ROBOT))
    with pytest.raises(FileExistsError):
        drive_and_record(ROBOT, manoeuvre("spin")[:20], path, port)
    with pytest.raises(HardwareError, match="closed"):
        port.read()
    assert path.read_bytes() == b"kept"


class Ended(SimPort):
    """A robot in the midst of whose drive the system ends the program."""

    def read(self) -> Inputs:
        inputs = super().read()
        if inputs.time > 0.1:
            signal.raise_signal(signal.SIGTERM)
        return inputs


def test_a_program_that_is_ended_in_the_midst_of_a_drive_stops_and_keeps_the_recording(
    tmp_path: Path,
) -> None:
    port, path = Ended(Parameters.from_robot(ROBOT)), tmp_path / "run.jsonl.gz"
    with pytest.raises(SystemExit) as ended:
        drive_and_record(ROBOT, manoeuvre("spin")[:200], path, port)
    assert ended.value.code == 128 + signal.SIGTERM
    with pytest.raises(HardwareError, match="closed"):
        port.write(None)  # type: ignore[arg-type]
    assert load_run(path).recording.columns["t"][-1] == pytest.approx(0.1, abs=0.011)
