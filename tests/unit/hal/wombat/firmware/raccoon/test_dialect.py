"""What the port asks of RaccoonOS: did the controller restart, which counters count, who answers."""

from __future__ import annotations

import struct

import pytest

from raccoon.hal.wombat.firmware.dialect import Reading
from raccoon.hal.wombat.firmware.raccoon.dialect import RaccoonDialect

MINUTE = 60.0
WRAP = 2.0**32 / 1e6
"""s after which the controller's clock of microseconds begins anew."""


def reply(seconds: float, position: int = 0) -> bytes:
    """A frame of version 17 at a time of the controller's clock, with one counter there."""
    clock = int(seconds * 1e6) & 0xFFFF_FFFF
    return struct.pack("<BI4i4i", 17, clock, 0, 0, 0, 0, position, 0, 0, 0).ljust(248, b"\0")


def reading(left: float, right: float) -> Reading:
    """What is read while the motors on the ports 0 and 1 give that many counts of back-EMF."""
    words = [0.0] * 100
    words[2:4] = -left, -right  # its polarity is the other way round
    return Reading(b"", tuple(words), [0] * 4, 0.0)


@pytest.mark.parametrize("up", [0.5, 10 * MINUTE, 36 * MINUTE, 50 * MINUTE, 70 * MINUTE])
def test_a_restart_shows_however_long_the_controller_was_up(up: float) -> None:
    dialect = RaccoonDialect(17)
    assert dialect.has_restarted(reply(0.2), reply(up, 900_000))
    assert not dialect.has_restarted(reply(0.2, 900_000), reply(up, 900_000))  # one word was damaged


@pytest.mark.parametrize("pause", [0.005, 1.0, 50.0])
@pytest.mark.parametrize("at", [1.0, 36 * MINUTE, WRAP - 0.001])
def test_a_clock_that_goes_on_is_no_restart(at: float, pause: float) -> None:
    assert not RaccoonDialect(17).has_restarted(reply(at + pause), reply(at))


def test_a_program_that_waited_long_is_no_restart() -> None:
    assert not RaccoonDialect(17).has_restarted(reply(41 * MINUTE), reply(MINUTE))


def test_a_clock_that_went_on_for_too_little_began_anew() -> None:
    dialect = RaccoonDialect(17)
    assert dialect.has_restarted(reply(0.005), reply(0.004), 0.03)  # both shortly after a restart
    assert not dialect.has_restarted(reply(0.005, 900_000), reply(0.004), 0.03)
    assert not dialect.has_restarted(reply(4.48), reply(4.0), 0.5)  # an oscillator that is 4 % slow


@pytest.mark.parametrize("counts", [400.0, -400.0])
def test_a_counter_that_stands_still_beside_a_moving_motor_is_stuck_until_it_counts(counts: float) -> None:
    """It counts counts x seconds: of 400 counts two ticks a cycle."""
    dialect, told = RaccoonDialect(17), []
    words = reading(counts, 0.0)
    for differences in (*((0, 0, 0, 0),) * 6, (2, 0, 0, 0)):
        dialect.bemf(words, differences, 0.005)
        told.append(dialect.stuck_counters)
    assert told == [(False,) * 4] * 3 + [(True, False, False, False)] * 3 + [(False,) * 4]


def test_a_motor_too_slow_for_a_tick_of_its_counter_is_not_stuck() -> None:
    dialect = RaccoonDialect(17)
    for _ in range(400):
        dialect.bemf(reading(50.0, -50.0), (0, 0, 0, 0), 0.005)
    assert not any(dialect.stuck_counters)


@pytest.mark.parametrize(
    ("first", "last", "foreign"),
    [
        (21, 0, True),
        (1, 0, True),
        (32, 0, True),
        (17, 0, False),
        (0, 0, False),
        (33, 0, False),
        (21, 1, False),
    ],
)
def test_a_frame_of_another_version_is_told_from_a_damaged_one(first: int, last: int, foreign: bool) -> None:
    """Another version begins with its number and ends in zeros, as this one does."""
    frame = bytes((first,)) + bytes(range(1, 100)) + bytes(147) + bytes((last,))
    told = RaccoonDialect(17).describe_foreign(frame)
    assert (told is not None) is foreign
    if told is not None:
        assert f"version {first} instead of 17" in told
