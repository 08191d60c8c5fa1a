"""The recordings given to `raccoon diagnose`: their files, order and names."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.core.near_names import did_you_mean_file
from raccoon.trace.loading import find_recordings, natural_sort_key
from raccoon.trace.record import recording_file


def recordings(paths: Sequence[Path]) -> list[Path]:
    """The files of recordings, each once. Files in folders come in natural order of their names (run2 before
    run10), and so do given files that are in alphabetical order, as a shell sorts them. Raises
    FileNotFoundError."""
    found: list[Path] = []
    given = list(paths)
    for path in map(recording_file, sorted(given, key=natural_sort_key) if given == sorted(given) else given):
        if path.is_dir():
            found += find_recordings(path)
        elif path.exists():
            found.append(path)
        else:
            raise FileNotFoundError(f"{path}: there is no such recording{did_you_mean_file(path)}")
    return _without_repeats(found)


def _without_repeats(paths: Sequence[Path]) -> list[Path]:
    """Each file once: a file given by itself and by its folder would count twice."""
    first: dict[str, Path] = {}
    for path in paths:
        before = first.setdefault(os.path.realpath(path), path)
        if before is not path:
            logging.getLogger(__name__).info("%s: it is named twice, and used once", path)
    return list(first.values())


def short_names(paths: Sequence[Path]) -> list[str]:
    """File names, preceded by as many of their folders as are needed to make them all different."""
    places = [path.absolute().parts for path in paths]
    for count in range(1, max(map(len, places), default=1) + 1):
        names = ["/".join(parts[-count:]) for parts in places]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]


def robot_names(robots: Sequence[tuple[str, Path | None]]) -> list[str]:
    """The name of each recording's robot: its own name, or if robot.toml gives none, the folder of that file.

    robots: for each recording, the robot's name and the robot.toml used. Different files with the same name
    count as one robot, which is logged.
    """
    files: dict[str, dict[str, Path]] = {}
    found = []
    for name, file in robots:
        called = file.absolute().parent.name if name == RobotConfig().name and file is not None else name
        found.append(called)
        if file is not None:
            files.setdefault(called, {}).setdefault(os.path.realpath(file), file)
    for called, each in files.items():
        if len(each) > 1:
            said = " and ".join(map(str, each.values()))
            logging.getLogger(__name__).info(
                "%s: the robots have the same name, %s, and are treated as one", said, called
            )
    return found
