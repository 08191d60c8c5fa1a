"""A serial line that survives being unplugged, and never makes its reader wait longer than it says.

pyserial's own defaults wait for ever, share a port with any other program and leave an unplugged device to
the caller; here every wait has an end, the port is taken exclusively, and a lost device is opened again.
"""

from __future__ import annotations

import contextlib
import errno
import select
from typing import Protocol

from raccoon.core.clock import Clock
from raccoon.core.errors import HardwareError

RETRY = 0.5
"""s from one attempt to open a device again to the next."""
WRITE_TIMEOUT = 0.02
"""s; a command is a few bytes and the kernel buffers 4096, so only a dead line takes that long."""
CHUNK_LIMIT = 4096
"""Most bytes taken in one read, so that a flood cannot hold up the cycle."""


class SerialDevice(Protocol):
    """The part of `serial.Serial` that a line uses."""

    def fileno(self) -> int: ...

    def read(self, size: int = 1) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


def open_serial(path: str, baud: int) -> SerialDevice:
    """Open `path` at `baud`, 8N1, for us alone; neither reads nor writes ever block for long.

    Raises OSError (serial.SerialException is one) when it cannot.
    """
    import termios

    import serial

    try:
        return serial.Serial(path, baud, timeout=0, write_timeout=WRITE_TIMEOUT, exclusive=True)
    except termios.error as error:  # no OSError; a plug that bounces is gone again between open and set-up
        raise OSError(*error.args) from error


class SerialLine:
    """Bytes to and from one device; after an unplug it is opened again, every RETRY s at most.

    `openings` counts successful openings: a protocol that sees it change must start from the beginning.
    Raises HardwareError when the device cannot be opened the first time.
    """

    def __init__(self, path: str, baud: int, clock: Clock) -> None:
        self.path = path
        self.openings = 0
        self._baud = baud
        self._clock = clock
        self._device: SerialDevice | None = None
        self._closed = False
        self._next_attempt = clock.now()
        try:
            self._open()
        except OSError as error:
            raise HardwareError(f"serial port {path}: {_reason(error)}") from error

    @property
    def connected(self) -> bool:
        return self._device is not None

    def read(self, timeout: float) -> bytes:
        """What has arrived, at the latest after `timeout` s; empty on silence and while unplugged."""
        if self._device is None and not self._reopen():
            self._pause(timeout)
            return b""
        device = self._device
        assert device is not None
        try:
            ready, _, _ = select.select([device.fileno()], [], [], timeout)
            return device.read(CHUNK_LIMIT) if ready else b""
        except (OSError, ValueError):  # ValueError: a descriptor that is already gone
            self._drop()
            return b""

    def write(self, data: bytes) -> bool:
        """Send `data`; False where it could not be sent whole (unplugged, or the line does not take it)."""
        if self._device is None:
            return False
        try:
            return self._device.write(data) == len(data)
        except OSError as error:
            if not _is_timeout(error):
                self._drop()
            return False

    def reopen(self) -> None:
        """Let a device go that is open but dead; the next read after the retry time opens it again."""
        self._next_attempt = self._clock.now() + RETRY
        self._drop()

    def close(self) -> None:
        """Give the device back. May be called twice."""
        self._closed = True
        self._drop()

    def _open(self) -> None:
        self._next_attempt = self._clock.now() + RETRY
        self._device = open_serial(self.path, self._baud)
        self.openings += 1

    def _reopen(self) -> bool:
        if self._closed or self._clock.now() < self._next_attempt:
            return False
        try:
            self._open()
        except OSError:
            return False
        return True

    def _drop(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            with contextlib.suppress(OSError):  # an unplugged device has nothing left to restore
                device.close()

    def _pause(self, timeout: float) -> None:
        # Without a device nothing else paces the caller, and a loop without a pause would eat the processor.
        if timeout > 0.0:
            self._clock.sleep_until(self._clock.now() + timeout)


def _is_timeout(error: OSError) -> bool:
    from serial import SerialTimeoutException

    return isinstance(error, SerialTimeoutException)


def _reason(error: OSError) -> str:
    """What went wrong and what to do about it."""
    if error.errno == errno.ENOENT:
        return "there is no such device; is it plugged in? (ls /dev/ttyUSB* /dev/ttyACM*)"
    if error.errno == errno.EACCES:
        return (
            "permission denied; add the user to the group dialout (sudo usermod -aG dialout $USER) "
            "and log in again"
        )
    if error.errno in (errno.EBUSY, errno.EAGAIN):
        return "another program has it open; stop that program"
    return str(error)
