"""A serial line that survives being unplugged and whose reads have a time-out.

By default pyserial waits for ever, shares a port with any other program and leaves an unplugged device to the
caller. Here every wait is bounded, the port is opened exclusively, and a lost device is opened again.
"""

from __future__ import annotations

import contextlib
import errno
import select
from typing import Protocol

from raccoon.core.clock import Clock
from raccoon.core.errors import HardwareError

RETRY = 0.5
"""s between two attempts to open a lost device again."""
WRITE_TIMEOUT = 0.02
"""Time-out of a write, s: a command is a few bytes and the kernel buffers 4096, so only a dead line takes
that long."""
CHUNK_LIMIT = 4096
"""Most bytes read at once, so that a flood of data cannot hold up the cycle."""


class SerialDevice(Protocol):
    """The part of `serial.Serial` that a line uses."""

    def fileno(self) -> int: ...

    def read(self, size: int = 1) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


def open_serial(path: str, baud: int) -> SerialDevice:
    """Open `path` at `baud`, 8N1, exclusively; reads do not block and writes not longer than the time-out.

    Raises OSError (serial.SerialException is one) if that fails.
    """
    import termios

    import serial

    try:
        return serial.Serial(path, baud, timeout=0, write_timeout=WRITE_TIMEOUT, exclusive=True)
    except termios.error as error:  # is no OSError; occurs if the contact bounces between open and set-up
        raise OSError(*error.args) from error


class SerialLine:
    """A byte stream to and from one device; after an unplug the device is opened again, at most every RETRY
    s.

    `openings` counts successful openings: a protocol that sees it change must start from the beginning.
    Raises HardwareError if the device cannot be opened the first time.
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
        """The bytes received, after at most `timeout` s; empty on silence and while unplugged."""
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
        """Send `data`; False if it was not sent completely (unplugged, or the line does not accept it)."""
        if self._device is None:
            return False
        try:
            return self._device.write(data) == len(data)
        except OSError as error:
            if not _is_timeout(error):
                self._drop()
            return False

    def reopen(self) -> None:
        """Close a device that is open but dead; the next read after the retry time opens it again."""
        self._next_attempt = self._clock.now() + RETRY
        self._drop()

    def close(self) -> None:
        """Close the device. May be called twice."""
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
        # Without a device nothing else paces the caller; a loop without a pause would use a whole core.
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
