"""The real bus at its edges."""

import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.link import lock
from raccoon.hal.wombat.link.spi import SpiLink


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


def test_a_process_that_was_forked_does_not_keep_the_bus(spi: type[FakeSpi]) -> None:
    link = SpiLink("/dev/spidev7.0")
    heard, told = os.pipe()
    child = os.fork()
    if child == 0:  # pragma: no cover - in the child, which outlives the link
        os.close(told)
        os.read(heard, 1)
        os._exit(0)
    try:
        link.close()
        SpiLink("/dev/spidev7.0").close()
    finally:
        os.close(told)
        os.close(heard)
        os.waitpid(child, 0)


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
        (FileNotFoundError(), r'enable SPI .*; on a computer that is not a Wombat run .* port = "sim"'),
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
    with pytest.raises(
        HardwareError, match=r"pip install '\.\[wombat\]'.*; on a computer that is not a Wombat"
    ):
        SpiLink()
