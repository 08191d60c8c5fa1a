"""Bit fields that both frames share."""

from __future__ import annotations

from functools import lru_cache

from raccoon.core.readings import DIGITAL_PORTS


@lru_cache(maxsize=1 << DIGITAL_PORTS)
def _flags(ports: int) -> tuple[bool, ...]:
    return tuple(bool(ports >> port & 1) for port in range(DIGITAL_PORTS))


def flags(word: int) -> tuple[bool, ...]:
    """Digital ports 0 to 9 of a bit field; True is pressed (both firmwares send 1 for a pin that is low)."""
    return _flags(word & (1 << DIGITAL_PORTS) - 1)
