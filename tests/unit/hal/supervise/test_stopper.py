"""The process that stops motors, as far as it can be looked at from inside."""

import errno
import os
import struct
import termios
from pathlib import Path

import pytest

from raccoon.hal.supervise import stopper


def test_the_supervisor_speaks_to_the_bus_by_system_calls(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import ctypes
    import fcntl

    device = tmp_path / "spidev"
    device.touch()
    seen: list[tuple[int, bytes]] = []

    def ioctl(_descriptor: int, request: int, argument: bytes) -> int:
        if request == 0x40206B00:
            sent, _, length = struct.unpack_from("=QQI", argument)
            seen.append((request, ctypes.string_at(sent, length)))
            assert struct.unpack_from("=IHBB", argument, 20) == (16_000_000, 50, 8, 0)
            assert len(argument) == 32
        else:
            seen.append((request, argument))
        return 0

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    stopper.send_spi(f"{device}:16000000", [b"abc", b"de"])
    assert seen == [
        (0x40016B01, b"\0"),
        (0x40016B03, b"\x08"),
        (0x40046B04, struct.pack("=I", 16_000_000)),
        (0x40206B00, b"abc"),
        (0x40206B00, b"de"),
    ]


def test_a_serial_device_that_is_gone_again_while_it_is_set_up_does_not_end_the_supervisor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def gone(*_: object) -> None:
        raise termios.error(errno.EIO, "Input/output error")

    monkeypatch.setattr(termios, "tcgetattr", gone)
    with pytest.raises(OSError, match="Input/output error"):  # which it says, and watches on
        stopper.send_tty(f"{os.devnull}:115200", [b"\0"])
