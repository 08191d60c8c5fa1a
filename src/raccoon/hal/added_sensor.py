"""Common base of the ports that add the readings of a sensor to another port."""

from __future__ import annotations

from typing import Protocol

from raccoon.core.port import Port, bystander_of, in_real_time
from raccoon.core.readings import Fault, Outputs

Faults = tuple[Fault, ...]


class Closable(Protocol):
    """A sensor that can be closed."""

    def close(self) -> None:
        """Release the sensor."""
        ...


class AddedSensorPort:
    """Passes commands on to the wrapped port, which is closed before the sensor, so that the motors stop
    whatever the sensor does."""

    def __init__(self, port: Port, sensor: Closable) -> None:
        self._port = port
        self.bystander = bystander_of(port)
        self._sensor = sensor

    @property
    def real_time(self) -> bool:
        """Whether the wrapped port's cycles follow real time."""
        return in_real_time(self._port)

    def write(self, outputs: Outputs) -> None:
        """Command the wrapped port."""
        self._port.write(outputs)

    def close(self) -> None:
        """Close the port, which stops the motors, then the sensor."""
        try:
            self._port.close()
        finally:
            self._sensor.close()


def with_loss(faults: Faults, lost: bool) -> Faults:
    """`faults` and, if `lost`, SENSOR_LOST, unless another added sensor has added it already."""
    return (*faults, Fault.SENSOR_LOST) if lost and Fault.SENSOR_LOST not in faults else faults
