"""Protocols of the link to the co-processor and of its reset line: what a port needs of them."""

from __future__ import annotations

from typing import Protocol


class Link(Protocol):
    """Full-duplex transfers, which return as many bytes as they send."""

    def transfer(self, frame: bytes) -> bytes:
        """Send the frame and return the bytes received meanwhile. Raises HardwareError if the transfer
        fails."""
        ...

    def close(self) -> None:
        """Close the device. May be called twice."""
        ...


class ResetLine(Protocol):
    """The line that restarts the co-processor: the last resort if it no longer responds."""

    def pulse(self) -> None:
        """Hold the line low for a moment. Raises HardwareError if that fails."""
        ...
