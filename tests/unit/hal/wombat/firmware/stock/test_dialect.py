"""What the stock firmware's counters tell of themselves."""

import struct

import pytest

from raccoon.hal.wombat.firmware.dialect import Reading
from raccoon.hal.wombat.firmware.stock import wire
from raccoon.hal.wombat.firmware.stock.commands import CANARY
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect


@pytest.mark.parametrize(
    ("first", "second", "seconds", "torn"),
    [
        (400, 400, 0.0002, False),
        (400, 790, 0.0002, False),  # an update fell between the looks
        (-400, -1150, 0.005, False),
        (0, 90, 0.0002, False),  # it starts
        (656, 400, 0.0002, True),
        (400, 144, 0.005, True),
        (20, 276, 0.0002, True),
    ],
)
def test_counters_that_count_on_between_two_looks_are_not_torn(
    first: int, second: int, seconds: float, torn: bool
) -> None:
    assert StockDialect().is_torn((0, first, 0, 0), (0, second, 0, 0), seconds) is torn


def test_two_updates_in_one_look_deserve_no_second_one() -> None:
    dialect = StockDialect(250.0)
    frame = Reading(b"", (), (0, 0, 0, 0), 0)
    dialect.bemf(frame, (0, 600, 0, 0), 0.004)
    assert not dialect.are_suspicious((0, 1190, 0, 0), 0.005)
    assert dialect.are_suspicious((0, 1190, 0, 0), 0.004)
    assert dialect.are_suspicious((0, 600 + 256, 0, 0), 0.005)


def frame(first: int = wire.START, canary: int = 0, count: int = 0) -> bytes:
    registers = bytearray(wire.LENGTH)
    registers[:3] = bytes((first, *wire.MAGIC[1:]))
    registers[wire.ADC_PE], registers[wire.SERVO] = canary, 5
    struct.pack_into(">i", registers, wire.MOT_POS, count)
    return bytes(registers)


def test_a_restart_has_counters_that_began_anew_and_lost_its_canary_or_its_first_byte() -> None:
    restarted = StockDialect().has_restarted
    assert restarted(frame(), frame(canary=CANARY, count=900_000))
    assert restarted(frame(first=0), frame())  # before it was ever given a canary
    assert not restarted(frame(canary=CANARY), frame(canary=CANARY))
    assert not restarted(frame(count=900_000), frame(canary=CANARY, count=900_000))  # a byte was damaged
    assert not restarted(frame(first=0, count=-900_000), frame())
