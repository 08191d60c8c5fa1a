"""A port that records the readings and commands of another one."""

from __future__ import annotations

import warnings
from contextlib import suppress
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.core.fork_ownership import leave_in_forks
from raccoon.core.port import Port, bystander_of, in_real_time
from raccoon.core.readings import Inputs, Outputs
from raccoon.trace.encode import MAX_TEXT, Cycle, Values, json_line
from raccoon.trace.header import Header, git_revision, header_table, library_version
from raccoon.trace.writer import TraceWriter

PLAIN = ".jsonl"
PACKED = ".jsonl.gz"
MAX_COMMANDS, MAX_REMARK_CHARACTERS = 200, 50_000
"""Most commands kept in a cycle, besides the last one; most characters of remarks in a cycle, where each
remark and each bracket counts as 50. With more, a reader would refuse the line and all after it."""
MAX_CUT_REMARK_CHARACTERS = 200
"""Characters to which a remark is cut that is too long."""


class RecordingPort:
    """Wraps a port and records every cycle: readings, commands, estimates (`annotate`) and events (`event`).

    path: the recording; with `run`, `run.jsonl` or `run.jsonl.gz`, the file `run.jsonl` grows during the run
    and `run.jsonl.gz` replaces it when the port is closed. The tick only stores references; a thread formats
    and writes them. A recording that fails (disk full, NaN from a port) ends there, the run continues, and
    `failure` and a RuntimeWarning on close say why.

    seed: of everything random in the run. revision: git revision of the program, by default of the checkout
    around the current directory. needed: whether the run is of no use without its recording. If so,
    FileExistsError is raised if the recording exists and `overwrite` is not set, and OSError if it cannot be
    started. If not, no problem of the recording stops the run: it takes the next free name (`run-2`, `run-3`;
    `path` is that name), and if it cannot be started, `failure` and a RuntimeWarning say why.
    """

    def __init__(
        self,
        port: Port,
        path: str | Path,
        *,
        config: RobotConfig | None = None,
        seed: int | None = None,
        revision: str | None = None,
        overwrite: bool = False,
        needed: bool = True,
    ) -> None:
        self.path = Path(path)
        self._port = port
        self.bystander = bystander_of(port)
        self._writer: TraceWriter | None = None
        self._failure: str | None = None
        self._closed = False
        self._begin(None)
        leave_in_forks(self)
        try:
            revision = revision or git_revision(Path.cwd())
            header = json_line(
                header_table(Header(type(port).__name__, config, seed, revision, library_version()))
            )
            self._writer, self.path = (
                _begin_exactly(path, header, overwrite)
                if needed or overwrite
                else _begin_next_free(path, header)
            )
        except (OSError, ValueError, TypeError) as error:
            if needed:
                raise
            self._failure = str(error)
            warnings.warn(f"{path} is not recorded, the run goes on: {error}", RuntimeWarning, stacklevel=2)

    @property
    def failure(self) -> str | None:
        """Why the recording ended before the run, None if it did not."""
        return self._failure if self._writer is None else self._writer.failure

    @property
    def real_time(self) -> bool:
        """Whether the wrapped port's cycles follow real time."""
        return in_real_time(self._port)

    def read(self) -> Inputs:
        """The next cycle of the wrapped port. The cycle before it is handed to the writer."""
        try:
            inputs = self._port.read()
        except BaseException as error:
            self.event(f"read: {type(error).__name__}: {error}")
            raise
        self._hand_over()
        self._begin(inputs)
        return inputs

    def write(self, outputs: Outputs) -> None:
        """Pass a command on and record it, even if passing it on fails."""
        if len(self._commands) > MAX_COMMANDS:
            self._commands.pop()  # the last command is in force
        self._commands.append(outputs)
        self._port.write(outputs)

    def annotate(self, name: str, values: Values) -> None:
        """Record an estimate of this cycle: numbers in an order that is fixed for this name. Call once a
        cycle for each name."""
        self._estimates.append((name, values))

    def event(self, text: str) -> None:
        """Record a remark of this cycle. It is cut if it is too long, and left out if the cycle's limit is
        reached."""
        text = str(text)
        if len(text) > MAX_TEXT or _remark_size(text) > self._room:
            text = f"{text[:MAX_CUT_REMARK_CHARACTERS]}... ({len(text)} characters)"
        if (weight := _remark_size(text)) <= self._room:
            self._room -= weight
            self._events.append(text)

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: only the process that started the file finishes it."""
        self._closed = True

    def close(self) -> None:
        """Close the wrapped port, which stops the motors; then finish the recording. May be called twice."""
        try:
            self._port.close()
        finally:
            if not self._closed:
                self._closed = True
                self._finish()

    def _finish(self) -> None:
        if self._writer is None:  # there was a warning at the start
            return
        self._hand_over()
        self._writer.finish()
        if self.failure is not None:
            there = existing_recording(self.path) or self.path  # it may not have been packed
            warnings.warn(f"{there} ends early: {self.failure}", RuntimeWarning, stacklevel=3)

    def _begin(self, inputs: Inputs | None) -> None:
        self._inputs = inputs
        self._commands: list[Outputs] = []
        self._estimates: list[tuple[str, Values]] = []
        self._events: list[str] = []
        self._room = MAX_REMARK_CHARACTERS

    def _hand_over(self) -> None:
        if self._writer is not None and (self._inputs is not None or self._commands or self._events):
            cycle = Cycle(self._inputs, tuple(self._commands), tuple(self._estimates), tuple(self._events))
            self._writer.put(cycle)


def _remark_size(text: str) -> int:
    """Characters that a remark uses of the limit of its cycle."""
    return len(text) + 50 * (1 + text.count("[") + text.count("{"))


def _begin_exactly(path: str | Path, header: str, overwrite: bool) -> tuple[TraceWriter, Path]:
    """Start the recording of exactly this name."""
    there = None if overwrite else existing_recording(path)
    if there is not None:
        raise FileExistsError(f"{there} exists: choose another name or say overwrite=True")
    plain, packed = recording_paths(path)
    plain.parent.mkdir(parents=True, exist_ok=True)
    return TraceWriter(plain, packed, header, overwrite=overwrite), packed


def _begin_next_free(path: str | Path, header: str) -> tuple[TraceWriter, Path]:
    """Start a recording of this name, or of the first free one with a number appended."""
    plain, packed = recording_paths(path)
    plain.parent.mkdir(parents=True, exist_ok=True)
    stem, number = plain.name.removesuffix(PLAIN), 1
    while True:
        if not (plain.exists() or packed.exists()):
            with suppress(FileExistsError):  # taken since the check
                return TraceWriter(plain, packed, header), packed
        number += 1
        plain, packed = recording_paths(plain.with_name(f"{stem}-{number}{PLAIN}"))


def recording_paths(path: str | Path) -> tuple[Path, Path]:
    """The growing and the finished file of a recording. A leading ~ is the home folder, as in a shell."""
    path = Path(path)
    with suppress(RuntimeError):  # the home folder is unknown
        path = path.expanduser()
    name = path.name.removesuffix(".gz").removesuffix(PLAIN)
    return path.with_name(name + PLAIN), path.with_name(name + PACKED)


def existing_recording(path: str | Path) -> Path | None:
    """The file that a recording of this name would replace; None if there is none."""
    return next((each for each in recording_paths(path) if each.exists()), None)


def recording_file(path: str | Path) -> Path:
    """The file of a recording: the path itself if it exists, else the recording of this name (`run` and
    `run.jsonl` are packed into `run.jsonl.gz` at the end of the run); the path itself if neither exists."""
    path = Path(path)
    return path if path.exists() else existing_recording(path) or path
