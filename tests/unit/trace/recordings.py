"""Scripted ports and short recordings for the tests of this folder."""

from collections.abc import Iterable
from pathlib import Path

from raccoon.core.readings import SIMULATOR, Inputs, Outputs
from raccoon.trace.record import RecordingPort


class ScriptedPort:
    """Hands out given cycles; remembers commands and closings."""

    def __init__(self, cycles: Iterable[Inputs]) -> None:
        self._cycles = iter(cycles)
        self.commands: list[Outputs] = []
        self.closed = 0

    def read(self) -> Inputs:
        try:
            return next(self._cycles)
        except StopIteration:
            raise EOFError("the script has ended") from None

    def write(self, outputs: Outputs) -> None:
        self.commands.append(outputs)

    def close(self) -> None:
        self.closed += 1


def cycle(number: int, **changes: object) -> Inputs:
    """A plausible cycle at 200 Hz."""
    fields: dict[str, object] = {
        "bemf": (100 + number, 99.5, None, None),
        "position": (number, -number, None, None),
        "gyro": (1, -2, 300 + number),
        "battery": 752,
    }
    return Inputs(number / 200, SIMULATOR, **(fields | changes))  # type: ignore[arg-type]


def command(number: int) -> Outputs:
    """A command that differs from cycle to cycle and has no short decimal form."""
    return Outputs(duty=(number / 700, -number / 900, 0.0, 0.0))


def record(path: Path, count: int = 5) -> Path:
    """Record `count` cycles, each with a command and an estimate; the finished file."""
    port = RecordingPort(ScriptedPort(cycle(number) for number in range(count)), path, seed=7)
    for number in range(count):
        port.read()
        port.write(command(number))
        port.annotate("pose", (number / 3, number / 7, 0.1 + 0.2))
    port.close()
    return port.path
