"""Calibrations of the tophats by a drive over floor and lines, and their reuse from a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from raccoon.core.errors import CalibrationError
from raccoon.core.files import kept_file
from raccoon.core.readings import Inputs
from raccoon.core.sections import SIMULATED_ONE
from raccoon.robot.actions.actions import Action, wait
from raccoon.robot.actions.functions import with_look
from raccoon.robot.actions.limits import check_robot, check_way
from raccoon.robot.actions.sequences import seq
from raccoon.robot.calibration.calibration_drives import collect_inputs, run_calibration_drive
from raccoon.robot.calibration.calibration_shelf import CalibrationShelf, port_counts, robot_name
from raccoon.robot.motions.driving import drive_until_stopped
from raccoon.robot.motions.pacing import wall_hint
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.estimate.tophat import TophatCalibration
    from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
    from raccoon.robot.robot import Robot

T = TypeVar("T")

STANDING_S = 0.4  # s of standing before a drive, in which a tophat that is unplugged wanders
SETTLING_S = 0.2  # s in which a robot comes to stand
WIDEST_LINE_M = 0.15  # m of black at a stretch: three lines of 5 cm, or one that is crossed at 20 degrees


def calibrate_tophats(
    robot: Robot,
    distance: float = 0.60,
    speed: float | None = None,
    *,
    store: str | Path | None = None,
    set_name: str = "default",
) -> dict[str, TophatCalibration]:
    """Drive `distance` m over floor and lines and calibrate every tophat from its readings.

    speed: m/s, `motion.speed` when None; it drives backwards if distance or speed is negative. The robot
    stands for 0.4 s before and 0.6 s after the drive, in which an open port shows that it wanders. The first
    call in a program loads scikit-learn before that: a second on a laptop, ten on a Raspberry Pi 3. Returns
    the calibrations by name; they are in use from now on.

    store: file to which they are added as `set_name` (`load_tophats` reads it), in the folder where the
    program was started or, if it exists only there, beside the program. It reports a sensor whose height
    changed since the previous calibration, one that read black for longer than a line is wide, and a store
    that fails after the drive or whose card is full or read-only. Raises ConfigError before anything moves if
    the store is damaged or cannot be written for another reason; CalibrationError if the distance was not
    driven, or naming each tophat whose readings allow no threshold, and why; then no calibration is changed.
    """
    from raccoon.estimate.tophat import calibrate
    from raccoon.estimate.tophat.mixture import load_scikit_learn

    check_robot(robot, "calibrate_tophats()")
    robot.require("calibrate_tophats()")
    check_way(distance=distance)
    velocity = robot.config.motion.speed if speed is None else speed
    if distance < 0.0:
        velocity = -abs(velocity)
    searching = drive_until_stopped(velocity, abs(distance))
    shelf = CalibrationShelf(robot, store, set_name)
    load_scikit_learn()  # while it stands: whoever waits after the drive would take it for stuck
    begin: list[Inputs] = []
    readings: list[tuple[Inputs, float]] = []
    end: list[Inputs] = []
    standing = wait(STANDING_S)
    stands = seq(
        collect_inputs(standing, begin),
        _collect_readings(searching, readings),
        wait(SETTLING_S),
        collect_inputs(standing, end),
    )
    held = run_calibration_drive(robot, stands)[1]
    found = {
        name: calibrate(*_counts_and_ways(readings, sensor.config.analog))
        for name, sensor in robot.tophats.items()
    }
    useless = _describe_useless(robot, found, (begin, end))
    if useless:
        reasons = "; ".join(f"{name}: {why}" for name, why in useless.items())
        raise CalibrationError(f"after {distance:g} m: {reasons}{wall_hint(held)}")
    shelf.take(found)
    for name, sensor in robot.tophats.items():
        _remark_wide_black(robot, name, found[name], *_counts_and_ways(readings, sensor.config.analog))
    return found


def _remark_wide_black(
    robot: Robot, name: str, made: TophatCalibration, counts: Sequence[float], ways: Sequence[float]
) -> None:
    """Report a tophat that read black for longer than any line is wide: a robot that is lifted reads the air
    as black, and its wheels go on turning. counts, ways: see `_counts_and_ways`."""
    widest = stretch = 0.0
    for read, way in zip(counts, ways, strict=True):
        stretch = stretch + way if made.threshold is not None and read > made.threshold else 0.0
        widest = max(widest, stretch)
    if widest > WIDEST_LINE_M:
        add_remark(
            robot,
            f"tophat {name} read black for {widest:.2f} m of the calibration drive, and no line is so wide: "
            "if the robot was lifted, calibrate again; a black board or a line along the way is fine",
        )


def _collect_readings(action: Action[T], log: list[tuple[Inputs, float]]) -> Action[T]:
    """The action, with the readings of all its ticks and the robot's speed at each (m/s) appended to
    `log`."""

    def look(robot: Robot) -> None:
        if robot.inputs is not None:
            log.append((robot.inputs, abs(robot.odometry.estimate.velocity)))

    return with_look(action, look, f"watched {action.name}")


def _counts_and_ways(log: Sequence[tuple[Inputs, float]], port: int) -> tuple[list[float], list[float]]:
    """Readings of an analog port, and the distance (m) driven up to each since the one before."""
    counts, ways, way = [], [], 0.0
    before = log[0][0].time if log else 0.0
    for inputs, speed in log:
        way += speed * (inputs.time - before)
        before = inputs.time
        read = inputs.analog[port]
        if read is not None:
            counts.append(read)
            ways.append(way)
            way = 0.0
    return counts, ways


_ASKED = {
    "one_surface": "; if it crossed both surfaces: is a tophat, and no other sensor, plugged into analog {}?",
    "saturated": "; check the plug of analog {}",
}
"""What a person should check, by `Verdict` of a tophat that cannot be used."""


def _describe_useless(
    robot: Robot, found: Mapping[str, TophatCalibration], standing: Sequence[Sequence[Inputs]]
) -> dict[str, str]:
    """The reasons why tophats cannot be used, by name. standing: readings while the robot stood."""
    from raccoon.estimate.tophat.quality import is_restless

    useless = {}
    for name, sensor in robot.tophats.items():
        port, each = sensor.config.analog, found[name]
        if each.threshold is None:
            useless[name] = f"{each.verdict}, {each.reason}{_ASKED.get(each.verdict, '').format(port)}"
        if any(is_restless(port_counts(inputs, port)) for inputs in standing):
            useless[name] = (
                f"floating, its reading wanders while the robot stands: is it plugged into analog {port}?"
            )
    return useless


NO_FILE = "the file does not exist: calibrate_tophats(..., store=) writes it"


def load_tophats(
    robot: Robot, store: str | Path = "tophats.json", set_name: str = "default"
) -> dict[str, TophatCalibration]:
    """Use the newest stored calibration of every tophat; returns them by name.

    store: a file, looked for where the program was started and then beside the program, as robot.toml is. Two
    robots may share it: each uses its own calibrations, and another robot's only if it has none, which is
    reported. A simulated robot may use those of real ones, but no real robot uses those of a simulated one.
    Whether they fit shows within a second of driving: see `TophatSensor.fit`, the log and the recording.
    Raises CalibrationError naming the sensors without any, ConfigError for a damaged file.
    """
    from raccoon.estimate.tophat.store import TophatStore

    check_robot(robot, "load_tophats()")
    shelf = TophatStore(kept_file(store))
    own = robot_name(robot)
    entries = {name: _newest_calibration(shelf.history(name, set_name), own) for name in robot.tophats}
    missing = [name for name, entry in entries.items() if entry is None]
    if missing:
        raise CalibrationError(
            f"{store}: no calibration of {', '.join(missing)} in the set {set_name!r}; "
            f"{_describe_stored(shelf, own) if kept_file(store).exists() else NO_FILE}"
        )
    found = {name: entry.calibration for name, entry in entries.items() if entry is not None}
    for name, entry in entries.items():
        if entry is not None:
            borrowed = entry.robot not in ("", own, robot.config.name)
            robot.tophat(name).calibrate(entry.calibration, borrowed=borrowed)
            robot.note(f"tophat {name}: calibration {set_name!r} of {entry.time}")
            if borrowed:
                add_remark(
                    robot,
                    f"tophat {name}: its calibration {set_name!r} is from the robot {entry.robot!r}, but "
                    f"this robot is {own!r}: calibrate it too, unless only the robot's name has changed",
                )
    return found


def _newest_calibration(stored: Sequence[StoredCalibration], own: str) -> StoredCalibration | None:
    """The newest calibration that may be the robot `own`'s, else the newest of any real robot. stored: oldest
    first."""
    real = [each for each in stored if not each.robot.endswith(SIMULATED_ONE)]
    named = [each for each in real if each.robot in ("", own.removesuffix(SIMULATED_ONE))]
    simulated = [each for each in stored if own.endswith(SIMULATED_ONE) and each.robot == own]
    return next((each[-1] for each in (simulated, named, real) if each), None)


def _describe_stored(shelf: TophatStore, own: str) -> str:
    """Describes what a file of calibrations contains, for the robot `own`, which found nothing suitable in
    it."""
    sets: dict[str, dict[str, None]] = {}
    for each in shelf.history():
        foreign = each.robot.endswith(SIMULATED_ONE) and not own.endswith(SIMULATED_ONE)
        sets.setdefault(each.set_name, {})[each.sensor + (SIMULATED_ONE if foreign else "")] = None
    if not sets:
        return "the file has no calibration: calibrate_tophats(..., store=) writes them"
    return "there is " + "; ".join(f"{name!r} of {', '.join(sensors)}" for name, sensors in sets.items())
