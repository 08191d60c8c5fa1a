"""Bit fields of the frames of both firmwares."""

from __future__ import annotations

from raccoon.core.readings import DIGITAL_PORTS

PORTS = (1 << DIGITAL_PORTS) - 1
"""Mask of the digital ports 0 to 9."""


def _flags(ports: int) -> tuple[bool, ...]:
    return tuple(bool(ports >> port & 1) for port in range(DIGITAL_PORTS))


FLAGS = tuple(_flags(ports) for ports in range(PORTS + 1))
"""The ten digital ports for each value of the bit field; True is pressed (both firmwares send 1 for a pin
that is low)."""
