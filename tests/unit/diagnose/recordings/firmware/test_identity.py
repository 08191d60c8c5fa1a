"""Recordings that do not name their firmware, and who does in their place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from blind.generator import make
from blind.hidden import Hidden
from emulated_drives import record_emulated_drive
from raccoon.cli.diagnose.job import Job, diagnose_job
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.firmware.identity import (
    BY_PORT_NOTE,
    DeadZone,
    detect_dead_zone,
    identify_firmware,
)
from raccoon.diagnose.recordings.firmware.recognition import recognise_firmware
from raccoon.diagnose.result import Verdict
from raccoon.hal.wombat.firmware.devices import STOCK
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.csv import write_csv
from raccoon.trace.recording import Recording

ROBOT = RobotConfig()


@pytest.fixture(scope="module")
def stock() -> Recording:
    """A sound robot behind the stock firmware, as a logger without a header has it."""
    duty = exciting(np.random.default_rng(5), 8.0)
    made = record_emulated_drive("stock", Parameters.from_robot(ROBOT), duty, seed=1)
    return Recording(made.columns, [], SI_WORDS, [])


def resting(edge: int, zeros: int = 400, offset: int = 0) -> dict[str, NDArray[np.float64]]:
    """Readings of every size that a firmware shows as 0 below an edge, and of a rest."""
    sizes = np.abs(np.arange(-60.0, 61.0).repeat(3))
    shown = np.concatenate([np.where(sizes < edge, 0.0, sizes), np.zeros(zeros)]) + offset
    return {"motor.0.bemf": shown, "motor.1.bemf": -shown}


def begun(columns: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """The first seconds, which take less time, without counters."""
    return {name: each[:800] for name, each in columns.items() if not name.endswith("position")}


def test_the_smallest_readings_tell_the_zone() -> None:
    for edge, zone in ((0, DeadZone.NONE), (10, DeadZone.STOCK), (25, DeadZone.RACCOON_21)):
        assert detect_dead_zone(resting(edge), ROBOT) is zone
    assert detect_dead_zone(resting(10, offset=12), ROBOT) is not DeadZone.STOCK  # an offset is no zone
    assert detect_dead_zone({"motor.0.bemf": np.zeros(500)}, ROBOT) is DeadZone.UNKNOWN


def test_a_recording_of_the_stock_firmware_is_as_good_as_one_that_names_it(stock: Recording) -> None:
    """As CSV it was a resistance 28 % too high."""
    found = diagnose_recording(stock.columns, ROBOT, port="wombat")
    assert (found.verdict, found.causes) == (Verdict.ADEQUATE, ())
    assert BY_PORT_NOTE.format("wombat") in found.notes
    assert any("the stock firmware" in each for each in found.notes)


def test_the_stock_firmware_is_recognised_where_nobody_names_it(stock: Recording) -> None:
    """A search without it found up to seven causes of a sound robot, and took minutes."""
    made_by = recognise_firmware(
        identify_firmware(SI_WORDS, stock.columns, ROBOT, None), stock.columns, ROBOT
    )
    assert (made_by.device.name, made_by.is_external) == (STOCK.name, True)
    assert "treated as one" in made_by.notes[0]


def test_without_counters_it_is_recognised_by_how_its_wheels_answer(stock: Recording) -> None:
    made_by = identify_firmware(SI_WORDS, stock.columns, ROBOT, None)
    assert recognise_firmware(made_by, begun(stock.columns), ROBOT).device.name == STOCK.name


def test_a_dead_zone_of_its_own_is_no_firmware() -> None:
    zone = Hidden("bemf.dead_zone", None, {"counts": 11.0}, {"dead_zone": 11.0})
    columns = make(3, [zone], seconds=8.0).columns
    made_by = identify_firmware(SI_WORDS, columns, ROBOT, None)
    assert made_by.candidate is not None
    assert recognise_firmware(made_by, begun(columns), ROBOT) is made_by


def test_the_words_of_a_recording_that_was_named_from_outside_are_not_believed(stock: Recording) -> None:
    wrong = {**stock.columns, "imu.gyro.z": stock.columns["imu.gyro.z"] * 57.3}
    with pytest.raises(Exception, match="degrees"):
        diagnose_recording(wrong, ROBOT, port="wombat")


def test_what_the_readings_say_goes_before_robot_toml() -> None:
    for edge, port in ((10, "wombat-raccoon"), (0, "wombat"), (25, "wombat")):
        told = identify_firmware(SI_WORDS, resting(edge), ROBOT, port)
        assert told.device is SI_WORDS
        assert f'controller.port = "{port}" is not used' in told.notes[0]
    assert (
        identify_firmware(SI_WORDS, resting(25), ROBOT, "wombat-raccoon").device.name == "wombat-raccoon-21"
    )
    assert identify_firmware(SI_WORDS, resting(0), ROBOT, "wombat-raccoon").device.name == "wombat-raccoon-17"
    assert identify_firmware(STOCK, resting(25), ROBOT, "wombat-raccoon").device is STOCK  # it names itself
    (said,) = identify_firmware(STOCK, resting(25), ROBOT, "wombat-raccoon").notes
    assert said.startswith('controller.port = "wombat-raccoon" is not used: the recording says that wombat-')
    assert identify_firmware(STOCK, resting(25), ROBOT, "wombat").notes == ()
    assert identify_firmware(replace(STOCK, name="sim"), resting(25), ROBOT, "wombat").notes == ()
    (said,) = identify_firmware(SI_WORDS, resting(10), ROBOT, None).notes
    assert said.startswith("no back-EMF is between 0 and 10 counts, as on a Wombat with the stock firmware")
    assert identify_firmware(SI_WORDS, resting(0), ROBOT, "sim").notes == ()


def test_robot_toml_says_it_where_the_line_is_written(
    stock: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str | None] = []
    monkeypatch.setattr(
        "raccoon.diagnose.recordings.diagnosis.diagnose_recording", lambda *_, port, **__: said.append(port)
    )
    write_csv(Recording(stock.columns, [], SI_WORDS, []), tmp_path / "run.csv")
    robot = tmp_path / "robot.toml"
    for line, port in (("", None), ('port = "wombat"', None), ("", "wombat")):
        robot.write_text(f"[controller]\n{line}\n")
        diagnose_job(Job(tmp_path / "run.csv", robot, None, None, False, port=port))
    assert said == [None, "wombat", "wombat"]
