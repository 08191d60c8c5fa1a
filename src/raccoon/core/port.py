"""The one doorway to a robot: data in, commands out."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from raccoon.core.readings import Inputs, Outputs


@runtime_checkable
class Port(Protocol):
    """A robot, simulated or real, or a recording of one.

    Wrap a port to record it, disturb it or log it; do not inherit from one. A port is its own context
    only through `close`: whoever opened it closes it.
    """

    def read(self) -> Inputs:
        """Wait for the next cycle and return it.

        Raises HardwareError when the device is lost, EOFError when a recording has ended.
        """
        ...

    def write(self, outputs: Outputs) -> None:
        """Command motors and servos until the next write."""
        ...

    def close(self) -> None:
        """Motors off, device released. May be called twice."""
        ...


def in_real_time(port: Port) -> bool:
    """Whether a port's cycles come by the wall's clock, as it says itself (`real_time`); most do not."""
    return bool(getattr(port, "real_time", False))
