"""Cycles of a port, collected under a command; the motors stand when it is over, whatever happened."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from raccoon.core.errors import HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import MOTOR_PORTS, STOP, Inputs, Outputs

_STUCK_AFTER = 1000
"""Cycles without any time passing."""


class Session:
    """Reads and commands one port, and remembers every cycle."""

    def __init__(self, port: Port) -> None:
        self.cycles: list[Inputs] = []
        self._port = port

    def run(self, seconds: float, outputs: Outputs = STOP) -> list[Inputs]:
        """The cycles of the next `seconds` under one command.

        Raises HardwareError where the device is lost, or where its clock stands still.
        """
        first = len(self.cycles)
        inputs = self._cycle(outputs)
        start, stood = inputs.time, 0
        while inputs.time - start < seconds:
            before = inputs.time
            inputs = self._cycle(outputs)
            stood = stood + 1 if inputs.time <= before else 0
            if stood > _STUCK_AFTER:
                raise HardwareError(f"{inputs.device.name}: its clock stands still at {inputs.time} s")
        return self.cycles[first:]

    def _cycle(self, outputs: Outputs) -> Inputs:
        inputs = self._port.read()
        self._port.write(outputs)
        self.cycles.append(inputs)
        return inputs


@contextmanager
def session(port: Port) -> Iterator[Session]:
    """A session whose motors are stopped on the way out: by return, by an error, by Ctrl-C."""
    try:
        yield Session(port)
    finally:
        with suppress(HardwareError):  # a lost device must not hide why it was lost; closing it tries again
            port.write(STOP)


def one_motor(motor_port: int, duty: float) -> Outputs:
    """This motor alone; the others coast."""
    return Outputs(duty=tuple(duty if each == motor_port else 0.0 for each in range(MOTOR_PORTS)))


def port_words(cycles: Sequence[Inputs], name: str, index: int) -> list[float]:
    """The words of one port over some cycles, without those that were missing."""
    found = (getattr(each, name)[index] for each in cycles)
    return [float(word) for word in found if word is not None]


def scaled_vectors(cycles: Sequence[Inputs], name: str, scale: float) -> list[tuple[float, float, float]]:
    """gyro or accel over some cycles, times `scale`, without those that were missing."""
    found = (getattr(each, name) for each in cycles)
    return [(scale * x, scale * y, scale * z) for x, y, z in (word for word in found if word is not None)]


def mean(values: Sequence[float]) -> float:
    """Of at least one value."""
    return math.fsum(values) / len(values)


def deviation(values: Sequence[float]) -> float:
    """Standard deviation; 0 for a single value."""
    centre = mean(values)
    return math.sqrt(math.fsum((each - centre) ** 2 for each in values) / max(len(values) - 1, 1))


def correlation(one: Sequence[float], other: Sequence[float]) -> float:
    """Pearson's, -1..1; 0 where one of them does not vary."""
    spread = deviation(one) * deviation(other)
    if spread == 0.0 or len(one) != len(other) or len(one) < 2:
        return 0.0
    first, second = mean(one), mean(other)
    shared = math.fsum((a - first) * (b - second) for a, b in zip(one, other, strict=True)) / (len(one) - 1)
    return shared / spread
