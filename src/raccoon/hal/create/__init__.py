"""The iRobot Create 2 base as a port: the Open Interface over a serial line."""

from raccoon.hal.create.port import CREATE_2, RADIANS_PER_TICK, CreatePort, open_create

__all__ = ["CREATE_2", "RADIANS_PER_TICK", "CreatePort", "open_create"]
