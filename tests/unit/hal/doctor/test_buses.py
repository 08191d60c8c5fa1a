"""What the doctor tells about I2C and USB."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from i2c_fake import Chip, FakeI2c
from raccoon.core.errors import HardwareError
from raccoon.hal.doctor import Verdict
from raccoon.hal.doctor.buses import list_i2c_devices, list_serial_ports
from raccoon.hal.i2c import I2cBus


@dataclass
class Plugged:
    device: str
    vid: int | None = None
    pid: int | None = None
    product: str | None = None
    manufacturer: str | None = None


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> FakeI2c:
    fake = FakeI2c({0x69: Chip(), 0x41: Chip(), 0x20: Chip()})
    fake.drivers = {0x68}
    return fake.put_in(monkeypatch)


@pytest.fixture
def path(tmp_path: Path) -> str:
    (tmp_path / "i2c-1").touch()
    return str(tmp_path / "i2c-1")


def test_addresses_are_told_with_who_probably_lives_there(kernel: FakeI2c, path: str) -> None:
    finding = list_i2c_devices(path)
    assert finding.verdict is Verdict.OK
    assert finding.measured == (
        "0x20 unknown device, 0x41 probably an INA monitor, 0x68 the clock DS1340, 0x69 probably an MPU"
    )


def test_a_bus_without_devices_is_well(kernel: FakeI2c, path: str) -> None:
    kernel.chips, kernel.drivers = {}, set()
    assert list_i2c_devices(path).measured == "nothing answers"


def test_a_stuck_bus_is_a_warning_with_its_cause(kernel: FakeI2c, path: str) -> None:
    kernel.stuck = True
    finding = list_i2c_devices(path)
    assert finding.verdict is Verdict.WARNING
    assert "the bus is stuck or disturbed" in finding.problem


def test_a_computer_without_a_bus_is_not_ill(tmp_path: Path) -> None:
    assert list_i2c_devices(str(tmp_path / "none")).verdict is Verdict.NOT_CHECKED


def test_a_bus_that_may_not_be_opened_is_told_but_no_illness(path: str) -> None:
    def forbidden(_: str) -> I2cBus:
        raise HardwareError("permission denied; add the user to the group i2c")

    finding = list_i2c_devices(path, forbidden)
    assert finding.verdict is Verdict.NOT_CHECKED
    assert "group i2c" in finding.measured


def test_usb_devices_are_told_by_name() -> None:
    ports = [
        Plugged("/dev/ttyAMA0"),
        Plugged("/dev/ttyACM0", 0x0483, 0x5740, "STM32 Virtual ComPort"),
        Plugged("/dev/ttyUSB0", 0x0403, 0x6015, "FT231X"),
        Plugged("/dev/ttyUSB1", 0x1234, 0x0001),
    ]
    finding = list_serial_ports(lambda: ports)
    assert finding.verdict is Verdict.OK
    assert finding.measured == "/dev/ttyACM0 calibration board, /dev/ttyUSB0 FT231X, /dev/ttyUSB1 1234:0001"


def test_no_usb_device_is_not_ill() -> None:
    finding = list_serial_ports(lambda: [Plugged("/dev/ttyAMA0")])
    assert finding.verdict is Verdict.NOT_CHECKED
    assert finding.measured == "none"
