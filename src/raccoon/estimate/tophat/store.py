"""Calibrations on disk: named sets per surface and sensor, with their history, in one JSON file."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from raccoon.core.errors import ConfigError
from raccoon.core.files import write_atomically
from raccoon.estimate.tophat.stored_calibration import StoredCalibration, parse_entry

__all__ = ["StoredCalibration", "TophatStore"]

FORMAT = 1
MAX_STORED = 50  # calibrations of one robot's sensor and surface


class TophatStore:
    """The file of calibrations. Nothing is read before it is asked for, and nothing is half written."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def history(self, sensor: str | None = None, set_name: str | None = None) -> list[StoredCalibration]:
        """What is stored, oldest first; of one sensor or set where given. Empty where there is no file.

        Raises ConfigError naming the file where it is damaged or of another format, and the sensor, the value
        and what is allowed where it says what no sensor reads; TypeError for a set that is not named by text,
        which no file could be read with again.
        """
        if not isinstance(set_name, str | None):
            raise TypeError(f"set_name is {set_name!r}: it must be a text")
        return [
            each
            for each in self._load()
            if sensor in (None, each.sensor) and set_name in (None, each.set_name)
        ]

    def latest(self, sensor: str, set_name: str = "default") -> StoredCalibration | None:
        """The newest calibration of a sensor for a set, or None."""
        found = self.history(sensor, set_name)
        return found[-1] if found else None

    def add(self, *entries: StoredCalibration) -> None:
        """Store these, all or none; the oldest of a robot's sensor and set go where there are more than 50.

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
            table = json.loads(self.path.read_text(encoding="utf-8"))
            if table["format"] != FORMAT:
                raise ConfigError(f"{self.path}: format {table['format']!r}; this version reads {FORMAT}")
            entries = list(enumerate(table["calibrations"]))
        except FileNotFoundError:
            return []
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            if isinstance(error, ConfigError):
                raise
            # One that it cannot decode has the whole file in its representation.
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
