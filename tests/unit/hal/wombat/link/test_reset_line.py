"""The reset line, by the system calls it makes."""

import os
import struct
from pathlib import Path

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.link.reset_line import GpioResetLine


def test_the_reset_line_is_pulled_low_and_released(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    chip, line = tmp_path / "gpiochip0", tmp_path / "line"
    chip.touch()
    line.touch()
    handle = os.open(line, os.O_RDWR)
    calls: list[tuple[int, bytes]] = []

    def ioctl(_descriptor: int, request: int, argument: bytes | bytearray) -> int:
        calls.append((request, bytes(argument)))
        if isinstance(argument, bytearray):
            struct.pack_into("=i", argument, 360, handle)
        return 0

    monkeypatch.setattr("raccoon.hal.wombat.link.reset_line.fcntl.ioctl", ioctl)
    monkeypatch.setattr("raccoon.hal.wombat.link.reset_line.PULSE_SECONDS", 0.0)
    GpioResetLine(str(chip)).pulse()
    (get, request), (put, values) = calls
    assert (get, put) == (0xC16CB403, 0xC040B409)
    offset, flags = struct.unpack_from("=I", request)[0], struct.unpack_from("=I", request, 256)[0]
    assert (offset, flags, request[260], len(request)) == (23, 2, 0, 364)
    assert values == b"\1".ljust(64, b"\0")
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.close(handle)  # given back


def test_a_missing_reset_line_is_a_hardware_error(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"reset line \(pin 23"):
        GpioResetLine(str(tmp_path / "none")).pulse()
