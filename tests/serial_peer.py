"""The other end of a serial line: a pseudo-terminal under a fixed path, with a plug that can be pulled."""

from __future__ import annotations

import fcntl
import os
import select
import sys
import termios
import time
import tty
from pathlib import Path

ARRIVAL = 0.1
"""s"""


class SerialPeer:
    """A device on the far side of `path`; `say` what it sends, `heard` what it was told."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master = self._slave = -1
        self.plug()

    def plug(self) -> None:
        self._master, self._slave = os.openpty()
        # Raw from the start: otherwise the terminal echoes and changes line ends before our side sets it up.
        tty.setraw(self._slave)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))

    def reset_settings(self) -> None:
        """Those of a device that was plugged in anew: another speed, and line ends are changed."""
        settings = termios.tcgetattr(self._slave)
        settings[1] |= termios.OPOST | termios.ONLCR
        settings[4] = settings[5] = termios.B9600
        termios.tcsetattr(self._slave, termios.TCSANOW, settings)

    @property
    def speed(self) -> int:
        """As our side has set it, one of `termios.B...`."""
        return int(termios.tcgetattr(self._slave)[5])

    def unplug(self) -> None:
        self.path.unlink(missing_ok=True)
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def say(self, data: bytes) -> None:
        """Send it, and see it arrive: the kernel carries it over on its own time, and a frame of two that are
        there would be read without the other. One that a thread of ours reads meanwhile is not waited for."""
        there = self._arrived()
        assert os.write(self._master, data) == len(data)
        deadline = time.monotonic() + ARRIVAL
        while self._arrived() < there + len(data) and time.monotonic() < deadline:
            os.sched_yield()

    def _arrived(self) -> int:
        """Bytes that our side could read."""
        return int.from_bytes(fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4)), sys.byteorder)

    def heard(self, timeout: float = 0.0) -> bytes:
        """Everything told so far; waits up to `timeout` s for the first byte."""
        data = b""
        while select.select([self._master], [], [], timeout)[0]:
            data += os.read(self._master, 4096)
            timeout = 0.0
        return data
