"""What the port must know of a firmware: one set of questions, answered by one class for each of the two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from raccoon.core.readings import ANALOG_FULL_SCALE, Device, Fault, Inputs, Outputs, Words
from raccoon.hal.wombat.firmware.counters import Bemf, Counts
from raccoon.hal.wombat.link.link import Link

LARGEST_BEMF = 2000.0
"""Counts that no motor on this board exceeds: 6.6 V induced."""
LARGEST_WORD = 2 * ANALOG_FULL_SCALE
"""Counts that no converter gives, nor a firmware makes of them where it corrects its supply voltage."""


class Reading:
    """One decoded frame, as far as both firmwares agree.

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
    """One firmware. Replies are frames as they came; only `is_aligned` ones may be read."""

    name: str
    length: int
    device: Device
    fastest_counter: float
    """Counts a second that no counter exceeds."""
    first_analog: int
    """Where the six analog ports begin in `Reading.words`."""
    expected_rate_hz: float | None
    """Updates of the counters a second that ticks are worked out with, where they depend on it."""

    def polls_per_cycle(self, period: float, /) -> int:
        """Looks in a cycle of `period` seconds that it takes to see every update of the counters."""
        ...

    def with_rate(self, bemf_rate_hz: float) -> Dialect:
        """The same firmware whose counters are updated that often. Raises ConfigError outside 50 to 1000."""
        ...

    def command(self, outputs: Outputs) -> bytes:
        """The complete command, as the next frame."""
        ...

    def stop(self) -> bytes:
        """Everything off."""
        ...

    def hold(self, outputs: Outputs) -> bytes:
        """Motors off, servos as in `outputs`, whatever frames came before."""
        ...

    def is_aligned(self, reply: bytes) -> bool:
        """Whether the frame starts where it must."""
        ...

    def describe_foreign(self, reply: bytes) -> str | None:
        """What else answers, where it is not this firmware but a whole frame of another."""
        ...

    def realign(self, link: Link, reply: bytes, /) -> None:
        """Try to bring shifted frames back, with nothing but zeros."""
        ...

    def read(self, reply: bytes) -> Reading:
        """Take an aligned frame apart."""
        ...

    def is_credible(self, reading: Reading) -> bool:
        """Whether its words of the converter are such as that gives."""
        ...

    def life_words(self, reply: bytes) -> bytes:
        """The part that noise changes for as long as the main loop runs."""
        ...

    def imu_words(self, reply: bytes) -> bytes:
        """The part that changes with every reading of the IMU."""
        ...

    def has_restarted(self, reply: bytes, before: bytes, seconds: float = 0.0, /) -> bool:
        """Whether the controller has restarted between two frames, aligned or not.

        seconds: that have passed at least, where the controller has taken a frame just before its reply.
        """
        ...

    def forget_motors(self) -> None:
        """The controller has restarted: what was known of its motors is of before."""
        ...

    def shows_command(self, reply: bytes, sent: bytes, /) -> bool:
        """Whether the frame shows what the command before it asked for (True where it cannot tell)."""
        ...

    def shows_stopped(self, reply: bytes) -> bool:
        """Whether the frame shows motors without current (True where it cannot tell)."""
        ...

    def bemf(self, reading: Reading, differences: Counts | None, seconds: float, /) -> Bemf | None:
        """Back-EMF counts, None where there is nothing new. differences: None where a counter jumped."""
        ...

    def ticks(self, totals: Sequence[int]) -> Words:
        """Positions in ticks of the unwrapped counters."""
        ...

    def are_suspicious(self, differences: Counts, seconds: float, /) -> bool:
        """Whether counters moved in a way that deserves a second look."""
        ...

    def is_torn(self, first: Counts, second: Counts, seconds: float, /) -> bool:
        """Whether of two looks at the counters, `seconds` apart, the second shows that the first was torn."""
        ...

    @property
    def is_averaged(self) -> bool:
        """Whether the last back-EMF is a mean over so long a time that it tells nothing of now."""
        ...

    @property
    def stuck_counters(self) -> tuple[bool, ...]:
        """Of each motor, whether its counter stands still and must not."""
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
        """The readings of a cycle. imu, analog: whether these words can be used."""
        ...

    @property
    def bemf_rate_hz(self) -> float | None:
        """Measured updates of the counters a second, None before there was enough motion."""
        ...
