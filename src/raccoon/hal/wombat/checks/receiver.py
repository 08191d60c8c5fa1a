"""Reception of frames: handles dead, shifted, torn and foreign ones and returns valid ones."""

from __future__ import annotations

from raccoon.core.clock import Clock
from raccoon.core.errors import HardwareError
from raccoon.core.readings import Fault, Words
from raccoon.hal.wombat.firmware.counters import Bemf, Counters, Counts
from raccoon.hal.wombat.firmware.dialect import Dialect, Reading
from raccoon.hal.wombat.link.link import Link

PATIENCE_SECONDS = 0.5
"""s without a usable frame after which the link is lost."""
ALIGN_ATTEMPTS = 3
MAX_DISOBEYED_FRAMES = 40
"""Frames in a row whose command does not show in the controller, after which raccoon gives up."""
MAX_RESTARTS, RESTART_SECONDS = 3, 10.0
LONGEST_TRANSFER_SECONDS, TRANSFER_ATTEMPTS = 0.01, 3
"""Longest transfer that is not repeated, s (on a slow bus one takes 5 ms), and most attempts. If the program
was interrupted during a transfer, its words may be from before or after that."""


class Receiver:
    """Exchanges frames, accepts the valid ones and accumulates the positions.

    `begin_cycle` starts a cycle; `exchange` and `poll` belong to it. `faults` and `bemf` are those of the
    cycle; `time` is when its words were taken, s of the clock.
    """

    def __init__(self, dialect: Dialect, link: Link, clock: Clock) -> None:
        self._dialect = dialect
        self._link = link
        self._clock = clock
        self._counters = Counters(dialect.fastest_counter)
        self._last: Reading | None = None
        self.time = self._time = 0.0
        self._sent = bytes(dialect.length)
        self._expected: bytes | None = None
        self._previous: bytes | None = None
        self._has_restarted = False
        self._failure = ""
        self._unusable_since: float | None = None
        self._disobeyed = 0
        self._restarts: list[float] = []
        self.faults: list[Fault] = []
        self.bemf: Bemf | None = None

    @property
    def position(self) -> Words:
        """Positions in ticks, counted in 64 bits."""
        return self._dialect.ticks(self._counters.totals)

    def begin_cycle(self) -> None:
        """Start a cycle: clear its faults and back-EMF."""
        self.faults = []
        self.bemf = None

    def exchange(self, frame: bytes) -> bytes:
        """One transfer. The reply shows the state before this frame, so after the previous one. A failed
        transfer returns zeros."""
        self._expected, self._sent = self._sent, frame
        try:
            reply, self._failure = self._link.transfer(frame), ""
        except HardwareError as error:
            reply, self._failure = bytes(len(frame)), str(error)
        # Tested in every reply: the next command overwrites the signs of a restart.
        if self._previous is not None and self._dialect.has_restarted(reply, self._previous):
            self._has_restarted = True
        if self._dialect.is_aligned(reply):
            self._previous = reply
        return reply

    def poll(self, frame: bytes) -> Reading | None:
        """Send a command and return the reading that came back; None if it was unusable.

        Raises HardwareError if the link or the controller is lost.
        """
        before = self.time
        reply = self._timed_exchange(frame)
        time = self.time
        if time - before > PATIENCE_SECONDS:
            self._unusable_since = None  # the program paused: that says nothing about the link
        if not self._dialect.is_aligned(reply):
            recovered = self._recover(reply, time)
            if recovered is None:
                return None
            reply = recovered
        reading = self._check_reply(reply, time)
        if reading is None:
            self._wait_or_give_up(time, "its frames contradict each other")
            return None
        self._unusable_since = None
        self._last = reading
        self._time = self.time
        return reading

    def _timed_exchange(self, frame: bytes) -> bytes:
        """An exchange with `time` at its start. One that took too long for that is repeated."""
        for _ in range(TRANSFER_ATTEMPTS):
            self.time = self._clock.now()
            reply = self.exchange(frame)
            if self._clock.now() - self.time <= LONGEST_TRANSFER_SECONDS:
                break
        return reply

    def _check_reply(self, reply: bytes, time: float) -> Reading | None:
        reading = self._dialect.read(reply)
        credible = self._dialect.is_credible(reading)
        if self._last is None:
            if not credible:
                self.faults.append(Fault.TORN)
                return None
            self._has_restarted = False
            self._counters.continue_from(reading.position)
            return reading
        if self._has_restarted:
            self._take_restart(reading, time)
            return reading
        self._check_obedience(reply)
        seconds = time - self._time
        moved = self._counters.differences(reading.position)
        differences: Counts | None = moved
        if not credible or self._are_suspicious(moved, seconds):
            looked = self._read_again(moved, seconds, credible)
            if looked is None:
                return None
            reading, differences = looked
            seconds = self.time - self._time
        if differences is None:
            self._counters.continue_from(reading.position)
        else:
            self._counters.accept(reading.position, differences)
        bemf = self._dialect.bemf(reading, differences, seconds)
        if bemf is not None:
            self.bemf = bemf
        return reading

    def _are_suspicious(self, differences: Counts, seconds: float) -> bool:
        plausible = self._counters.are_plausible(differences, seconds)
        return not plausible or self._dialect.are_suspicious(differences, seconds)

    def _read_again(
        self, differences: Counts, seconds: float, credible: bool
    ) -> tuple[Reading, Counts | None] | None:
        """Read again to distinguish a torn word from a counter that really jumped.

        Returns the second reading and its differences (None after a jump), or None if both are unusable.
        differences: of the first reading. credible: whether the other words of the first reading are
        possible. The counters keep counting: on a slow bus they are updated once or twice between the
        readings.
        """
        first = self.time
        reply = self._timed_exchange(self._sent)
        later = self.time - first
        second = self._dialect.read(reply) if self._dialect.is_aligned(reply) else None
        if second is None or not self._dialect.is_credible(second):
            self.faults.append(Fault.TORN)
            return None
        moved = self._counters.differences(second.position)
        apart = max(abs(new - old) for new, old in zip(moved, differences, strict=True))
        if self._counters.are_plausible(moved, seconds + later):
            believed = credible and self._counters.are_plausible(differences, seconds)
            if not believed or self._dialect.is_torn(differences, moved, later):
                self.faults.append(Fault.TORN)
            return second, moved
        if not self._are_near(apart, later):
            self.faults.append(Fault.TORN)
            return None
        # Both readings agree on a position that the motors cannot have reached: continue from there.
        self.faults.append(Fault.POSITION_JUMP)
        return second, None

    def _are_near(self, apart: int, seconds: float) -> bool:
        return self._counters.are_plausible((apart, 0, 0, 0), seconds)

    def _check_obedience(self, reply: bytes) -> None:
        if self._expected is None or self._dialect.shows_command(reply, self._expected):
            self._disobeyed = 0
            return
        self.faults.append(Fault.COMMAND_LOST)
        self._disobeyed += 1
        if self._disobeyed >= MAX_DISOBEYED_FRAMES:
            raise HardwareError(
                f"{Fault.COMMAND_LOST}: {self._disobeyed} commands in a row did not reach the registers:"
                " another program commands the robot, or the firmware speaks another protocol version"
            )

    def _take_restart(self, reading: Reading, time: float) -> None:
        self._has_restarted = False
        self.faults.append(Fault.RESET)
        self._counters.continue_from(reading.position)
        self._dialect.forget_motors()
        self._restarts = [*(each for each in self._restarts if time - each < RESTART_SECONDS), time]
        if len(self._restarts) >= MAX_RESTARTS:
            raise HardwareError(
                f"{Fault.RESET}: the controller restarted {MAX_RESTARTS} times within {RESTART_SECONDS:.0f} "
                "s: charge the battery, check the power connector"
            )

    def _recover(self, reply: bytes, time: float) -> bytes | None:
        """An aligned frame in place of a dead or shifted one; None if there is none."""
        if reply == reply[:1] * len(reply):
            self.faults.append(Fault.LINK_DEAD)
            self._wait_or_give_up(time, self._failure or f"the link says 0x{reply[0]:02X} and nothing else")
            return None
        self._refuse_stranger(reply)
        self.faults.append(Fault.MISALIGNED)
        for _ in range(ALIGN_ATTEMPTS):
            self._dialect.realign(self._link, reply)
            reply = self.exchange(bytes(self._dialect.length))
            if self._dialect.is_aligned(reply):
                self._expected = None
                last = self._last
                if last is not None and self._dialect.has_restarted(reply, last.reply, time - self._time):
                    self._has_restarted = True
                return reply
        self._wait_or_give_up(time, f"no frame can be found in {reply[:8].hex(' ')} ...")
        return None

    def _refuse_stranger(self, reply: bytes) -> None:
        """Raise HardwareError if another firmware answers, and does so a second time."""
        stranger = self._dialect.describe_foreign(reply)
        if stranger is not None:
            again = self.exchange(bytes(self._dialect.length))
            if self._dialect.describe_foreign(again) == stranger:
                raise HardwareError(f"{Fault.LINK_DEAD}: {stranger}")

    def _wait_or_give_up(self, time: float, complaint: str) -> None:
        """Handle a cycle without a usable frame; raises HardwareError if that lasts too long."""
        if self._unusable_since is None:
            self._unusable_since = time
        elif time - self._unusable_since > PATIENCE_SECONDS:
            names = "/".join(dict.fromkeys(self.faults))
            raise HardwareError(
                f"{names}: the {self._dialect.name} controller is lost: {complaint} for"
                f" {time - self._unusable_since:.1f} s; check battery and power switch, switch off and on"
            )
