"""Common end of all tophat calibrations: compare with the previous ones, put into use, and store."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.config import REAL_CONTROLLERS
from raccoon.core.errors import ConfigError
from raccoon.core.files import kept_file
from raccoon.core.port import bystander_of
from raccoon.core.readings import Inputs
from raccoon.core.sections import SIMULATED_ONE
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.estimate.tophat import TophatCalibration
    from raccoon.robot.robot import Robot

CARD_ERRNOS = (errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EIO)  # full, worn, or mounted to be read only


def robot_name(robot: Robot) -> str:
    """The robot's name under which calibrations are stored."""
    simulated = bystander_of(robot.port) is not None or robot.config.controller.port not in REAL_CONTROLLERS
    return robot.config.name + SIMULATED_ONE if simulated else robot.config.name


class CalibrationShelf:
    """Puts the calibrations of a robot's tophats into use and into the file `store`, if any.

    Raises ConfigError if the file is damaged or cannot be written, and if robot.toml has no tophat. Make it
    before anything moves.
    """

    def __init__(self, robot: Robot, store: str | Path | None, set_name: str) -> None:
        if not robot.tophats:
            raise ConfigError("there is no tophat in robot.toml to calibrate: [tophat.NAME] makes one")
        self._robot, self._set_name = robot, set_name
        self._before = {
            name: None if each.is_borrowed else each.calibration for name, each in robot.tophats.items()
        }
        self._kept = None if store is None else kept_file(store)
        if self._kept is not None:
            stored = _stored_calibrations(self._kept, set_name, robot_name(robot))
            self._before = {
                name: stored.get(name) if each is None else each for name, each in self._before.items()
            }

    def take(self, found: Mapping[str, TophatCalibration]) -> None:
        """Put them into use, report what is odd about them, and add them to the file."""
        robot, kept = self._robot, self._kept
        for name, each in found.items():
            robot.tophat(name).calibrate(each)
        _remark_on_changes(robot, self._before, found)
        if kept is not None:
            try:
                _store_calibrations(robot, found, kept, self._set_name)
            except (OSError, ValueError) as error:
                add_remark(
                    robot,
                    f"the tophats are calibrated, but the calibration could not be stored in {kept}: {error}",
                )


def _stored_calibrations(store: Path, set_name: str, own: str) -> dict[str, TophatCalibration]:
    """The newest calibrations of the robot `own` in `store`, by name. Raises ConfigError if it cannot be read
    or written, except for faults of the card: nobody repairs that before a match, and the calibration itself
    is good."""
    from raccoon.estimate.tophat.store import TophatStore

    found: dict[str, TophatCalibration] = {}
    try:
        stored = TophatStore(store).history(set_name=set_name)
        found = {each.sensor: each.calibration for each in stored if each.robot in ("", own)}
        store.parent.mkdir(parents=True, exist_ok=True)
        # As the store itself does it: only a file that was made tells whether one can be.
        handle, trial = tempfile.mkstemp(dir=store.parent, prefix=f".{store.name}.", suffix=".part")
        os.close(handle)
        Path(trial).unlink()
    except OSError as error:
        if error.errno not in CARD_ERRNOS:
            raise ConfigError(
                f"store {store}: cannot be used, so the robot did not drive: {error}"
            ) from error
    return found


def _remark_on_changes(
    robot: Robot, before: Mapping[str, TophatCalibration | None], found: Mapping[str, TophatCalibration]
) -> None:
    """Report sensors to use with care, and sensors that sit higher or lower than at the previous
    calibration."""
    from raccoon.estimate.tophat.calibration import Verdict
    from raccoon.estimate.tophat.calibration_watch import find_swapped, has_height_changed

    known = {name: each for name, each in before.items() if each is not None}
    floors = {name: (each.surfaces()[0].mean,) for name, each in found.items()}
    pair = find_swapped(known, floors) or ()
    if pair:
        add_remark(
            robot,
            f"tophats {' and '.join(pair)} each read what the other one read at its last calibration: are "
            "their plugs exchanged?",
        )
    for name, now in found.items():
        if now.verdict is Verdict.WEAK:
            add_remark(robot, f"use tophat {name} with care: {now.reason}")
        last = before[name]
        if last is not None and name not in pair and has_height_changed(last, now):
            add_remark(robot, f"tophat {name} sits higher or lower than at its last calibration")


def _store_calibrations(
    robot: Robot, found: Mapping[str, TophatCalibration], store: Path, set_name: str
) -> None:
    from datetime import UTC, datetime

    from raccoon.estimate.tophat.sensor import explain_levels
    from raccoon.estimate.tophat.store import StoredCalibration, TophatStore

    now = datetime.now(UTC).isoformat(timespec="seconds")
    entries = []
    for name, each in found.items():
        white, black = each.surfaces()
        known = explain_levels(white.mean, black.mean)
        ambient, generation = (known[0].ambient, known[0].generation) if len(known) == 1 else (None, None)
        entries.append(
            StoredCalibration(
                name, set_name, now, each, robot_name(robot), ambient, robot.battery_voltage, generation
            )
        )
    TophatStore(store).add(*entries)


def port_counts(readings: Sequence[Inputs], port: int) -> list[float]:
    """What an analog port read, without the cycles that had no word of it."""
    return [counts for each in readings if (counts := each.analog[port]) is not None]
