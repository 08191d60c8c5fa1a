"""The program's end of the supervisor: starts it, and tells it now and then that the program is alive."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from raccoon.core.errors import HardwareError
from raccoon.core.fork_ownership import leave_in_forks

SILENCE_SECONDS = 0.5
"""A program that says nothing for so long hangs."""
BEAT_SECONDS = 0.1
"""Beats more often than that are not passed on: the supervisor need not wake up for each cycle."""
START_SECONDS = 10.0
"""An interpreter that has not started by then hangs; a busy Raspberry Pi 3 takes one or two."""


class Supervisor:
    """A process of its own that stops the motors when this one is killed, crashes or hangs.

    target: where the stop goes, `spi:DEVICE:HERTZ` or `unix:PATH`. frames: what stops. A program that lives
    and says nothing for half a second gets what `hold` was told last instead, where it was told something.
    keep: descriptors that the process inherits and so keeps open until the motors are stopped (the lock of
    the bus). Raises HardwareError where it cannot be started.
    """

    def __init__(
        self,
        target: str,
        frames: Sequence[bytes],
        *,
        keep: Sequence[int] = (),
    ) -> None:
        script = Path(__file__).with_name("stopper.py")
        # Isolated, without site packages: it starts fast and stays small.
        command = [sys.executable, "-I", "-S", "-B", str(script), target, str(SILENCE_SECONDS)]
        # Memory that both see: a servo on its way changes the frame in every cycle and need wake up nobody.
        self._held = os.memfd_create("raccoon-hold")
        try:
            self._process = subprocess.Popen(
                [*command, str(self._held), *(frame.hex() for frame in frames)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=(self._held, *keep),
                start_new_session=True,  # Ctrl-C at the terminal is for the program, not for its supervisor
            )
        except OSError as error:
            os.close(self._held)
            raise HardwareError(f"the supervisor process cannot be started: {error}") from error
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._lifeline = self._process.stdin.fileno()
        self._next_beat = 0.0
        self._closed = False
        said, _, _ = select.select([self._process.stdout], [], [], START_SECONDS)
        if not said or self._process.stdout.read(1) != b"r":
            self._process.kill()
            self.close()
            raise HardwareError(
                "the supervisor process did not start: nobody would stop the motors of a dead program"
            )
        os.set_blocking(self._lifeline, False)
        leave_in_forks(self)

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    def beat(self) -> None:
        """Say that the program is alive. Raises HardwareError where the supervisor is gone."""
        now = time.monotonic()
        if now < self._next_beat:
            return
        self._next_beat = now + BEAT_SECONDS
        try:
            os.write(self._lifeline, b".")
        except BlockingIOError:  # it is busy stopping motors, and will read on
            return
        except OSError as error:
            raise HardwareError(f"the supervisor process {self.pid} is gone: restart the program") from error

    def hold(self, frame: bytes) -> None:
        """What is sent from now on while the program lives and says nothing; always of the same length."""
        try:
            os.pwrite(self._held, frame, 0)
        except OSError as error:
            raise HardwareError(f"the supervisor process cannot be told what to hold: {error}") from error

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: with a copy of the lifeline it would miss this program's end."""
        if not self._closed:
            self._closed = True
            assert self._process.stdin is not None
            self._process.stdin.close()
            os.close(self._held)

    def close(self, *, stopped: bool = True) -> None:
        """End it. stopped: the motors are off; otherwise it stops them first. May be called twice."""
        if self._closed:
            return
        self._closed = True
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            if stopped:
                os.write(self._lifeline, b"q")
        except OSError:
            pass
        self._process.stdin.close()
        self._process.stdout.close()
        os.close(self._held)
        try:
            self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
