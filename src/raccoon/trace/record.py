"""A port that records what goes through another one."""

from __future__ import annotations

import warnings
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs
from raccoon.trace.encode import Cycle, Values, json_line
from raccoon.trace.header import Header, git_revision, header_table, library_version
from raccoon.trace.writer import TraceWriter

PLAIN = ".jsonl"
PACKED = ".jsonl.gz"


class RecordingPort:
    """Wraps a port and records every cycle: readings, commands, and the estimates and events it is told.

    path: where the recording goes; `run`, `run.jsonl` and `run.jsonl.gz` all mean that `run.jsonl` grows
    during the run and `run.jsonl.gz` replaces it when the port is closed. Only references are kept in the
    tick; a thread formats and writes them. A recording that fails (disk full, NaN from a port) ends there,
    says so in `failure` and by a RuntimeWarning on close, and the run goes on.

    seed: of everything random in the run. revision: git revision of the program, by default of the checkout
    around the current directory. Raises FileExistsError where there is such a recording and `overwrite` is
    not set.
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
    ) -> None:
        plain, self.path = recording_paths(path)
        there = None if overwrite else already_there(path)
        if there is not None:
            raise FileExistsError(f"{there} exists: choose another name or say overwrite=True")
        plain.parent.mkdir(parents=True, exist_ok=True)
        revision = revision or git_revision(Path.cwd())
        header = Header(type(port).__name__, config, seed, revision, library_version())
        self._port = port
        self._writer = TraceWriter(plain, self.path, json_line(header_table(header)))
        self._closed = False
        self._begin(None)

    @property
    def failure(self) -> str | None:
        """Why the recording ended before the run, None while all is well."""
        return self._writer.failure

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
        self._commands.append(outputs)
        self._port.write(outputs)

    def annotate(self, name: str, values: Values) -> None:
        """Record an estimate of this cycle: plain numbers, whose order the name fixes. Call once a cycle."""
        self._estimates.append((name, values))

    def event(self, text: str) -> None:
        """Record a remark of this cycle."""
        self._events.append(text)

    def close(self) -> None:
        """Motors off first; then finish the recording. May be called twice."""
        try:
            self._port.close()
        finally:
            if not self._closed:
                self._closed = True
                self._hand_over()
                self._writer.finish()
                if self.failure is not None:
                    warnings.warn(f"{self.path} ends early: {self.failure}", RuntimeWarning, stacklevel=2)

    def _begin(self, inputs: Inputs | None) -> None:
        self._inputs = inputs
        self._commands: list[Outputs] = []
        self._estimates: list[tuple[str, Values]] = []
        self._events: list[str] = []

    def _hand_over(self) -> None:
        if self._inputs is not None or self._commands or self._events:
            cycle = Cycle(self._inputs, tuple(self._commands), tuple(self._estimates), tuple(self._events))
            self._writer.put(cycle)


def recording_paths(path: str | Path) -> tuple[Path, Path]:
    """The growing and the finished file of a recording."""
    path = Path(path)
    name = path.name.removesuffix(".gz").removesuffix(PLAIN)
    return path.with_name(name + PLAIN), path.with_name(name + PACKED)


def already_there(path: str | Path) -> Path | None:
    """The file that a recording of this name would replace; None where there is none."""
    return next((each for each in recording_paths(path) if each.exists()), None)
