"""The link of the emulated Wombat: two rings of bytes that turn with every transfer of the master."""

from __future__ import annotations

import struct
from typing import Literal, Protocol

from raccoon.core.clock import Clock, RealClock
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.hal.wombat.emulator.board import Board
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import Drive, Plant, PlantState
from raccoon.hal.wombat.emulator.raccoon_chip import RaccoonChip
from raccoon.hal.wombat.emulator.stock_chip import StockChip
from raccoon.hal.wombat.firmware.stock import wire

Firmware = Literal["stock", 17, 21]
Build = Literal["shipped", "published"]

BOOT_SECONDS = 0.02
LONGEST_CATCH_UP = 5.0
"""Longest time simulated at once, s; of a longer pause (a debugger) the rest is skipped."""


class Chip(Protocol):
    """An emulated co-processor with its firmware."""

    frame_length: int

    @property
    def powered(self) -> bool: ...
    @property
    def servo_us(self) -> tuple[int | None, ...]: ...
    def reset(self) -> None: ...
    def image(self) -> bytes: ...
    def accept(self, frame: bytes) -> None: ...
    def advance(self, seconds: float) -> None: ...


class Emulator:
    """An emulated Wombat as a link (`transfer`, `close`) and a reset line (`pulse`).

    plant: motors and sensors. firmware: "stock", 17 or 21. clock: determines how far the firmware has run at
    each transfer. build: loop rates of the distributed binary ("shipped") or of the source ("published").
    seed: of all noise; noise False switches it off. Raises ConfigError for another firmware or build.
    """

    def __init__(
        self,
        plant: Plant,
        firmware: Firmware = "stock",
        *,
        clock: Clock | None = None,
        build: Build = "shipped",
        seed: int = 0,
        noise: bool = True,
    ) -> None:
        if firmware not in ("stock", 17, 21):
            raise ConfigError(f"firmware is {firmware!r}: allowed are 'stock', 17 and 21")
        if build not in ("shipped", "published"):
            raise ConfigError(f"build is {build!r}: allowed are 'shipped' and 'published'")
        self.faults = Faults()
        self.firmware = firmware
        self._clock = clock or RealClock()
        self._board = Board(plant, self.faults, seed=seed, noise=noise)
        self.chip: Chip = (
            StockChip(self._board, self.faults, build)
            if firmware == "stock"
            else RaccoonChip(self._board, self.faults, firmware, build)
        )
        self._time = self._clock.now()
        self._booted_at = self._time
        self._closed = False
        self._restart_link()

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Present states of the motor drivers."""
        return self._board.drives

    @property
    def motors_running(self) -> bool:
        """Whether any motor is driven, including the short pauses for measuring."""
        return self.chip.powered

    @property
    def servo_us(self) -> tuple[int | None, ...]:
        """Pulse of each servo port, us, None if it is off."""
        return self.chip.servo_us

    @property
    def state(self) -> PlantState:
        """The last state of the plant."""
        return self._board.state

    def transfer(self, frame: bytes) -> bytes:
        """Transfer a frame, full duplex. A length other than the firmware's shifts all that follow. Raises
        HardwareError after `close`."""
        if self._closed:
            raise HardwareError("the emulated link is closed")
        if self.faults.latency > 0.0:
            self._clock.sleep_until(self._clock.now() + self.faults.latency)
        self.run()
        if self.faults.silent is not None or self._time < self._booted_at:
            return bytes((self.faults.silent or 0,)) * len(frame)
        if self.faults.overrun:
            return self._last[:1] * len(frame)
        return self._disturbed(self._exchange(frame))

    def run(self) -> None:
        """Run the firmware up to the present time of the clock. Every transfer does that, too."""
        elapsed = min(self._clock.now() - self._time, LONGEST_CATCH_UP)
        self._time = self._clock.now()
        if elapsed > 0.0:
            if self._time < self._booted_at:
                self._board.advance(elapsed, (None,) * 4)
                return
            self.chip.advance(elapsed)
        if self._board.state.battery_voltage < self.faults.brown_out_voltage:
            self.reset()

    def reset(self) -> None:
        """Restart by power-on or reset line: all registers and counters lost, motors off, silence for a
        moment."""
        self.chip.reset()
        self._board.drives = (None,) * 4
        self.faults.overrun = self.faults.frozen = False
        self._booted_at = self._clock.now() + BOOT_SECONDS
        self._restart_link()

    def pulse(self) -> None:
        """Pulse the reset line of the board."""
        self.reset()

    def close(self) -> None:
        """Close the master's side of the bus; the firmware continues. May be called twice."""
        self._closed = True

    def _restart_link(self) -> None:
        self._at = 0
        self._ring = bytearray(self.chip.frame_length)
        self._stale = True
        self._last = bytes(1)

    def _exchange(self, frame: bytes) -> bytes:
        """Turn both rings by the frame; each time they complete a turn, the frame in memory is accepted,
        complete or not."""
        reply = bytearray()
        rest = frame
        while rest:
            part, rest = rest[: len(self._ring) - self._at], rest[len(self._ring) - self._at :]
            end = self._at + len(part)
            reply += self.chip.image()[self._at : end]
            self._ring[self._at : end] = part
            self._at = end
            if end == len(self._ring):
                self._at = 0
                self._deliver()
        if self._stale and reply:
            # The transfer engine is armed before the image is filled: its first byte is old.
            reply[0], self._stale = 0, False
        self._last = bytes(reply[-1:])
        return bytes(reply)

    def _deliver(self) -> None:
        if self.faults.lost_writes > 0:
            self.faults.lost_writes -= 1
            return
        self.chip.accept(bytes(self._ring))

    def _disturbed(self, reply: bytes) -> bytes:
        if self.faults.torn_reads <= 0 or len(reply) < 42:
            return reply
        self.faults.torn_reads -= 1
        torn = bytearray(reply)
        at, form = (wire.MOT_POS, ">I") if self.firmware == "stock" else (21, "<I")
        (word,) = struct.unpack_from(form, torn, at)
        # The upper half is from after a carry, the lower half from before it.
        struct.pack_into(form, torn, at, word + 0x10000 & 0xFFFF_FFFF)
        return bytes(torn)
