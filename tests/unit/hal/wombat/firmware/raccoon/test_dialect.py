"""What the port asks of RaccoonOS: whether the controller has restarted."""

from __future__ import annotations

import struct

import pytest

from raccoon.hal.wombat.firmware.raccoon.dialect import RaccoonDialect

MINUTE = 60.0
WRAP = 2.0**32 / 1e6
"""S after which the controller's clock of microseconds begins anew."""


def reply(seconds: float, position: int = 0) -> bytes:
    """A frame of version 17 at a time of the controller's clock, with one counter there."""
    clock = int(seconds * 1e6) & 0xFFFF_FFFF
    return struct.pack("<BI4i4i", 17, clock, 0, 0, 0, 0, position, 0, 0, 0).ljust(248, b"\0")


@pytest.mark.parametrize("up", [0.5, 10 * MINUTE, 36 * MINUTE, 50 * MINUTE, 70 * MINUTE])
def test_a_restart_shows_however_long_the_controller_was_up(up: float) -> None:
    dialect = RaccoonDialect(17)
    assert dialect.restarted(reply(0.2), reply(up, 900_000))
    assert not dialect.restarted(reply(0.2, 900_000), reply(up, 900_000))  # one word was damaged


@pytest.mark.parametrize("pause", [0.005, 1.0, 50.0])
@pytest.mark.parametrize("at", [1.0, 36 * MINUTE, WRAP - 0.001])
def test_a_clock_that_goes_on_is_no_restart(at: float, pause: float) -> None:
    assert not RaccoonDialect(17).restarted(reply(at + pause), reply(at))


def test_a_program_that_waited_long_is_no_restart() -> None:
    assert not RaccoonDialect(17).restarted(reply(41 * MINUTE), reply(MINUTE))


def test_a_clock_that_went_on_for_too_little_began_anew() -> None:
    dialect = RaccoonDialect(17)
    assert dialect.restarted(reply(0.005), reply(0.004), 0.03)  # both shortly after a restart
    assert not dialect.restarted(reply(0.005, 900_000), reply(0.004), 0.03)
    assert not dialect.restarted(reply(4.48), reply(4.0), 0.5)  # an oscillator that is 4 % slow
