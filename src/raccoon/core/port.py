"""The port: the only interface to a robot; readings come in, commands go out."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from raccoon.core.readings import Inputs, Outputs


@runtime_checkable
class Port(Protocol):
    """A robot, simulated or real, or a recording of one.

    Wrap a port to record it, disturb it or log it; do not inherit from one. Whoever opened a port calls
    `close`.
    """

    def read(self) -> Inputs:
        """Wait for the next cycle and return its readings.

        Raises HardwareError if the device is lost, EOFError at the end of a recording.
        """
        ...

    def write(self, outputs: Outputs) -> None:
        """Set the command of motors and servos until the next write."""
        ...

    def close(self) -> None:
        """Switch the motors off and release the device. May be called twice."""
        ...


class Bystander(Protocol):
    """A simulated person beside a simulated robot, who does what a program asks people to do, after a
    moment."""

    def hold_lamp(self, analog: int, off: float, on: float, *, lit: bool | None) -> None:
        """Hold a start light over the sensor on an analog port, which reads `off` counts without it and `on`
        with it. lit: on from now on, off, or (None) switched on after a while."""
        ...

    def press_button(self) -> None:
        """Press the controller's button after a moment, and release it."""
        ...

    @property
    def presses(self) -> bool:
        """Whether the button is pressed, or will be."""
        ...

    def put_over(self, black: bool | None) -> None:
        """Hold all tophats over black or white from now on; None: over the table again."""
        ...


def bystander_of(port: Port) -> Bystander | None:
    """The bystander of a port (its attribute `bystander`); only in simulation there is one."""
    found: Bystander | None = getattr(port, "bystander", None)
    return found


def in_real_time(port: Port) -> bool:
    """Whether a port's cycles come in real time (its attribute `real_time`); for most they do not."""
    return bool(getattr(port, "real_time", False))
