"""The protocol through which the port uses a firmware; one class implements it for each of the two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from raccoon.core.readings import ANALOG_FULL_SCALE, Device, Fault, Inputs, Outputs, Words
from raccoon.hal.wombat.firmware.counters import Bemf, Counts
from raccoon.hal.wombat.link.link import Link

LARGEST_BEMF = 2000.0
"""Back-EMF in counts that no motor on this board exceeds: 6.6 V induced."""
LARGEST_WORD = 2 * ANALOG_FULL_SCALE
"""Counts that no word of a converter exceeds, even where the firmware corrects for its supply voltage."""


class Reading:
    """One decoded frame, in the parts common to both firmwares.

    words: every field, as the codec unpacked it. position: wrapping 32-bit counters with the unified
    polarity. battery: ADC counts.
    """

    __slots__ = ("battery", "position", "reply", "words")

    def __init__(self, reply: bytes, words: tuple[Any, ...], position: Sequence[int], battery: float) -> None:
        self.reply = reply
        self.words = words
        self.position = position
        self.battery = battery


class Dialect(Protocol):
    """One firmware. Replies are raw frames; only those that are aligned (`is_aligned`) may be read."""

    name: str
    length: int
    device: Device
    fastest_counter: float
    """Counts a second that no counter exceeds."""
    first_analog: int
    """Index of the first of the six analog ports in `Reading.words`."""
    battery_held: float
    """Counts by which a rising battery voltage may be above its word."""
    expected_rate_hz: float | None
    """Updates of the counters a second that the conversion of ticks assumes; None if ticks do not depend on
    it."""

    def polls_per_cycle(self, period: float, /) -> int:
        """Transfers in a cycle of `period` s that are needed to see every update of the counters."""
        ...

    def with_rate(self, bemf_rate_hz: float) -> Dialect:
        """The same firmware with counters updated that often. Raises ConfigError outside 50 to 1000."""
        ...

    def command(self, outputs: Outputs) -> bytes:
        """The next frame, with the complete command."""
        ...

    def stop(self) -> bytes:
        """The frame that switches everything off."""
        ...

    def hold(self, outputs: Outputs) -> bytes:
        """The frame that switches the motors off and sets the servos of `outputs`, whatever frames came
        before."""
        ...

    def is_aligned(self, reply: bytes) -> bool:
        """Whether the frame starts at its first byte."""
        ...

    def describe_foreign(self, reply: bytes) -> str | None:
        """What answers instead if the reply is a complete frame of another firmware; None if not."""
        ...

    def realign(self, link: Link, reply: bytes, /) -> None:
        """Try to align shifted frames by transfers of zeros only."""
        ...

    def read(self, reply: bytes) -> Reading:
        """Decode an aligned frame."""
        ...

    def is_credible(self, reading: Reading) -> bool:
        """Whether its converter words are within the converter's range."""
        ...

    def life_words(self, reply: bytes) -> bytes:
        """The bytes that noise changes as long as the main loop runs."""
        ...

    def imu_words(self, reply: bytes) -> bytes:
        """The bytes that change with every reading of the IMU."""
        ...

    def has_restarted(self, reply: bytes, before: bytes, seconds: float = 0.0, /) -> bool:
        """Whether the controller has restarted between two frames, aligned or not.

        seconds: minimum time between them, if the controller has received a frame just before its reply.
        """
        ...

    def forget_motors(self) -> None:
        """Discard the state of the motors, because the controller has restarted."""
        ...

    def shows_command(self, reply: bytes, sent: bytes, /) -> bool:
        """Whether the frame shows the command that was sent before it (True if the firmware does not
        tell)."""
        ...

    def shows_stopped(self, reply: bytes) -> bool:
        """Whether the frame shows motors without current (True if the firmware does not tell)."""
        ...

    def bemf(self, reading: Reading, differences: Counts | None, seconds: float, /) -> Bemf | None:
        """Back-EMF in counts, None without an update. differences: None after a jump. seconds: since the last
        reading."""
        ...

    def ticks(self, totals: Sequence[int]) -> Words:
        """Positions in ticks from the unwrapped counters."""
        ...

    def are_suspicious(self, differences: Counts, seconds: float, /) -> bool:
        """Whether the counters moved so that they must be read again. seconds: since the last reading."""
        ...

    def is_torn(self, first: Counts, second: Counts, seconds: float, /) -> bool:
        """Whether the second of two readings of the counters, `seconds` apart, shows that the first was
        torn."""
        ...

    @property
    def is_averaged(self) -> bool:
        """Whether the last back-EMF is a mean over so long a time that it says nothing about the present."""
        ...

    @property
    def stuck_counters(self) -> tuple[bool, ...]:
        """For each motor, whether its counter stands still although the motor turns."""
        ...

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
        """The `Inputs` of a cycle. imu, analog: whether these words are usable."""
        ...

    @property
    def bemf_rate_hz(self) -> float | None:
        """Measured updates of the counters a second; None before there was enough motion."""
        ...
