"""The receiver on a link that plays a script."""

import struct
from collections.abc import Iterator

import pytest

from raccoon.core.clock import SteppedClock
from raccoon.core.errors import HardwareError
from raccoon.core.readings import Fault
from raccoon.hal.wombat.checks.receiver import Receiver
from raccoon.hal.wombat.firmware.devices import STOCK_BEMF_RATE_HZ
from raccoon.hal.wombat.firmware.stock import wire
from raccoon.hal.wombat.firmware.stock.bemf import StockBemf
from raccoon.hal.wombat.firmware.stock.commands import READ
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect

DEAD = bytes(wire.LENGTH)


def frame(count: int) -> bytes:
    """A stock frame whose first counter stands there."""
    registers = bytearray(wire.LENGTH)
    registers[:3] = wire.MAGIC
    struct.pack_into(">i", registers, wire.MOT_POS, count)
    registers[wire.SERVO] = 5
    return bytes(registers)


class Script:
    """A link that says these frames in turn, and the last one for ever."""

    def __init__(self, *frames: bytes) -> None:
        self._frames: Iterator[bytes] = iter(frames)
        self._last = frames[-1]

    def transfer(self, _frame: bytes) -> bytes:
        return next(self._frames, self._last)

    def close(self) -> None:
        pass


def test_a_counter_that_really_jumped_is_counted_on_from_where_it_is() -> None:
    clock = SteppedClock()
    script = Script(frame(0), frame(100), frame(5_000_000), frame(5_000_000), frame(5_000_090))
    receiver = Receiver(StockDialect(), script, clock)
    found = []
    for _ in range(4):
        receiver.collect()
        receiver.poll(READ, clock.now())
        found.append(list(receiver.faults))
        clock.advance(0.005)
    assert found == [[], [], [Fault.POSITION_JUMP], []]
    assert receiver.position[0] == pytest.approx(190 / 250, abs=0.02)


def test_a_counter_that_jumps_again_and_again_leaves_the_speed_as_it_is() -> None:
    clock, jump = SteppedClock(), 0

    class Driving:
        def transfer(self, _frame: bytes) -> bytes:
            return frame(300 * int(clock.now() * STOCK_BEMF_RATE_HZ) + jump)

        def close(self) -> None:
            pass

    receiver, read = Receiver(StockDialect(), Driving(), clock), []
    for look in range(400):
        jump = 0x10000 if look > 20 and look % 7 in (0, 1, 4) else 0  # there and back
        receiver.collect()
        receiver.poll(READ, clock.now())
        if receiver.bemf is not None and look > 20:
            read.append(receiver.bemf[0])
        clock.advance(0.0025)
    assert len(read) > 50
    assert read == pytest.approx([300.0 + StockBemf.TRUNCATION] * len(read))


def test_a_link_is_lost_when_it_says_nothing_for_long_at_one_time() -> None:
    script = Script(frame(0), *[DEAD] * 80, frame(0), *[DEAD] * 80, frame(0), DEAD)
    receiver = Receiver(StockDialect(), script, SteppedClock())

    def polls(first: int, last: int) -> None:
        for cycle in range(first, last):
            receiver.collect()
            receiver.poll(READ, 0.005 * cycle)

    polls(0, 163)  # 0.4 s without a word, twice
    with pytest.raises(HardwareError, match=r"the stock controller is lost: the link says 0x00"):
        polls(163, 300)
