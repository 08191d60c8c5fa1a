"""Sessions of the examination, which collect a port's cycles under a command and stop the motors at the end
in any case, and statistics of the cycles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from raccoon.core.errors import HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import MOTOR_PORTS, STOP, Inputs, Outputs

_STUCK_AFTER = 1000
"""Cycles in a row without any progress of time after which the clock stands still."""


class Session:
    """Reads and commands one port, and remembers every cycle."""

    def __init__(self, port: Port) -> None:
        self.cycles: list[Inputs] = []
        self._port = port

    def run(self, seconds: float, outputs: Outputs = STOP) -> list[Inputs]:
        """The cycles of the next `seconds`, in each of which `outputs` is commanded.

        Raises HardwareError if the device is lost or its clock stands still.
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
    """A session at whose end the motors are stopped: after a return, an error or Ctrl-C."""
    try:
        yield Session(port)
    finally:
        with suppress(HardwareError):  # a lost device must not hide why it was lost; closing it tries again
            port.write(STOP)


def one_motor(motor_port: int, duty: float) -> Outputs:
    """Outputs that drive one motor at `duty`, -1..1; the others coast."""
    return Outputs(duty=tuple(duty if each == motor_port else 0.0 for each in range(MOTOR_PORTS)))


def port_words(cycles: Sequence[Inputs], name: str, index: int) -> list[float]:
    """The words `name`[`index`] of the cycles, such as the analog port `index`, without missing ones."""
    found = (getattr(each, name)[index] for each in cycles)
    return [float(word) for word in found if word is not None]


def scaled_vectors(cycles: Sequence[Inputs], name: str, scale: float) -> list[tuple[float, float, float]]:
    """The vectors `name` (gyro or accel) of the cycles, times `scale`, without missing ones."""
    found = (getattr(each, name) for each in cycles)
    return [(scale * x, scale * y, scale * z) for x, y, z in (word for word in found if word is not None)]


def mean(values: Sequence[float]) -> float:
    """Arithmetic mean of at least one value."""
    return math.fsum(values) / len(values)


def deviation(values: Sequence[float]) -> float:
    """Standard deviation; 0 for a single value."""
    centre = mean(values)
    return math.sqrt(math.fsum((each - centre) ** 2 for each in values) / max(len(values) - 1, 1))


def correlation(one: Sequence[float], other: Sequence[float]) -> float:
    """Pearson's correlation coefficient, -1..1; 0 if one of them does not vary or their lengths differ."""
    spread = deviation(one) * deviation(other)
    if spread == 0.0 or len(one) != len(other) or len(one) < 2:
        return 0.0
    first, second = mean(one), mean(other)
    shared = math.fsum((a - first) * (b - second) for a, b in zip(one, other, strict=True)) / (len(one) - 1)
    return shared / spread
