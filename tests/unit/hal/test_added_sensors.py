"""Sensors around a port: recorded cycles are the same again, and no two sensors get in each other's way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bench_robot import BenchRobot
from faulty_robot import FaultyRobot
from i2c_fake import FakeI2c, Ina226Chip, MpuChip
from raccoon.core.clock import Clock, RealClock, SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.core.readings import STOP, Fault, Inputs
from raccoon.hal.calibration_board import BAUD, CalibrationBoard, ReferencePort
from raccoon.hal.i2c import BatteryMonitorPort, I2cBus, ImuPort, Ina226, Mpu, PowerSample, Sampler
from raccoon.hal.serial_line import SerialLine
from raccoon.hal.wombat.emulator import Emulator
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.opening import open_robot
from raccoon.trace.record import RecordingPort
from raccoon.trace.replay import ReplayPort
from serial_peer import SerialPeer


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[SerialPeer]:
    device = SerialPeer(tmp_path / "ttyACM0")
    yield device
    device.unplug()


@pytest.mark.parametrize("clock", [RealClock(), SteppedClock()], ids=["real", "stepped"])
def test_a_wrapped_controller_is_as_punctual_as_a_bare_one(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, peer: SerialPeer
) -> None:
    entered: list[str] = []

    @contextmanager
    def noted() -> Iterator[None]:
        entered.append("punctual")
        yield

    monkeypatch.setattr("raccoon.robot.opening.punctual", noted)
    FakeI2c({0x69: MpuChip(), 0x40: Ina226Chip()}).put_in(monkeypatch)
    (tmp_path / "i2c-1").touch()
    bus = I2cBus(str(tmp_path / "i2c-1"))
    gyro, power = Mpu(bus), Ina226(bus, shunt=0.005)
    board = CalibrationBoard(SerialLine(str(peer.path), BAUD, clock), clock)
    port = WombatPort(Emulator(BenchRobot(), "stock", clock=clock), clock=clock)
    sensing = BatteryMonitorPort(ImuPort(port, Sampler(gyro, 1.0, clock), gyro), Sampler(power, 1.0, clock))
    recorded = RecordingPort(ReferencePort(sensing, board), tmp_path / "run")
    with open_robot(RobotConfig(), port=recorded):
        assert entered == ["punctual"] * isinstance(clock, RealClock)
    bus.close()


def test_a_recording_gives_back_what_every_added_sensor_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, peer: SerialPeer
) -> None:
    gyro_chip, power_chip = MpuChip(), Ina226Chip()
    kernel = FakeI2c({0x69: gyro_chip, 0x40: power_chip}).put_in(monkeypatch)
    (tmp_path / "i2c-1").touch()
    bus, clock = I2cBus(str(tmp_path / "i2c-1")), SteppedClock()
    gyro = Mpu(bus)
    turning = Sampler(gyro, 0.004, clock)
    power: Sampler[PowerSample] = Sampler(Ina226(bus, shunt=0.005), 0.01, clock)
    board = CalibrationBoard(SerialLine(str(peer.path), BAUD, clock), clock)
    sensing = ReferencePort(BatteryMonitorPort(ImuPort(FaultyRobot(), turning, gyro), power), board)
    seen: list[Inputs] = []
    recorded = RecordingPort(sensing, tmp_path / "run")
    for cycle in range(200):
        gyro_chip.motion = (0, 0, 20 * (cycle % 50))
        power_chip.measure(6.5, 0.0001 * (cycle % 70))
        kernel.stuck = 60 <= cycle < 120  # long enough for both sensors to be lost, and to come back
        turning.step()
        if cycle % 2:
            power.step()
        clock.advance(0.005)
        seen.append(recorded.read())
        recorded.write(STOP)
    recorded.close()
    assert all(len(set(each.faults)) == len(each.faults) for each in seen)
    lost = [cycle for cycle, each in enumerate(seen) if Fault.SENSOR_LOST in each.faults]
    assert set(range(85, 120)) <= set(lost)
    assert seen[-1].gyro is not None
    replay = ReplayPort(recorded.path, check=False)
    assert [replay.read() for _ in seen] == seen
    bus.close()
