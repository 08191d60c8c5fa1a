"""Files that a command is to write: refused before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path

from raccoon.core.errors import ConfigError


def check_recording(path: Path) -> None:
    """Raise ConfigError where `--record` names a recording that is there already, or none can be written."""
    from raccoon.trace.record import already_there

    if path.is_dir():
        raise ConfigError(f"--record {path}: it is a folder; name a file")
    there = already_there(path)
    if there is not None:
        raise ConfigError(f"--record {there}: it is there already; choose another name")
    folder = next(each for each in path.absolute().parents if each.exists())  # the rest is made
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        raise ConfigError(f"--record {path}: nothing can be written in {folder}")


def check_folders(*paths: Path | None) -> None:
    """Raise ConfigError where a file would have no folder, or is one itself; None: nobody asked for it."""
    for path in paths:
        if path is None:
            continue
        if not path.absolute().parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent}")
        if path.is_dir():
            raise ConfigError(f"{path}: it is a folder; name a file")
