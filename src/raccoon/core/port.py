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


class Bystander(Protocol):
    """Somebody beside a simulated robot, who does what a program asks people for, after a moment."""

    def hold_lamp(self, analog: int, off: float, on: float, *, lit: bool | None) -> None:
        """Have a start light over the sensor on an analog port, which reads `off` counts without it and `on`
        with it: lit from now on, not lit, or (None) switched on after a while."""
        ...

    def press_button(self) -> None:
        """Press the controller's button after a moment, and let go of it."""
        ...

    @property
    def presses(self) -> bool:
        """Whether the button is to be pressed, or is."""
        ...

    def put_over(self, black: bool | None) -> None:
        """Have all tophats over black or white from now on; None: over the table again."""
        ...


def bystander_of(port: Port) -> Bystander | None:
    """Who stands beside the robot of a port, as it says itself (`bystander`): nobody but in simulation."""
    found: Bystander | None = getattr(port, "bystander", None)
    return found


def in_real_time(port: Port) -> bool:
    """Whether a port's cycles come by the wall's clock, as it says itself (`real_time`); most do not."""
    return bool(getattr(port, "real_time", False))
