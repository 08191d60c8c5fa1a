"""The real bus at its edges: spidev, lock, reset line, supervisor target."""

import os
import struct
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat import lock, stopper
from raccoon.hal.wombat.link import SpiLink
from raccoon.hal.wombat.lock import BusLock, refuse_other_owners
from raccoon.hal.wombat.reset_line import GpioResetLine


class FakeSpi:
    """What spidev.SpiDev offers, as far as the link needs it."""

    failure: OSError | None = None
    transfers: list[tuple[bytes, int, int]]

    def __init__(self) -> None:
        self.mode = self.bits_per_word = 99
        self.max_speed_hz = 1
        self.transfers = []
        self.closed = False

    def open_path(self, path: str) -> None:
        if self.failure is not None:
            raise self.failure
        self.path = path

    def xfer2(self, frame: bytes, speed_hz: int, delay_us: int) -> list[int]:
        self.transfers.append((frame, speed_hz, delay_us))
        if self.closed:
            raise OSError("gone")
        return [0x4A, *frame[1:]]

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def spi(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> type[FakeSpi]:
    class Spi(FakeSpi):
        pass

    module: Any = ModuleType("spidev")
    module.SpiDev = Spi
    monkeypatch.setitem(sys.modules, "spidev", module)
    monkeypatch.setattr(lock, "LOCK_FOLDERS", (tmp_path,))
    return Spi


def test_the_bus_is_set_up_and_used(spi: type[FakeSpi]) -> None:
    link = SpiLink("/dev/spidev7.0")
    fake: Any = link._spi
    assert (fake.path, fake.mode, fake.bits_per_word, fake.max_speed_hz) == (
        "/dev/spidev7.0",
        0,
        8,
        16_000_000,
    )
    assert link.transfer(bytes(3)) == b"\x4a\0\0"
    assert fake.transfers == [(bytes(3), 16_000_000, 50)]
    assert link.target == "spi:/dev/spidev7.0:16000000"
    link.close()
    link.close()
    with pytest.raises(HardwareError, match="is closed"):
        link.transfer(bytes(3))


def test_a_failing_transfer_is_a_hardware_error(spi: type[FakeSpi]) -> None:
    link = SpiLink("/dev/spidev7.0")
    fake: Any = link._spi
    fake.closed = True
    with pytest.raises(HardwareError, match=r"a transfer on /dev/spidev7.0 failed: gone"):
        link.transfer(bytes(3))
    link.close()


@pytest.mark.parametrize(
    ("failure", "advice"),
    [
        (FileNotFoundError(), r'enable SPI .*; on a computer that is no Wombat, write port = "sim"'),
        (PermissionError(), "add your user to the group spi"),
        (OSError("strange"), "cannot be opened: strange"),
    ],
)
def test_a_bus_that_cannot_be_opened_says_what_to_do(
    spi: type[FakeSpi], failure: OSError, advice: str
) -> None:
    spi.failure = failure
    with pytest.raises(HardwareError, match=advice):
        SpiLink("/dev/spidev7.0")
    spi.failure = None
    SpiLink("/dev/spidev7.0").close()  # the lock was released


def test_a_missing_package_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(HardwareError, match=r"pip install '\.\[wombat\]'.*; on a computer that is no Wombat"):
        SpiLink()


def test_one_program_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock, "WAIT_SECONDS", 0.0)
    first = BusLock("/dev/spidev7.0", folder=tmp_path)
    with pytest.raises(HardwareError, match=rf"in use by another robot program \(process {os.getpid()}\)"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    first.release()
    first.release()
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_a_dead_program_leaves_no_lock(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from raccoon.hal.wombat.lock import BusLock;"
        " BusLock('/dev/spidev7.0', folder=Path(sys.argv[1])); os._exit(1)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_the_lock_file_is_for_every_user(tmp_path: Path) -> None:
    path = tmp_path / "raccoon-spidev7.0.lock"
    before = os.umask(0o077)
    try:
        BusLock("/dev/spidev7.0", folder=tmp_path).release()
        assert path.stat().st_mode & 0o777 == 0o666
        path.chmod(0o644)  # of an older version
        BusLock("/dev/spidev7.0", folder=tmp_path).release()
        assert path.stat().st_mode & 0o777 == 0o666
    finally:
        os.umask(before)


def refusing(monkeypatch: pytest.MonkeyPatch, *ways: int) -> None:
    """The kernel as somebody meets it who may not open the file these ways, nor make one of this name."""
    opened = os.open

    def refuse(path: Path, flags: int, *mode: int) -> int:
        if flags & os.O_CREAT or flags & os.O_ACCMODE in ways:
            raise PermissionError(13, "Permission denied")
        return opened(path, flags, *mode)

    monkeypatch.setattr(os, "open", refuse)


def test_a_lock_file_of_another_user_is_locked_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "WAIT_SECONDS", 0.0)
    path = tmp_path / "raccoon-spidev7.0.lock"
    path.write_text("999999999\n")
    refusing(monkeypatch, os.O_RDWR)
    first = BusLock("/dev/spidev7.0", folder=tmp_path)
    with pytest.raises(HardwareError, match=r"in use by another robot program \(process unknown\)"):
        BusLock("/dev/spidev7.0", folder=tmp_path)
    first.release()
    BusLock("/dev/spidev7.0", folder=tmp_path).release()


def test_a_lock_file_that_may_not_even_be_read_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "raccoon-spidev7.0.lock"
    path.touch()
    refusing(monkeypatch, os.O_RDWR, os.O_RDONLY)
    with pytest.raises(HardwareError, match=f"Permission denied; delete it with `sudo rm {path}`"):
        BusLock("/dev/spidev7.0", folder=tmp_path)


def process(proc: Path, number: int, name: str, opened: str | None = None) -> None:
    folder = proc / str(number) / "fd"
    folder.mkdir(parents=True)
    (proc / str(number) / "comm").write_text(f"{name}\n")
    if opened is not None:
        (folder / "3").symlink_to(opened)


def test_the_raccoon_service_is_named_with_the_cure(tmp_path: Path) -> None:
    process(tmp_path, 321, "stm32_data_read")  # names are cut to 15 characters
    with pytest.raises(HardwareError, match=r"process 321.*systemctl stop stm32_data_reader"):
        refuse_other_owners("/dev/spidev0.0", tmp_path)


def test_any_program_with_the_bus_open_is_named(tmp_path: Path) -> None:
    process(tmp_path, 322, "my_robot", "/dev/spidev0.0")
    with pytest.raises(HardwareError, match=r"my_robot \(process 322\).*kill 322"):
        refuse_other_owners("/dev/spidev0.0", tmp_path)


def test_the_screen_and_strangers_do_not_matter(tmp_path: Path) -> None:
    process(tmp_path, 323, "botui", "/dev/spidev0.0")
    process(tmp_path, 324, "other", "/dev/null")
    process(tmp_path, os.getpid(), "python", "/dev/spidev0.0")
    (tmp_path / "uptime").write_text("1")
    refuse_other_owners("/dev/spidev0.0", tmp_path)


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

    monkeypatch.setattr("raccoon.hal.wombat.reset_line.fcntl.ioctl", ioctl)
    monkeypatch.setattr("raccoon.hal.wombat.reset_line.PULSE_SECONDS", 0.0)
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
