"""The program's side of the supervisor: starts the process and signals to it that the program is alive."""

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
"""s without a beat after which a program counts as hanging."""
BEAT_SECONDS = 0.1
"""Shortest time between two beats that are passed on, s: the supervisor need not wake up in each cycle."""
START_SECONDS = 10.0
"""s after which an interpreter that has not started hangs; a busy Raspberry Pi 3 takes 1 to 2 s."""


class Supervisor:
    """A separate process that stops the motors if this one is killed, crashes or hangs.

    target: where the frames are sent, `spi:DEVICE:HERTZ`, `tty:DEVICE:BAUD` or `unix:PATH`. frames: those
    that stop everything. If the program lives but sends no beat for half a second, the last frame given to
    `hold` is sent instead, if there is one. keep: descriptors (the lock of the bus) that the process
    inherits, so that they stay open until the motors are stopped. Raises HardwareError if the process cannot
    be started.
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
        # Shared memory: a moving servo changes the frame in every cycle, which must not wake up the process.
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
                "the supervisor process did not start: nothing would stop the motors if the program dies"
            )
        os.set_blocking(self._lifeline, False)
        leave_in_forks(self)

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    def beat(self) -> None:
        """Signal that the program is alive. Raises HardwareError if the supervisor is gone."""
        now = time.monotonic()
        if now < self._next_beat:
            return
        self._next_beat = now + BEAT_SECONDS
        try:
            os.write(self._lifeline, b".")
        except BlockingIOError:  # the supervisor is busy stopping motors; it reads later
            return
        except OSError as error:
            raise HardwareError(f"the supervisor process {self.pid} is gone: restart the program") from error

    def hold(self, frame: bytes) -> None:
        """Set the frame that is sent if the program lives but is silent. All these frames must have one
        length. Raises HardwareError if that fails."""
        try:
            os.pwrite(self._held, frame, 0)
        except OSError as error:
            raise HardwareError(f"the supervisor process cannot be told what to hold: {error}") from error

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: with a copy of the lifeline in a forked process, the supervisor
        would not notice this program's end."""
        if not self._closed:
            self._closed = True
            assert self._process.stdin is not None
            self._process.stdin.close()
            os.close(self._held)

    def close(self, *, stopped: bool = True) -> None:
        """End the process. stopped: the motors are off; otherwise the process stops them first. May be called
        twice."""
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
