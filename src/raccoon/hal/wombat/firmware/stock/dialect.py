"""The stock firmware in the form that the port uses."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from raccoon.core.readings import MOTOR_PORTS, Device, Fault, Inputs, Outputs, Words
from raccoon.hal.wombat.firmware.counters import Bemf, Counts, are_near_zero
from raccoon.hal.wombat.firmware.devices import STOCK_BEMF_RATE_HZ, STOCK_COUNTS_PER_TICK, stock_device
from raccoon.hal.wombat.firmware.dialect import LARGEST_BEMF, LARGEST_WORD, Reading
from raccoon.hal.wombat.firmware.stock import commands, wire
from raccoon.hal.wombat.firmware.stock.bemf import StockBemf
from raccoon.hal.wombat.firmware.stock.wire import Registers
from raccoon.hal.wombat.link.link import Link

LARGEST_AFTER_BOOT = 50_000
"""Largest count that a counter may have when a restart is noticed."""
POLL_MARGIN = 1.2
"""Least readings of the counters per update. Updates are as uneven as the firmware's loop: with hardly more
than one reading each, two of them sometimes fall between two readings and look like one of a wheel that is
twice as fast."""
LARGEST_STEP = 128
"""Counts by which the filtered back-EMF may change in one update without a second reading: a torn byte is
256."""


class StockDialect:
    """The stock firmware: registers that can be read back and contain a canary; back-EMF is derived from the
    counters."""

    name = "stock"
    length = wire.LENGTH
    first_analog = 6
    battery_held = 17.0
    fastest_counter = LARGEST_BEMF * STOCK_BEMF_RATE_HZ

    def __init__(self, bemf_rate_hz: float = STOCK_BEMF_RATE_HZ) -> None:
        self.device: Device = stock_device(bemf_rate_hz)
        self._bemf = StockBemf(bemf_rate_hz)
        self._rate_hz = bemf_rate_hz
        self.expected_rate_hz: float | None = bemf_rate_hz
        self._sequence = 0

    def polls_per_cycle(self, period: float) -> int:
        return max(math.ceil(POLL_MARGIN * period * self._rate_hz), 1)

    def with_rate(self, bemf_rate_hz: float) -> StockDialect:
        return StockDialect(bemf_rate_hz)

    def command(self, outputs: Outputs) -> bytes:
        self._sequence += 1
        return commands.encode(outputs, self._sequence)

    def stop(self) -> bytes:
        self._sequence += 1
        return commands.frame(commands.stop(), self._sequence)

    def hold(self, _outputs: Outputs) -> bytes:
        # Registers that are not written keep their value; a lost canary must stay so until the port sees it.
        return commands.frame(commands.motors_off())

    def is_aligned(self, reply: bytes) -> bool:
        return reply.startswith(wire.MAGIC)

    def describe_foreign(self, reply: bytes) -> str | None:
        if reply[0] == wire.START and reply[1] == 0 and reply[2] != wire.FIRMWARE_VERSION:
            return f"the stock firmware answers with version {reply[2]}; known is {wire.FIRMWARE_VERSION}"
        return None

    def realign(self, link: Link, reply: bytes) -> None:
        index = wire.find_shift(reply)
        if index:
            link.transfer(bytes(index))

    def read(self, reply: bytes) -> Reading:
        registers = wire.decode(reply)
        return Reading(reply, registers.words, registers.position, registers.battery)

    def is_credible(self, reading: Reading) -> bool:
        return bool(max(reading.words[6:12]) <= LARGEST_WORD and reading.battery <= LARGEST_WORD)

    def life_words(self, reply: bytes) -> bytes:
        # Includes the counters: with a dead IMU and quiet analog ports nothing else changes.
        sensors = reply[wire.ADC_0 : wire.ADC_PE] + reply[wire.ADC_PE + 1 : wire.MOT_MODES]
        return sensors + reply[wire.BATTERY : wire.BUTTONS]

    def imu_words(self, reply: bytes) -> bytes:
        return reply[wire.ACCEL : wire.MOT_POS]

    def has_restarted(self, reply: bytes, before: bytes, _seconds: float = 0.0) -> bool:
        # Only a complete frame counts: one of zeros, or one cut off, has neither canary nor counts.
        if reply[1:3] != wire.MAGIC[1:] or reply[wire.SERVO] == 0:
            return False
        # The transfer engine starts before the registers are filled: one old byte, then a valid frame.
        canary_lost = before[wire.ADC_PE] & ~reply[wire.ADC_PE] & commands.CANARY != 0
        if not (canary_lost or reply[0] == 0):
            return False
        # One damaged byte is no restart: the counters must have restarted, too.
        return are_near_zero(struct.unpack_from(">4i", reply, wire.MOT_POS), LARGEST_AFTER_BOOT)

    def forget_motors(self) -> None:
        self._bemf.begin_anew()

    def shows_command(self, reply: bytes, sent: bytes) -> bool:
        if sent[3] != len(commands.IMAGE):
            return True
        return commands.shows_command(reply, sent)

    def shows_stopped(self, reply: bytes) -> bool:
        return reply[wire.MOT_MODES] == 0 and reply[wire.MOT_DIRS] == 0

    def bemf(self, _reading: Reading, differences: Counts | None, seconds: float) -> Bemf | None:
        if differences is None:
            self._bemf.restart()
            return None
        self._bemf.update(differences, seconds)
        return self._bemf.value if self._bemf.fresh else None

    def ticks(self, totals: Sequence[int]) -> Words:
        return tuple(
            (total + missing) / STOCK_COUNTS_PER_TICK
            for total, missing in zip(totals, self._bemf.shortfall, strict=True)
        )

    def are_suspicious(self, differences: Counts, seconds: float) -> bool:
        updates = seconds * self._rate_hz
        if updates > 1.4:
            return False
        most = 1 if updates <= 1.0 else 2
        return any(
            difference and min(abs(difference - n * last) / n for n in range(1, most + 1)) > LARGEST_STEP
            for difference, last in zip(differences, self._bemf.value, strict=True)
        )

    def is_torn(self, first: Counts, second: Counts, seconds: float) -> bool:
        # A counter continues in its direction, by at most the updates that fit between the readings.
        updates = math.floor(seconds * self._rate_hz) + 1
        return any(
            not -LARGEST_STEP <= math.copysign(1.0, old) * (new - old) <= updates * abs(old) + LARGEST_STEP
            for old, new in zip(first, second, strict=True)
        )

    @property
    def is_averaged(self) -> bool:
        return self._bemf.averaged

    @property
    def stuck_counters(self) -> tuple[bool, ...]:
        return (self._bemf.overdue,) * MOTOR_PORTS

    def inputs(
        self,
        reading: Reading,
        time: float,
        position: Words,
        bemf: Words,
        faults: tuple[Fault, ...],
        imu: bool,
        analog: bool,
    ) -> Inputs:
        return wire.inputs(
            Registers(reading.words),
            time,
            device=self.device,
            position=position,
            bemf=bemf,
            faults=faults,
            imu=imu,
            analog=analog,
        )

    @property
    def bemf_rate_hz(self) -> float | None:
        return self._bemf.rate_hz
