"""Loading of any recording that this library can read, by path."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

from raccoon.core.config import RobotConfig, load_robot
from raccoon.core.errors import TraceError
from raccoon.trace.columns import recording_of
from raccoon.trace.csv import read_csv
from raccoon.trace.foreign import emps, fleet_steps, motor_steps, optiodom
from raccoon.trace.format import Trace, read_trace
from raccoon.trace.record import recording_file
from raccoon.trace.recording import Recording

SWEEP, ROWS = ".sweep.json", ".rows.csv"
"""Endings of the file beside a table of matches, and of its growing rows if the table is no CSV."""
ROBOT_TOML = "robot.toml"
TRACE_ENDINGS = (".jsonl", ".jsonl.gz")


@dataclass(frozen=True, slots=True)
class Run:
    """One recorded run.

    robot: as described by the recording, None if it does not describe it. trace: the raw words, if the
    recording is a trace. path: the file. whose: name of the robot, if that kind of file has one for each.
    """

    name: str
    recording: Recording
    robot: RobotConfig | None = None
    trace: Trace | None = None
    path: Path | None = None
    whose: str = ""


def load_runs(*paths: str | Path) -> list[Run]:
    """The runs in these files and folders. Doubtful values are blank and listed in `Recording.problems`.

    Raises TraceError for a file that cannot be read, FileNotFoundError for a path that does not exist.
    """
    return [load_run(file) for file in files_of(*paths)]


def files_of(*paths: str | Path) -> list[Path]:
    """The recordings at these paths. A path is a trace, a CSV, MCAP or EMPS file, an OptiOdom run or session,
    or a folder of any of these.

    Each file occurs once: a run that counts twice would make its results look more certain than they are.
    Raises TraceError for a folder without a recording.
    """
    files: dict[str, Path] = {}
    for path in map(Path, paths):
        found = find_recordings(path) if path.is_dir() else [recording_file(path)]
        if not found:
            raise TraceError(f"{path}: there is no recording in this folder")
        for file in found:
            files.setdefault(os.path.realpath(file), file)
    return list(files.values())


def natural_sort_key(path: Path) -> list[list[tuple[int, str]]]:
    """A key that sorts the numbers in paths by size: run2 before run10."""
    return [
        [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name) if part]
        for name in path.parts
    ]


def find_recordings(folder: Path) -> list[Path]:
    """The recordings in a folder and its subfolders, run2 before run10; without hidden folders (.venv, .git)
    and other files."""
    found = []
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        found += [path for path in (Path(place, name) for name in names) if _is_recording(path)]
    return sorted(found, key=natural_sort_key)


def _is_recording(path: Path) -> bool:
    """Whether a file is a recording by its name. The table of a sweep and files that describe recordings are
    not."""
    if path.name == optiodom.METADATA or path.with_name(path.name.removesuffix(ROWS) + SWEEP).exists():
        return False
    return path.name.endswith(TRACE_ENDINGS) or path.suffix.lower() in (".csv", ".mcap", ".mat")


def load_run(path: str | Path) -> Run:
    """One run; its name and first line determine its kind. Raises as `load_runs`."""
    path = recording_file(path)
    run = replace(_loaded(path), path=path)
    if run.recording.problems and len(run.recording["t"]) == 0:
        raise TraceError(f"{path}: no row of the recording can be used: {run.recording.problems[0]}")
    return run


def find_robot_toml(run: Run) -> tuple[RobotConfig, Path | None, str]:
    """The robot of a run that does not describe it, with its file and a description: from the robot.toml
    beside the run, else from that in the current directory, else the default robot.

    Raises ConfigError.
    """
    here = (Path(ROBOT_TOML), f"{ROBOT_TOML} of the current directory")
    beside = () if run.path is None else ((run.path.with_name(ROBOT_TOML), f"the {ROBOT_TOML} beside it"),)
    for path, described in (*beside, here):
        if path.is_file():
            return load_robot(path), path, described
    return RobotConfig(), None, "the default one"


def _loaded(path: Path) -> Run:
    if path.is_dir():
        raise TraceError(f"{path}: it is a folder; name a recording in it")
    if path.is_file() and not path.stat().st_size:
        raise TraceError(f"{path}: the file is empty")
    if path.name.endswith(TRACE_ENDINGS):
        trace = read_trace(path)
        return Run(path.name, recording_of(trace), trace.header.config, trace)
    if path.suffix.lower() == ".mcap":
        from raccoon.trace.mcap import read_mcap

        return Run(path.name, read_mcap(path))
    if path.suffix.lower() == ".mat":
        return Run(path.name, emps.read_emps(path))
    if path.exists() and not path.is_file():
        raise TraceError(
            f"{path}: it is a pipe or a device; a recording is read more than once, so name a file"
        )
    return _load_csv(path)


def _load_csv(path: Path) -> Run:
    with path.open("rb") as file:
        names = tuple(file.readline(10_000).decode("utf-8-sig", "replace").strip().split(","))
    if names == motor_steps.HEADER:
        return Run(path.name, motor_steps.read_motor_steps(path))
    if names == fleet_steps.HEADER:
        return Run(path.name, fleet_steps.read_fleet_steps(path), whose=path.stem)
    metadata = path.with_name(optiodom.METADATA)
    if "t" not in names and metadata.exists():
        robot = optiodom.read_robot(metadata)
        return Run(f"{path.parent.name}/{path.stem}", optiodom.read_run(path), robot)
    return Run(path.name, read_csv(path, strict=False))
