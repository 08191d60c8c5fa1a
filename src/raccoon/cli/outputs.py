"""Files that a command is to write: refused before the work, not after it."""

from __future__ import annotations

from pathlib import Path

from raccoon.core.errors import ConfigError


def check_folders(*paths: Path | None) -> None:
    """Raise ConfigError where a file would have no folder, or is one itself; None: nobody asked for it."""
    for path in paths:
        if path is None:
            continue
        if not path.absolute().parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent}")
        if path.is_dir():
            raise ConfigError(f"{path}: it is a folder; name a file")
