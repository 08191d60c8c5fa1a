"""The first line of a trace: what was recorded, with which robot, by which version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from datetime import date
from pathlib import Path
from typing import Any

from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.errors import ConfigError, TraceError

FORMAT = "raccoon trace"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Header:
    """The description of a recording in its first line.

    port: name of the class that was recorded. library: version of raccoon that wrote it. revision: git
    revision of the recorded program, None if it was not under git. seed: of everything random in the run,
    None if nothing was. config: the robot, None if the recording does not contain it.
    """

    port: str = ""
    config: RobotConfig | None = None
    seed: int | None = None
    revision: str | None = None
    library: str = ""
    version: int = VERSION


def header_table(header: Header) -> dict[str, Any]:
    """The header as JSON values."""
    return {
        "format": FORMAT,
        "version": header.version,
        "library": header.library,
        "port": header.port,
        "seed": header.seed,
        "revision": header.revision,
        "config": None if header.config is None else robot_table(header.config),
    }


def parse_header(table: object) -> Header:
    """Decode the values of a header line.

    Raises TraceError if it is no header, is of a newer version, or contains an impossible value.
    """
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise TraceError(f"not a recording: the first line must say {FORMAT!r}")
    version = table.get("version")
    if type(version) is not int or not 1 <= version <= VERSION:
        raise TraceError(f"version is {version!r}: this library reads 1 to {VERSION}")
    seed = table.get("seed")
    if seed is not None and (type(seed) is not int or seed < 0):
        raise TraceError(f"seed is {seed!r}: it must be a whole number from 0 or null")
    return Header(
        port=_text(table, "port") or "",
        config=_config(table.get("config")),
        seed=seed,
        revision=_text(table, "revision"),
        library=_text(table, "library") or "",
        version=version,
    )


def _text(table: Mapping[str, object], key: str) -> str | None:
    value = table.get(key)
    if value is not None and not isinstance(value, str):
        raise TraceError(f"{key} is {value!r}: it must be a text")
    return value


def _config(table: object) -> RobotConfig | None:
    if table is None:
        return None
    if not isinstance(table, dict):
        raise TraceError(f"config is {table!r}: it must be the tables of a robot.toml")
    try:
        return parse_robot(_with_dates(table))
    except (ConfigError, ValueError, RecursionError) as error:
        raise TraceError(f"config: {error}") from error


def robot_table(config: RobotConfig) -> dict[str, Any]:
    """The tables of the `robot.toml` that gives `config`, as JSON values (dates as ISO texts)."""
    model = {
        section: _plain(getattr(config.model, section))
        for section in ("battery", "friction", "drive", "bemf", "imu")
    }
    model["motor"] = {side: _plain(getattr(config.model, side)) for side in ("left", "right")}
    return {
        "name": config.name,
        "controller": _plain(config.controller),
        "battery": _plain(config.battery),
        "drive": _plain(config.drive),
        "body": _plain(config.body),
        "motor": {str(port): _plain(motor) for port, motor in config.motors.items()},
        "tophat": {name: _plain(tophat) for name, tophat in config.tophats.items()},
        "bumper": {name: _plain(bumper) for name, bumper in config.bumpers.items()},
        "servo": {name: _plain(servo) for name, servo in config.servos.items()},
        "mechanism": {name: _plain(mechanism) for name, mechanism in config.mechanisms.items()},
        "motion": _plain(config.motion),
        "model": model,
    }


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        entries = ((each.name, getattr(value, each.name)) for each in fields(value))
        return {key: _plain(entry) for key, entry in entries if entry is not None}
    if isinstance(value, Mapping):
        return dict(value)
    return value.isoformat() if isinstance(value, date) else value


def _with_dates(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {
        key: date.fromisoformat(entry) if key == "date" and isinstance(entry, str) else _with_dates(entry)
        for key, entry in value.items()
    }


def library_version() -> str:
    """Installed version of this library, empty if it is not installed."""
    # A slow import that only recordings need; the package's own __init__ is above this layer.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("raccoon")
    except PackageNotFoundError:
        return ""


def git_revision(folder: Path) -> str | None:
    """Commit that is checked out in the git repository around `folder`; None if there is none.

    Reads a few small files and starts no program.
    """
    for parent in (folder, *folder.parents):
        if (parent / ".git").exists():
            try:
                return _head_commit(parent / ".git")
            except (OSError, UnicodeDecodeError):
                return None
    return None


def _head_commit(git: Path) -> str | None:
    if git.is_file():  # in a worktree or a submodule: the file names the folder
        git = git.parent / _first_line(git).removeprefix("gitdir: ")
    head = _first_line(git / "HEAD")
    if not head.startswith("ref: "):
        return head
    name = head.removeprefix("ref: ")
    shared = git / "commondir"
    common = git / _first_line(shared) if shared.is_file() else git
    if (common / name).is_file():
        return _first_line(common / name)
    packed = (common / "packed-refs").read_text(encoding="ascii").splitlines()
    return next((line.split()[0] for line in packed if line.endswith(f" {name}")), None)


def _first_line(path: Path) -> str:
    return path.read_text(encoding="utf-8").partition("\n")[0].strip()
