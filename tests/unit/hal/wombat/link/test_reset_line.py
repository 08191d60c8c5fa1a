"""The reset line, by the system calls it makes."""

import os
import struct
from pathlib import Path

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.link.reset_line import GpioResetLine

Calls = list[tuple[int, bytes]]


@pytest.fixture
def chip(tmp_path: Path) -> Path:
    path = tmp_path / "gpiochip0"
    path.touch()
    return path


@pytest.fixture
def line(tmp_path: Path) -> int:
    """The descriptor that the kernel gives for the pin."""
    return os.open(tmp_path / "line", os.O_RDWR | os.O_CREAT)


@pytest.fixture
def calls(line: int, monkeypatch: pytest.MonkeyPatch) -> Calls:
    made: Calls = []

    def ioctl(_descriptor: int, request: int, argument: bytes | bytearray) -> int:
        made.append((request, bytes(argument)))
        if isinstance(argument, bytearray):
            struct.pack_into("=i", argument, 360, line)
        return 0

    monkeypatch.setattr("raccoon.hal.wombat.link.reset_line.fcntl.ioctl", ioctl)
    monkeypatch.setattr("raccoon.hal.wombat.link.reset_line.PULSE_SECONDS", 0.0)
    return made


def given_back(line: int) -> bool:
    try:
        os.close(line)
    except OSError:
        return True
    return False


def test_the_reset_line_is_pulled_low_and_released(chip: Path, line: int, calls: Calls) -> None:
    GpioResetLine(str(chip)).pulse()
    (get, request), (put, values) = calls
    assert (get, put) == (0xC16CB403, 0xC040B409)
    offset, flags = struct.unpack_from("=I", request)[0], struct.unpack_from("=I", request, 256)[0]
    assert (offset, flags, request[260], len(request)) == (23, 2, 0, 364)
    assert values == b"\1".ljust(64, b"\0")
    assert given_back(line)


def test_a_pulse_that_is_interrupted_leaves_the_line_high(
    chip: Path, line: int, calls: Calls, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.hal.wombat.link.reset_line.time.sleep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        GpioResetLine(str(chip)).pulse()
    assert [values[0] for request, values in calls if request == 0xC040B409] == [1]
    assert given_back(line)


def test_a_missing_reset_line_is_a_hardware_error(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"reset line \(pin 23"):
        GpioResetLine(str(tmp_path / "none")).pulse()
