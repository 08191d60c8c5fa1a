"""RaccoonOS in the form that the port uses."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from raccoon.core.readings import MOTOR_PORTS, Device, Fault, Inputs, Outputs, Words
from raccoon.hal.wombat.firmware.counters import Bemf, Counts, are_near_zero
from raccoon.hal.wombat.firmware.devices import RACCOON_BEMF_RATE_HZ, RACCOON_POLARITY, raccoon_device
from raccoon.hal.wombat.firmware.dialect import LARGEST_BEMF, LARGEST_WORD, Reading
from raccoon.hal.wombat.firmware.raccoon import commands, wire
from raccoon.hal.wombat.firmware.raccoon.rate import CounterRate
from raccoon.hal.wombat.firmware.raccoon.wire import Telemetry
from raccoon.hal.wombat.link.link import Link

NEWEST_IN_THE_WILD = 32
"""Highest first byte that is taken for a version of RaccoonOS."""
POSITION = 21
RESTART_COUNTS_SECONDS = 250.0
"""Largest back-EMF integral, counts * s, that a counter may have when a restart is noticed."""
LONGEST_PAUSE_US = 60_000_000
"""Longest time between two readings of the controller's clock, us: a clock that went back and would have
advanced further, modulo 2^32, has restarted."""
SLOWEST_CLOCK, BETWEEN_FRAMES = 0.95, 0.005
"""Slowest rate of the controller's oscillator (without a crystal) over real time; s by which its clock in a
frame may be old."""
MOVING = 60.0
"""Back-EMF in counts at which a counter that stands still is stuck."""
STUCK_CYCLES, STUCK_TICKS = 4, 4.0
"""Least number of cycles, and missing ticks, of a stuck counter."""


class RaccoonDialect:
    """RaccoonOS: only its version and a padding of zeros mark a valid frame, only its clock shows a restart;
    commands cannot be read back."""

    first_analog = 11
    battery_held = 0.0

    def __init__(self, version: int, bemf_rate_hz: float = RACCOON_BEMF_RATE_HZ) -> None:
        self.name = f"RaccoonOS {version}"
        self.version = version
        self.length = wire.FRAME_LENGTH[version]
        self.device: Device = raccoon_device(version, bemf_rate_hz)
        self.expected_rate_hz: float | None = None if version >= 21 else bemf_rate_hz
        self.fastest_counter = LARGEST_BEMF / self.device.position_counts_seconds
        self._padding = bytes(self.length - wire.DATA_LENGTH)
        self._rate = CounterRate()
        self._missing = [0.0] * MOTOR_PORTS
        self._still = [0] * MOTOR_PORTS

    def polls_per_cycle(self, _period: float) -> int:
        return 1

    def with_rate(self, bemf_rate_hz: float) -> RaccoonDialect:
        return RaccoonDialect(self.version, bemf_rate_hz)

    def command(self, outputs: Outputs) -> bytes:
        return commands.encode(outputs, self.version)

    def stop(self) -> bytes:
        return commands.stop(self.version)

    def hold(self, outputs: Outputs) -> bytes:
        # Every frame sets the servos. The motors are off by their modes: a shutdown would also stop the
        # counters and lose the distance that the robot coasts.
        return commands.encode(Outputs(servo_us=outputs.servo_us), self.version)

    def is_aligned(self, reply: bytes) -> bool:
        return reply[0] == self.version and reply.endswith(self._padding)

    def describe_foreign(self, reply: bytes) -> str | None:
        if 0 < reply[0] <= NEWEST_IN_THE_WILD and reply[0] != self.version and reply.endswith(self._padding):
            return f"RaccoonOS answers with protocol version {reply[0]} instead of {self.version}"
        return None

    def realign(self, link: Link, _reply: bytes) -> None:
        stream = link.transfer(bytes(3 * self.length))
        index = wire.find_shift(stream, self.version)
        if index:
            link.transfer(bytes(index))

    def read(self, reply: bytes) -> Reading:
        words = wire.decode(reply, self.version).words
        position = [RACCOON_POLARITY * int(count) for count in words[6:10]]
        return Reading(reply, words, position, words[17])

    def is_credible(self, reading: Reading) -> bool:
        words = reading.words
        bemf, analog = words[2:6], words[11:18]  # and the battery
        turning = max(bemf) <= LARGEST_WORD and min(bemf) >= -LARGEST_WORD
        return bool(turning and max(analog) <= LARGEST_WORD and min(analog) >= 0)

    def life_words(self, reply: bytes) -> bytes:
        # Without the clock and the digital ports, which interrupts write even when the main loop hangs.
        return reply[5:37] + reply[38:52] + reply[54:144]

    def imu_words(self, reply: bytes) -> bytes:
        return reply[54:66] + reply[67:79]

    def has_restarted(self, reply: bytes, before: bytes, seconds: float = 0.0) -> bool:
        if reply[0] != self.version or before[0] != self.version:
            return False
        clock = int.from_bytes(reply[1:5], "little")
        last = int.from_bytes(before[1:5], "little")
        passed = (clock - last) & 0xFFFF_FFFF
        # The clock also wraps to 0 after 71.6 minutes, which is no restart. If the controller restarts again
        # and again, its clock need not go back: it then advances by less than the elapsed time.
        back = clock < last and passed >= LONGEST_PAUSE_US
        if not back and passed >= 1e6 * (SLOWEST_CLOCK * seconds - BETWEEN_FRAMES):
            return False
        # One damaged byte is no restart: the counters must have restarted, too.
        limit = RESTART_COUNTS_SECONDS / self.device.position_counts_seconds
        return are_near_zero(struct.unpack_from("<4i", reply, POSITION), limit)

    def forget_motors(self) -> None:
        self._missing, self._still = [0.0] * MOTOR_PORTS, [0] * MOTOR_PORTS

    def shows_command(self, _reply: bytes, _sent: bytes) -> bool:
        return True

    def shows_stopped(self, _reply: bytes) -> bool:
        return True

    def bemf(self, reading: Reading, differences: Counts | None, seconds: float) -> Bemf | None:
        bemf = Telemetry(reading.words).bemf
        if differences is not None:
            self._rate.update(differences, bemf, seconds)
            self._watch(differences, bemf, seconds)
        return bemf

    def _watch(self, differences: Counts, bemf: Sequence[float], seconds: float) -> None:
        """Sum for each counter the cycles and ticks since it last moved although its motor turns."""
        for port, value in enumerate(bemf):
            moving = abs(value) > MOVING and not differences[port]
            step = abs(value) * seconds / self.device.position_counts_seconds
            self._missing[port] = self._missing[port] + step if moving else 0.0
            self._still[port] = self._still[port] + 1 if moving else 0

    def ticks(self, totals: Sequence[int]) -> Words:
        return tuple(totals)

    def are_suspicious(self, _differences: Counts, _seconds: float) -> bool:
        return False

    def is_torn(self, _first: Counts, _second: Counts, _seconds: float) -> bool:
        return False

    @property
    def is_averaged(self) -> bool:
        return False

    @property
    def stuck_counters(self) -> tuple[bool, ...]:
        return tuple(
            cycles >= STUCK_CYCLES and ticks > STUCK_TICKS
            for cycles, ticks in zip(self._still, self._missing, strict=True)
        )

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
            Telemetry(reading.words),
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
        return None if self.version >= 21 else self._rate.rate_hz
