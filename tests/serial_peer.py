"""The other end of a serial line: a pseudo-terminal under a fixed path, with a plug that can be pulled."""

from __future__ import annotations

import os
import select
import tty
from pathlib import Path


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

    def unplug(self) -> None:
        self.path.unlink(missing_ok=True)
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def say(self, data: bytes) -> None:
        assert os.write(self._master, data) == len(data)

    def heard(self, timeout: float = 0.0) -> bytes:
        """Everything told so far; waits up to `timeout` s for the first byte."""
        data = b""
        while select.select([self._master], [], [], timeout)[0]:
            data += os.read(self._master, 4096)
            timeout = 0.0
        return data
