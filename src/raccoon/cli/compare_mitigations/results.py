"""File of results, one line per robot, so that interrupted work can continue."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from raccoon.cli.compare_mitigations.measure import End, Ends, Found, Number
from raccoon.core.errors import ConfigError

BEGIN = '{"condition": '


def stored(path: Path, seed: int, tape_std: float) -> Found:
    """The robots in a file of results; empty if there is no file. An incomplete line is ignored.

    Raises ConfigError if the results are of another seed or tape, or the file contains no results.
    """
    try:
        return _found(path, path.read_text("utf-8") if path.exists() else "", seed, tape_std)
    except UnicodeDecodeError as error:  # its repr would contain the whole file
        raise ConfigError(f"{path}: not a file of results: {error}; take another") from None
    except (KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{path}: not a file of results: {error!r}; take another") from None


def _found(path: Path, text: str, seed: int, tape_std: float) -> Found:
    found: Found = {}
    for line in text.splitlines():
        try:
            row = json.loads(line)
        except ValueError:
            if line[: len(BEGIN)] != BEGIN[: len(line)]:  # not an incomplete line of results
                raise ConfigError(
                    f"{path}: not a file of results: it has {line[:40]!r}; take another"
                ) from None
            continue
        if (row["seed"], row["tape"]) != (seed, tape_std):
            raise ConfigError(
                f"{path} has results of --seed {row['seed']} --tape {row['tape']}: take another"
            )
        found[row["condition"], row["number"]] = {
            method: {name: End(**end) for name, end in ends.items()} for method, ends in row["ends"].items()
        }
    return found


def writer(path: Path, seed: int, tape_std: float) -> Callable[[Number, dict[str, Ends]], None]:
    """A function that appends a robot to a file of results."""

    def add(robot: Number, ends: dict[str, Ends]) -> None:
        row = {
            "condition": robot[0],
            "number": robot[1],
            "seed": seed,
            "tape": tape_std,
            "ends": _plain(ends),
        }
        with path.open("a", encoding="utf-8") as file:
            file.write("\n" * _cut_off(path) + json.dumps(row) + "\n")

    return add


def _plain(ends: dict[str, Ends]) -> dict[str, dict[str, dict[str, float]]]:
    return {method: {name: asdict(end) for name, end in each.items()} for method, each in ends.items()}


def _cut_off(path: Path) -> bool:
    """Whether the last line lacks its newline."""
    with path.open("rb") as file:
        if file.seek(0, 2) == 0:
            return False
        file.seek(-1, 2)
        return file.read(1) != b"\n"
