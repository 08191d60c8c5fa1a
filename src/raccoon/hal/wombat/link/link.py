"""The byte pipe to the co-processor: what a port needs of it."""

from __future__ import annotations

from typing import Protocol


class Link(Protocol):
    """Full-duplex transfers: as many bytes come back as go out."""

    def transfer(self, frame: bytes) -> bytes:
        """Clock the frame out and return what came in meanwhile. Raises HardwareError where that fails."""
        ...

    def close(self) -> None:
        """Let go of the device. May be called twice."""
        ...


class ResetLine(Protocol):
    """The wire that restarts the co-processor: the last resort when it no longer listens."""

    def pulse(self) -> None:
        """Hold the line low for a moment. Raises HardwareError where that fails."""
        ...
