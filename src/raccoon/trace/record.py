"""A port that records what goes through another one."""

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
"""Commands of a cycle that are kept, beside the last one; characters of remarks in a cycle, where each remark
and each bracket counts for 50. More would be a line that is not read again, nor what comes after it."""
MAX_CUT_REMARK_CHARACTERS = 200
"""Characters that are left of a remark that does not fit."""


class RecordingPort:
    """Wraps a port and records every cycle: readings, commands, and the estimates and events it is told.

    path: where the recording goes; `run`, `run.jsonl` and `run.jsonl.gz` all mean that `run.jsonl` grows
    during the run and `run.jsonl.gz` replaces it when the port is closed. Only references are kept in the
    tick; a thread formats and writes them. A recording that fails (disk full, NaN from a port) ends there,
    says so in `failure` and by a RuntimeWarning on close, and the run goes on.

    seed: of everything random in the run. revision: git revision of the program, by default of the checkout
    around the current directory. needed: whether the run is of no use without its recording. Then
    FileExistsError is raised where there is such a recording and `overwrite` is not set, and OSError where
    none can be begun. Where it is not needed, nothing of the recording stops the run: it takes the next free
    name (`run-2`, `run-3`; `path` says which), and what cannot be begun stands in `failure` and is told by a
    RuntimeWarning.
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
        """Why the recording ended before the run, None while all is well."""
        return self._failure if self._writer is None else self._writer.failure

    @property
    def real_time(self) -> bool:
        """Whether the wrapped port's cycles come by the wall's clock."""
        return in_real_time(self._port)

    def read(self) -> Inputs:
        """Next cycle of the wrapped port; what happened since the last one is handed to the writer."""
        try:
            inputs = self._port.read()
        except BaseException as error:
            self.event(f"read: {type(error).__name__}: {error}")
            raise
        self._hand_over()
        self._begin(inputs)
        return inputs

    def write(self, outputs: Outputs) -> None:
        """Pass a command on and record it, also where passing it on fails."""
        if len(self._commands) > MAX_COMMANDS:
            self._commands.pop()  # the last one is what holds
        self._commands.append(outputs)
        self._port.write(outputs)

    def annotate(self, name: str, values: Values) -> None:
        """Record an estimate of this cycle: plain numbers, whose order the name fixes. Call once a cycle."""
        self._estimates.append((name, values))

    def event(self, text: str) -> None:
        """Record a remark of this cycle; cut short where it is too long, left out where there is no room."""
        text = str(text)
        if len(text) > MAX_TEXT or _remark_size(text) > self._room:
            text = f"{text[:MAX_CUT_REMARK_CHARACTERS]}... ({len(text)} characters)"
        if (weight := _remark_size(text)) <= self._room:
            self._room -= weight
            self._events.append(text)

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: the file is finished by the process that began it."""
        self._closed = True

    def close(self) -> None:
        """Motors off first; then finish the recording. May be called twice."""
        try:
            self._port.close()
        finally:
            if not self._closed:
                self._closed = True
                self._finish()

    def _finish(self) -> None:
        if self._writer is None:  # which has been told
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
    """What a remark takes of the room of its cycle."""
    return len(text) + 50 * (1 + text.count("[") + text.count("{"))


def _begin_exactly(path: str | Path, header: str, overwrite: bool) -> tuple[TraceWriter, Path]:
    """Begin the recording of this very name."""
    there = None if overwrite else existing_recording(path)
    if there is not None:
        raise FileExistsError(f"{there} exists: choose another name or say overwrite=True")
    plain, packed = recording_paths(path)
    plain.parent.mkdir(parents=True, exist_ok=True)
    return TraceWriter(plain, packed, header, overwrite=overwrite), packed


def _begin_next_free(path: str | Path, header: str) -> tuple[TraceWriter, Path]:
    """Begin a recording of this name, or of the first with a number behind it that is free."""
    plain, packed = recording_paths(path)
    plain.parent.mkdir(parents=True, exist_ok=True)
    stem, number = plain.name.removesuffix(PLAIN), 1
    while True:
        if not (plain.exists() or packed.exists()):
            with suppress(FileExistsError):  # taken since we looked
                return TraceWriter(plain, packed, header), packed
        number += 1
        plain, packed = recording_paths(plain.with_name(f"{stem}-{number}{PLAIN}"))


def recording_paths(path: str | Path) -> tuple[Path, Path]:
    """The growing and the finished file of a recording. A leading ~ is the user's home, as in a shell."""
    path = Path(path)
    with suppress(RuntimeError):  # nobody knows where that is
        path = path.expanduser()
    name = path.name.removesuffix(".gz").removesuffix(PLAIN)
    return path.with_name(name + PLAIN), path.with_name(name + PACKED)


def existing_recording(path: str | Path) -> Path | None:
    """The file that a recording of this name would replace; None where there is none."""
    return next((each for each in recording_paths(path) if each.exists()), None)


def recording_file(path: str | Path) -> Path:
    """The path itself where it exists, and where nothing does; else the recording that was made under this
    name: `run` and `run.jsonl` are packed into `run.jsonl.gz` when the run has ended."""
    path = Path(path)
    return path if path.exists() else existing_recording(path) or path
