"""Calibrations of the tophats: made by a drive over floor and lines, kept in a file, taken up again."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.core.files import near_program
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import seq, wait
from raccoon.robot.actions.limits import check_robot, check_way
from raccoon.robot.calibration.drives import driven, watched
from raccoon.robot.motions.driving import search
from raccoon.robot.motions.pacing import at_a_wall
from raccoon.robot.remarks import say

if TYPE_CHECKING:
    from raccoon.estimate.tophat import TophatCalibration
    from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
    from raccoon.robot.robot import Robot

STANDING = 0.4  # s of standing before a drive, in which a tophat that is unplugged wanders
SETTLING = 0.2  # s in which a robot comes to stand
OF_THE_CARD = (errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EIO)  # full, worn, or mounted to be read only


def calibrate_tophats(
    robot: Robot,
    distance: float = 0.60,
    speed: float | None = None,
    *,
    store: str | Path | None = None,
    set_name: str = "default",
) -> dict[str, TophatCalibration]:
    """Drive `distance` m over floor and lines and calibrate every tophat from what it read.

    The robot stands for 0.4 s before and 0.6 s after it, in which an open port shows that wanders.
    Returns the calibrations by name; they are in use from now on. speed: m/s, `motion.speed` when None; it
    drives backwards where distance or speed is negative. store: file that they are added to as `set_name`
    (`load_tophats` reads it), where the program was started or, where it is only there, beside the program.
    A sensor whose height changed since the calibration before is said, and so is a store that fails after the
    drive, or for which the card is full or can only be read. Raises ConfigError before anything moves where
    the store is damaged or otherwise cannot be written; CalibrationError where the way was not driven, or
    naming each tophat whose readings allow no threshold, and why; no calibration is changed then.
    """
    from raccoon.estimate.tophat import calibrate

    check_robot(robot, "calibrate_tophats()")
    robot.require("calibrate_tophats()")
    check_way(distance=distance)
    velocity = robot.config.motion.speed if speed is None else speed
    if distance < 0.0:
        velocity = -abs(velocity)
    searching = search(velocity, abs(distance))
    before = {name: each.calibration for name, each in robot.tophats.items()}
    # In a replay this was stored when it happened.
    kept = None if store is None or hasattr(robot.port, "trace") else near_program(store)
    if kept is not None:
        stored = _checked(kept, set_name, robot.config.name)
        before = {name: stored.get(name) if each is None else each for name, each in before.items()}
    begin: list[Inputs] = []
    readings: list[Inputs] = []
    end: list[Inputs] = []
    standing = wait(STANDING)
    stands = seq(
        watched(standing, begin), watched(searching, readings), wait(SETTLING), watched(standing, end)
    )
    held = driven(robot, stands)[1]
    found = {
        name: calibrate(_counts(readings, sensor.config.analog)) for name, sensor in robot.tophats.items()
    }
    useless = _useless(robot, found, (begin, end))
    if useless:
        reasons = "; ".join(f"{name}: {why}" for name, why in useless.items())
        raise CalibrationError(f"after {distance:g} m: {reasons}{at_a_wall(held)}")
    for name, each in found.items():
        robot.tophat(name).calibrate(each)
    _compare(robot, before, found)
    if kept is not None:
        try:
            _store(robot, found, kept, set_name)
        except (OSError, ValueError) as error:
            say(robot, f"the tophats are calibrated, but {kept} does not have it: {error}")
    return found


def _useless(
    robot: Robot, found: Mapping[str, TophatCalibration], standing: Sequence[Sequence[Inputs]]
) -> dict[str, str]:
    """Why a tophat cannot be used, by name. standing: what was read while the robot stood."""
    from raccoon.estimate.tophat.quality import restless

    useless = {
        name: f"{each.verdict}, {each.reason}" for name, each in found.items() if each.threshold is None
    }
    for name, sensor in robot.tophats.items():
        port = sensor.config.analog
        if any(restless(_counts(each, port)) for each in standing):
            useless[name] = f"floating, it wanders while the robot stands: is it plugged into analog {port}?"
    return useless


def load_tophats(
    robot: Robot, store: str | Path = "tophats.json", set_name: str = "default"
) -> dict[str, TophatCalibration]:
    """Use the newest stored calibration of every tophat; returns them by name.

    store: a file, looked for where the program was started and then beside the program, as robot.toml is.
    Two robots may share it: this one's own go first, and another one's are used where there are none, which
    is said.
    Whether they fit is found out within a second of driving: see `TophatSensor.fit`, the log and the
    recording. Raises CalibrationError naming the sensors that have none, ConfigError for a damaged file.
    """
    from raccoon.estimate.tophat.store import TophatStore

    check_robot(robot, "load_tophats()")
    shelf = TophatStore(near_program(store))
    own = robot.config.name
    entries = {name: _newest(shelf.history(name, set_name), own) for name in robot.tophats}
    missing = [name for name, entry in entries.items() if entry is None]
    if missing:
        raise CalibrationError(
            f"{store}: no calibration of {', '.join(missing)} in the set {set_name!r}; {_there_is(shelf)}"
        )
    found = {name: entry.calibration for name, entry in entries.items() if entry is not None}
    for name, entry in entries.items():
        if entry is not None:
            robot.tophat(name).calibrate(entry.calibration)
            robot.note(f"tophat {name}: calibration {set_name!r} of {entry.time}")
            if entry.robot not in ("", own):
                say(
                    robot,
                    f"tophat {name}: its calibration {set_name!r} is that of the robot {entry.robot!r}, and "
                    f"this one is {own!r}: calibrate it, too, unless only its name is new",
                )
    return found


def _newest(stored: Sequence[StoredCalibration], own: str) -> StoredCalibration | None:
    """The newest one that may be of the robot `own`, else the newest of any; `stored`: oldest first."""
    mine = [each for each in stored if each.robot in ("", own)]
    return next(reversed(mine or stored), None)


def _there_is(shelf: TophatStore) -> str:
    """What a file of calibrations has, for whoever looks for something else."""
    sets: dict[str, dict[str, None]] = {}
    for each in shelf.history():
        sets.setdefault(each.set_name, {})[each.sensor] = None
    if not sets:
        return "there is none at all: calibrate_tophats(..., store=) writes them"
    return "there is " + "; ".join(f"{name!r} of {', '.join(sensors)}" for name, sensors in sets.items())


def _checked(store: Path, set_name: str, own: str) -> dict[str, TophatCalibration]:
    """The newest calibrations of the robot `own` in `store`, by name. Raises ConfigError where it cannot be
    read or written, but for what the card is to blame for: nobody mends that before a match, and the
    calibration is good all the same.
    """
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
        if error.errno not in OF_THE_CARD:
            raise ConfigError(f"store {store}: cannot be used, so nothing was driven: {error}") from error
    return found


def _compare(
    robot: Robot, before: dict[str, TophatCalibration | None], found: dict[str, TophatCalibration]
) -> None:
    """Say which sensors to use with care, and which sit higher or lower than at the calibration before."""
    from raccoon.estimate.tophat.calibration import Verdict
    from raccoon.estimate.tophat.watch import height_changed, swapped

    known = {name: each for name, each in before.items() if each is not None}
    floors = {name: (each.surfaces()[0].mean,) for name, each in found.items()}
    pair = swapped(known, floors) or ()
    if pair:
        say(
            robot,
            f"tophats {' and '.join(pair)} read each what the other one did at its last calibration: are "
            "their plugs exchanged?",
        )
    for name, now in found.items():
        if now.verdict is Verdict.WEAK:
            say(robot, f"tophat {name} is to be used with care: {now.reason}")
        last = before[name]
        if last is not None and name not in pair and height_changed(last, now):
            say(robot, f"tophat {name} sits higher or lower than at its last calibration")


def _store(robot: Robot, found: dict[str, TophatCalibration], store: Path, set_name: str) -> None:
    from datetime import UTC, datetime

    from raccoon.estimate.tophat.sensor import explanations
    from raccoon.estimate.tophat.store import StoredCalibration, TophatStore

    now = datetime.now(UTC).isoformat(timespec="seconds")
    entries = []
    for name, each in found.items():
        white, black = each.surfaces()
        known = explanations(white.mean, black.mean)
        ambient, generation = (known[0].ambient, known[0].generation) if len(known) == 1 else (None, None)
        entries.append(
            StoredCalibration(
                name, set_name, now, each, robot.config.name, ambient, robot.battery_voltage, generation
            )
        )
    TophatStore(store).add(*entries)


def _counts(readings: Sequence[Inputs], port: int) -> list[float]:
    return [counts for each in readings if (counts := each.analog[port]) is not None]
