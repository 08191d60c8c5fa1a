"""What ports have in common that add the readings of a sensor to another port."""

from __future__ import annotations

from typing import Protocol

from raccoon.core.port import Port, bystander_of, in_real_time
from raccoon.core.readings import Fault, Outputs

Faults = tuple[Fault, ...]


class Closable(Protocol):
    """A sensor, as far as it is let go here."""

    def close(self) -> None:
        """Let it go."""
        ...


class AddedSensorPort:
    """Passes commands on; the wrapped port is closed first, so that motors stop whatever the sensor does."""

    def __init__(self, port: Port, sensor: Closable) -> None:
        self._port = port
        self.bystander = bystander_of(port)
        self._sensor = sensor

    @property
    def real_time(self) -> bool:
        """Whether the wrapped port's cycles come by the wall's clock."""
        return in_real_time(self._port)

    def write(self, outputs: Outputs) -> None:
        """Command the wrapped port."""
        self._port.write(outputs)

    def close(self) -> None:
        """Motors off, both released."""
        try:
            self._port.close()
        finally:
            self._sensor.close()


def with_loss(faults: Faults, lost: bool) -> Faults:
    """`faults` with SENSOR_LOST where the sensor is; another added one may have said so already."""
    return (*faults, Fault.SENSOR_LOST) if lost and Fault.SENSOR_LOST not in faults else faults
