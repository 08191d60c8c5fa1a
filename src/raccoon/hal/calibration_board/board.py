"""The calibration board on its USB line, polled once a cycle without waiting."""

from __future__ import annotations

from raccoon.core.clock import Clock
from raccoon.core.readings import Status, Truth
from raccoon.hal.calibration_board.frames import BoardStatus, FrameDecoder, ImuSample
from raccoon.hal.calibration_board.tracker import CENTRED, FlowTracker, Mounting
from raccoon.hal.serial_line import SerialLine

BAUD = 921_600
"""A USB line has no rate; the board ignores the number."""
FRESH_S = 0.1
"""s without a frame after which the board counts as silent and its pose is not used."""
DEAD_S = 2.0
"""s without an IMU sample after which the line is opened again."""


class CalibrationBoard:
    """The newest pose and turn rate of the board behind `line`."""

    def __init__(self, line: SerialLine, clock: Clock, mounting: Mounting = CENTRED) -> None:
        self.tracker = FlowTracker(mounting)
        self.sensors: BoardStatus | None = None
        self._line = line
        self._clock = clock
        self._decoder = FrameDecoder()
        self._openings = line.openings
        self._heard = self._sampled = clock.now()

    def poll(self) -> None:
        """Process the frames received; returns at once."""
        data = self._line.read(0.0)
        now = self._clock.now()
        if self._line.openings != self._openings:
            self._begin_again(now)
        for frame in self._decoder.feed(data):
            self._heard = now
            if isinstance(frame, ImuSample):
                self._sampled = now
            elif isinstance(frame, BoardStatus):
                self.sensors = frame
            else:
                self.tracker.take(frame)
        if self._line.connected and now - self._sampled > DEAD_S:
            self._sampled = now
            self._line.reopen()

    @property
    def silent(self) -> bool:
        """Whether the board has sent no frame for `FRESH_S`."""
        return self._clock.now() - self._heard > FRESH_S

    @property
    def status(self) -> Status:
        return Status.INVALID if self.silent else self.tracker.status

    @property
    def problem(self) -> str:
        """Why there is no pose; empty if there is one."""
        return "the board is silent; is it plugged in?" if self.silent else self.tracker.problem

    def truth(self) -> Truth | None:
        """The pose of the middle of the wheel axis, or None if it cannot be trusted."""
        return None if self.silent else self.tracker.truth()

    def close(self) -> None:
        """Close the line. May be called twice."""
        self._line.close()

    def _begin_again(self, now: float) -> None:
        self._openings = self._line.openings
        self._sampled = now
        self.tracker.lose("the board was unplugged")
