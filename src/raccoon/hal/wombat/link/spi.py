"""The SPI bus to the co-processor."""

from __future__ import annotations

from raccoon.core.errors import HardwareError
from raccoon.core.extras import install
from raccoon.core.fork_ownership import leave_in_forks

SPI_DEVICE = "/dev/spidev0.0"
SPEED_HZ = 16_000_000
"""Clock rate of the bus, Hz, which both firmwares accept."""
GAP_US = 50
"""Pause that the co-processor needs after each frame, us."""
NO_WOMBAT = (
    "on a computer that is not a Wombat run a program with `raccoon simulate PROGRAM`, or write "
    'port = "sim" under [controller] in robot.toml'
)


class SpiLink:
    """The Wombat's SPI bus through spidev (`pip install '.[wombat]'` in the clone), for this program alone.

    Raises HardwareError if spidev or the device is missing, access is denied or another program owns the bus;
    the message says what to do.
    """

    def __init__(self, device: str = SPI_DEVICE) -> None:
        try:
            import spidev
        except ImportError:
            raise HardwareError(
                f"the package spidev is missing: {install('wombat')}, or apt install python3-spidev;"
                f" {NO_WOMBAT}"
            ) from None  # on a laptop the traceback ends with the remedy
        from raccoon.hal.wombat.link.lock import BusLock  # only on Linux; the emulator runs anywhere

        self._device = device
        self.lock = BusLock(device)
        self._spi = spidev.SpiDev()
        self._open = True
        leave_in_forks(self)
        try:
            self._configure()
        except HardwareError:
            self.close()
            raise

    def _configure(self) -> None:
        device = self._device
        try:
            self._spi.open_path(device)
            # The settings of the last program that used the device persist.
            self._spi.mode = 0
            self._spi.bits_per_word = 8
            self._spi.max_speed_hz = SPEED_HZ
        except FileNotFoundError:
            raise HardwareError(
                f"{device} does not exist: enable SPI (dtparam=spi=on in config.txt); {NO_WOMBAT}"
            ) from None
        except PermissionError as error:
            raise HardwareError(f"{device} is not permitted: add your user to the group spi") from error
        except OSError as error:
            raise HardwareError(f"{device} cannot be opened: {error}") from error

    @property
    def target(self) -> str:
        """The bus in the notation of the supervisor, `spi:DEVICE:HERTZ`."""
        return f"spi:{self._device}:{SPEED_HZ}"

    def transfer(self, frame: bytes) -> bytes:
        """One SPI transfer followed by the pause that the co-processor needs."""
        if not self._open:
            raise HardwareError(f"{self._device} is closed")
        try:
            return bytes(self._spi.xfer2(frame, SPEED_HZ, GAP_US))
        except OSError as error:
            raise HardwareError(f"a transfer on {self._device} failed: {error}") from error

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: a forked process would keep the bus in use after this program's
        end."""
        self.close()

    def close(self) -> None:
        """Close the device and release it for others."""
        if self._open:
            self._open = False
            self._spi.close()
            self.lock.release()
