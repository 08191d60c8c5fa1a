"""`raccoon doctor` on simulated and emulated robots, whole and broken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from faulty_robot import FaultyRobot
from raccoon.cli.main import main
from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.core.errors import HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import STOP
from raccoon.hal.doctor import Finding, Verdict, examine
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.sim.effects.parameters import Parameters

TOPHAT = RobotConfig(tophats={"front": TophatConfig(analog=0)})


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No robot.toml nearby but the test's own."""
    monkeypatch.chdir(tmp_path)


def doctor(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    """Exit status and findings by subject."""
    status = main(["doctor", "--json", *arguments])
    printed = json.loads(capsys.readouterr().out)
    assert printed["well"] is (status == 0)
    return status, {each["subject"]: each for each in printed["findings"]}


def test_the_simulated_robot_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    status, findings = doctor(capsys, "--port", "sim")
    assert status == 0
    assert findings["wiring signs"]["verdict"] == "ok"


@pytest.mark.parametrize("firmware", ["stock", "21"])
def test_the_emulated_wombat_is_well(capsys: pytest.CaptureFixture[str], firmware: str) -> None:
    status, findings = doctor(capsys, "--port", "emulator", "--firmware", firmware)
    assert status == 0, findings
    assert firmware in findings["controller"]["measured"]
    assert findings["motor 0"]["values"]["bemf_forward_counts"] > 400


@pytest.mark.parametrize("port", ["sim", "emulator-raccoon"])
def test_a_firmware_that_is_not_examined_is_refused(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--port", port, "--firmware", "17"]) == 2
    said = f"--firmware 17: it is an option of --port emulator, and {port} is examined"
    assert said in capsys.readouterr().err


def test_the_table_is_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--port", "sim"]) == 0
    printed = capsys.readouterr()
    assert printed.out.splitlines()[0].split()[:2] == ["controller", "ok"]
    assert "the robot will move" in printed.err
    assert "moving the left wheel" in printed.err


def test_nothing_moves_without_permission(capsys: pytest.CaptureFixture[str]) -> None:
    _, findings = doctor(capsys, "--port", "sim", "--no-motion")
    assert findings["motors"]["verdict"] == "not checked"


def test_robot_toml_is_found_and_believed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    # The simulated robot is wired as its file says; a model that is far from the robot shows.
    (tmp_path / "robot.toml").write_text('[controller]\nport = "sim"\n[tophat.front]\nanalog = 3\n')
    status, findings = doctor(capsys)
    assert status == 0
    assert findings["analog 3 (front)"]["verdict"] == "ok"


def test_a_file_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--robot", "nowhere.toml"]) == 2
    assert "nowhere.toml" in capsys.readouterr().err


def given(monkeypatch: pytest.MonkeyPatch, port: Port | HardwareError) -> None:
    """Let the command find this port, or this error, instead of real hardware."""

    def opened(config: RobotConfig) -> Port:
        if isinstance(port, HardwareError):
            raise port
        return port

    monkeypatch.setattr("raccoon.robot.opening.open_port", opened)


def test_a_controller_that_cannot_be_opened_is_a_finding(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    given(monkeypatch, HardwareError("/dev/spidev0.0 does not exist: enable SPI"))
    status, findings = doctor(capsys, "--port", "wombat", "--i2c", str(tmp_path / "none"))
    assert status == 1
    assert findings["controller"]["problem"] == "/dev/spidev0.0 does not exist: enable SPI"
    assert {"usb serial", f"i2c {tmp_path / 'none'}"} <= set(findings)


def test_ctrl_c_stops_and_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = FaultyRobot(interrupts_at=400)
    given(monkeypatch, robot)
    assert main(["doctor", "--port", "wombat"]) == 130
    assert robot.closed == 1
    assert robot.written[-1] == STOP


def test_motors_that_could_not_be_stopped_are_the_last_finding(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Deaf(FaultyRobot):
        def close(self) -> None:
            if not self.closed:
                super().close()
                raise HardwareError("the motors may still run: switch it off")

    given(monkeypatch, Deaf())
    status, findings = doctor(capsys, "--port", "wombat", "--no-motion", "--i2c", str(tmp_path / "none"))
    assert status == 1
    assert findings["controller"]["problem"] == "the motors may still run: switch it off"


def test_a_bug_on_the_way_stops_and_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    class Buggy(FaultyRobot):
        def _gyro(self) -> tuple[float, float, float] | None:
            if self._cycle == 320:
                raise ZeroDivisionError
            return super()._gyro()

    robot = Buggy()
    given(monkeypatch, robot)
    with pytest.raises(ZeroDivisionError):
        main(["doctor", "--port", "wombat"])
    assert robot.closed == 1
    assert robot.written[-1] == STOP


def broken(move: bool, firmware: Firmware = "stock", **faults: Any) -> tuple[Emulator, dict[str, Finding]]:
    """An emulated Wombat with these fault switches thrown after it was opened, and what was found wrong."""
    port = open_emulated(TOPHAT, firmware)
    link = port._link
    assert isinstance(link, Emulator)
    for name, value in faults.items():
        setattr(link.faults, name, value)
    report = examine(port, TOPHAT, move=move)
    port.close()
    wrong = [each for each in report.findings if each.verdict in (Verdict.FAULT, Verdict.WARNING)]
    return link, {each.subject: each for each in wrong}


@pytest.mark.parametrize(
    ("faults", "subject"),
    [
        ({"floating": {0}}, "analog 0 (front)"),
        ({"saturated": {0: 4095}}, "analog 0 (front)"),
        ({"gyro_sweep": True}, "imu"),
        ({"imu_frozen": True, "firmware": 21}, "imu"),
        ({"silent": 0}, "controller"),
        ({"silent": 0xFF}, "controller"),
        ({"wrong_version": True, "firmware": 21}, "controller"),
    ],
)
def test_a_broken_wombat_is_seen_through_at_rest(faults: dict[str, Any], subject: str) -> None:
    _, wrong = broken(False, **faults)
    assert wrong[subject].verdict is Verdict.FAULT


def test_a_broken_wombat_is_seen_through_when_it_moves() -> None:
    link, wrong = broken(True, stalled={0}, blown_fuse={1}, bemf_offset=(60.0, 0.0, 0.0, 0.0))
    assert wrong["motor 0"].problem == "the motor does not answer"
    assert wrong["motor 1"].problem == "the motor does not answer"
    assert not link.motors_running


def test_a_stock_firmware_that_ignores_commands_is_seen_through_when_it_should_move() -> None:
    _, wrong = broken(True, wrong_version=True)
    assert "did not reach the registers" in wrong["controller"].problem


def test_another_build_of_the_firmware_is_told_with_what_to_write() -> None:
    clock = SteppedClock()
    link = Emulator(SimulatedPlant(Parameters.from_robot(TOPHAT)), clock=clock, build="published")
    port = WombatPort(link, clock=clock)
    report = examine(port, TOPHAT)
    port.close()
    rate = next(each for each in report.findings if each.subject == "rate")
    assert rate.verdict is Verdict.WARNING
    assert rate.remedy.startswith("write counter_rate_hz = 26")


def test_a_frozen_main_loop_is_told_first_and_nothing_runs_on() -> None:
    link, wrong = broken(True, frozen=True)
    assert next(iter(wrong)) == "link"
    assert not link.motors_running
