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
        receiver.begin_cycle()
        receiver.poll(READ)
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
        receiver.begin_cycle()
        receiver.poll(READ)
        if receiver.bemf is not None and look > 20:
            read.append(receiver.bemf[0])
        clock.advance(0.0025)
    assert len(read) > 50
    assert read == pytest.approx([300.0 + StockBemf.TRUNCATION] * len(read))


def test_a_link_is_lost_when_it_says_nothing_for_long_at_one_time() -> None:
    script = Script(frame(0), *[DEAD] * 80, frame(0), *[DEAD] * 80, frame(0), DEAD)
    clock = SteppedClock()
    receiver = Receiver(StockDialect(), script, clock)

    def polls(cycles: int) -> None:
        for _ in range(cycles):
            receiver.begin_cycle()
            receiver.poll(READ)
            clock.advance(0.005)

    polls(163)  # 0.4 s without a word, twice
    with pytest.raises(HardwareError, match=r"the stock controller is lost: the link says 0x00"):
        polls(137)


def test_a_transfer_that_fails_costs_a_cycle_and_a_link_that_fails_for_long_is_lost_by_its_error() -> None:
    clock, failing = SteppedClock(), False

    class Failing:
        def transfer(self, _frame: bytes) -> bytes:
            if failing:
                raise HardwareError("a transfer on /dev/spidev0.0 failed: timed out")
            return frame(0)

        def close(self) -> None:
            pass

    receiver = Receiver(StockDialect(), Failing(), clock)

    def faults(cycles: int = 1) -> list[Fault]:
        for _ in range(cycles):
            receiver.begin_cycle()
            receiver.poll(READ)
            clock.advance(0.005)
        return list(receiver.faults)

    assert faults() == []
    failing = True
    assert faults() == [Fault.LINK_DEAD]
    failing = False
    assert faults() == []
    failing = True
    with pytest.raises(HardwareError, match=r"a transfer on /dev/spidev0.0 failed: timed out for 0.5 s"):
        faults(120)


def test_words_that_no_converter_gives_are_read_again_or_left_out_and_for_long_are_a_lost_link() -> None:
    clock, analog = SteppedClock(), wire.ADC_0 + 4

    def damaged(count: int) -> bytes:
        return frame(count)[:analog] + b"\xd4" + frame(count)[analog + 1 :]

    script = Script(damaged(0), frame(0), damaged(100), frame(100), damaged(200), damaged(200), frame(300))
    receiver, seen = Receiver(StockDialect(), script, clock), []
    for _ in range(5):
        receiver.begin_cycle()
        reading = receiver.poll(READ)
        seen.append((None if reading is None else reading.reply, list(receiver.faults)))
        clock.advance(0.005)
    torn = [Fault.TORN]
    assert seen == [(None, torn), (frame(0), []), (frame(100), torn), (None, torn), (frame(300), [])]
    receiver = Receiver(StockDialect(), Script(frame(0), damaged(0)), clock)

    def poll() -> bool:
        receiver.begin_cycle()
        clock.advance(0.005)
        return receiver.poll(READ) is not None

    with pytest.raises(HardwareError, match=r"is lost: its frames contradict each other for 0\.5 s"):
        [poll() for _ in range(120)]


@pytest.mark.parametrize("before", [True, False])
def test_of_a_transfer_in_which_the_program_did_not_run_the_time_is_not_known(before: bool) -> None:
    """Its words may be of its beginning or of its end: it is looked again."""
    clock, stall = SteppedClock(), 0.0

    class Driving:
        def transfer(self, _frame: bytes) -> bytes:
            nonlocal stall
            late, stall = stall, 0.0
            clock.advance(late if before else 0.0)
            reply = frame(int(1e5 * clock.now()))
            clock.advance(0.0 if before else late)
            return reply

        def close(self) -> None:
            pass

    receiver = Receiver(StockDialect(), Driving(), clock)
    for cycle in range(20):
        clock.advance(0.005)
        stall = 0.2 if cycle == 15 else 0.0
        receiver.begin_cycle()
        reading = receiver.poll(READ)
        assert reading is not None
        assert reading.position[0] == int(1e5 * receiver.time)
        assert receiver.faults == []
