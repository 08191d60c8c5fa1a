"""A port that replays a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from itertools import zip_longest
from pathlib import Path

from raccoon.core.errors import ReplayDiverged
from raccoon.core.progress import REPORT_PERIOD_CYCLES, report
from raccoon.core.readings import STOP, Inputs, Outputs
from raccoon.trace.format import Tick, Trace, read_trace

_FIELD_NAMES = {"duty": "motor.{}.duty", "brake": "motor.{}.brake", "servo_us": "servo.{}.pulse_us"}


class ReplayPort:
    """Returns the recorded cycles one by one without waiting, and checks the commands in answer to them.

    check: raise ReplayDiverged if a command or an estimate differs from the recorded one, naming cycle, field
    and both values; False ignores commands and estimates, to run a changed program on old readings.
    tolerance: relative difference that counts as equal. 0 compares exactly, which works on the machine that
    recorded; between machines mathematics libraries differ in the last bits: use 1e-9.
    """

    def __init__(self, trace: Trace | str | Path, *, check: bool = True, tolerance: float = 0.0) -> None:
        if not 0.0 <= tolerance < 1.0:
            raise ValueError(f"tolerance is {tolerance}: allowed are numbers from 0 to below 1")
        self.trace = trace if isinstance(trace, Trace) else read_trace(trace)
        self._check = check
        self._tolerance = tolerance
        self._tick = -1
        self._written = 0
        self._recorded: Tick | None = None
        self._last = STOP

    @property
    def follows_commands(self) -> bool:
        """Whether the readings are the result of the commands, which they are if commands are checked."""
        return self._check

    def read(self) -> Inputs:
        """The next recorded cycle. Raises EOFError after the last, ReplayDiverged if a command is missing."""
        self._check_count()
        if self._tick + 1 >= len(self.trace.ticks):
            raise EOFError(self._ending())
        self._tick += 1
        self._written = 0
        if self._tick and self._tick % REPORT_PERIOD_CYCLES == 0:
            report(f"replayed {self._tick} of {len(self.trace.ticks)} cycles")
        self._recorded = self.trace.ticks[self._tick]
        return self._recorded.inputs

    def write(self, outputs: Outputs) -> None:
        """Compare a command with the recorded one of this cycle. Raises ReplayDiverged if they differ."""
        if not self._check:
            return
        number = self._written
        self._written += 1
        commands = self._commands()
        if number >= len(commands):
            if self._tick == len(self.trace.ticks) - 1 and not commands:
                return  # the recording was stopped between reading and writing
            raise ReplayDiverged(self._tick, "command", None, outputs)
        self._last = outputs
        self._compare(commands[number], outputs)

    def finish(self) -> None:
        """Check the rest of the recording at the end of the program: raises ReplayDiverged if something moves
        in it.

        A recording may continue after its program: motors at rest and servos that hold or are switched off
        are no difference.
        """
        if not self._check:
            return
        following = (tick.commands for tick in self.trace.ticks[self._tick + 1 :])
        for number, commands in enumerate((self._commands()[self._written :], *following), self._tick):
            self._tick = number
            for recorded in commands:
                self._compare(recorded, _ended(recorded, self._last))

    def annotate(self, name: str, values: Sequence[float]) -> None:
        """Compare an estimate with the recorded one of this cycle. Raises ReplayDiverged if they differ."""
        if not self._check:
            return
        recorded = {} if self._recorded is None else self._recorded.estimates
        if name not in recorded:
            raise ReplayDiverged(self._tick, name, None, tuple(values))
        for index, (old, new) in enumerate(zip_longest(recorded[name], values)):
            if not self._same(old, new):
                raise ReplayDiverged(self._tick, f"{name}[{index}]", old, new)

    def event(self, text: str) -> None:
        """Ignore a remark: remarks are not compared."""

    def close(self) -> None:
        """Do nothing. May be called twice."""

    def _commands(self) -> tuple[Outputs, ...]:
        return self.trace.opening if self._recorded is None else self._recorded.commands

    def _check_count(self) -> None:
        """Raise ReplayDiverged if the cycle was recorded with a command and ends without one."""
        commands = self._commands()
        if self._check and self._written < len(commands):
            raise ReplayDiverged(self._tick, "command", commands[self._written], None)

    def _compare(self, recorded: Outputs, replayed: Outputs) -> None:
        for field in fields(Outputs):
            pairs = zip_longest(getattr(recorded, field.name), getattr(replayed, field.name))
            for port, (old, new) in enumerate(pairs):
                if not self._same(old, new):
                    raise ReplayDiverged(self._tick, _FIELD_NAMES[field.name].format(port), old, new)

    def _same(self, old: float | None, new: float | None) -> bool:
        if old is None or new is None:
            return old is new
        if old == new or (math.isnan(old) and math.isnan(new)):
            return True
        return math.isclose(old, new, rel_tol=self._tolerance)

    def _ending(self) -> str:
        count = len(self.trace.ticks)
        if self.trace.damage is None:
            return f"the recording has ended after {count} cycles"
        return f"the recording is damaged after {count} cycles ({self.trace.damage})"


def _ended(recorded: Outputs, last: Outputs) -> Outputs:
    """The command at the place of `recorded` if nothing moves since the `last` one: servos hold or are
    off."""
    held = zip(recorded.servo_us, last.servo_us, strict=True)
    return Outputs(brake=recorded.brake, servo_us=tuple(now and before for now, before in held))
