"""Store of tophat calibrations: named sets for each surface and sensor, with their history, in one JSON
file."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from raccoon.core.errors import ConfigError
from raccoon.core.files import read_bounded, write_atomically
from raccoon.estimate.tophat.stored_calibration import StoredCalibration, parse_entry

__all__ = ["StoredCalibration", "TophatStore"]

FORMAT = 1
MAX_STORED = 50  # for each robot, sensor and surface


class TophatStore:
    """The file of calibrations. It is read only when needed, and written atomically."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def history(self, sensor: str | None = None, set_name: str | None = None) -> list[StoredCalibration]:
        """The stored calibrations, oldest first; only those of a sensor or set if given. Empty if there is no
        file.

        Raises ConfigError naming the path if it is no file, larger than 32 MB, damaged or of another format,
        and the sensor, the value and what is allowed for a value that no sensor reads; TypeError for a set
        name that is not text, with which the file could not be read again.
        """
        if not isinstance(set_name, str | None):
            raise TypeError(f"set_name is {set_name!r}: it must be a text")
        return [
            each
            for each in self._load()
            if sensor in (None, each.sensor) and set_name in (None, each.set_name)
        ]

    def latest(self, sensor: str, set_name: str = "default") -> StoredCalibration | None:
        """The newest calibration of a sensor in a set, or None."""
        found = self.history(sensor, set_name)
        return found[-1] if found else None

    def add(self, *entries: StoredCalibration) -> None:
        """Store these, all or none; above 50 for a robot, sensor and set the oldest are dropped.

        Raises ConfigError for a calibration without a threshold: a failed one never replaces a good one.
        """
        for entry in entries:
            if not entry.calibration.usable:
                raise ConfigError(
                    f"{entry.sensor}: a calibration that is {entry.calibration.verdict} is not stored"
                )
        kept: list[StoredCalibration] = []
        counts: Counter[tuple[str, str, str]] = Counter()
        for each in reversed([*self._load(), *entries]):
            whose = each.sensor, each.set_name, each.robot
            counts[whose] += 1
            if counts[whose] <= MAX_STORED:
                kept.append(each)
        self._write(kept[::-1])

    def _load(self) -> list[StoredCalibration]:
        try:
            table = json.loads(read_bounded(self.path, plain=True).decode("utf-8"))
            if table["format"] != FORMAT:
                raise ConfigError(f"{self.path}: format {table['format']!r}; this version reads {FORMAT}")
            entries = list(enumerate(table["calibrations"]))
        except FileNotFoundError:
            return []
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            if isinstance(error, ConfigError):
                raise
            # A decoding error has the whole file in its repr.
            told = str(error) if isinstance(error, ValueError) else repr(error)
            raise ConfigError(f"{self.path}: not a file of tophat calibrations: {told}") from error
        try:
            return [parse_entry(each, f"calibrations[{number}]") for number, each in entries]
        except ConfigError as error:
            raise ConfigError(f"{self.path}: {error}") from None

    def _write(self, entries: list[StoredCalibration]) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        table = {"format": FORMAT, "calibrations": [asdict(each) for each in entries]}
        text = json.dumps(table, indent=1, allow_nan=False)
        write_atomically(self.path, text)
