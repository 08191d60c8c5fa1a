"""The work of `raccoon calibrate tophats` (not a command of its own)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.cli.measured_values import SIMULATED_NOTE, is_any_simulated
from raccoon.cli.progress import show_progress
from raccoon.core.config import RobotConfig, load_robot
from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.core.sections import SIMULATED_ONE, TophatConfig
from raccoon.estimate.drive_calibration.columns import manoeuvre_from_columns
from raccoon.estimate.drive_calibration.paths import integrate_path
from raccoon.estimate.tophat import TophatCalibration, Verdict, calibrate
from raccoon.estimate.tophat.sensor import Explanation, explain_levels
from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
from raccoon.trace.loading import Run, load_runs

Array = NDArray[np.float64]

MIN_WAY = 0.10
"""Shortest way, m, that counts as driving; below it the floor may have been moved under the sensor
instead."""
VERDICT = 2 + max(len(verdict) for verdict in Verdict)
"""Width of the column of verdicts, characters."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Widths, in characters, of the columns whose entries are names that users choose."""

    sensor: int
    set_name: int

    @classmethod
    def of(cls, sensors: Iterable[str], set_names: Iterable[str]) -> Layout:
        """Columns wide enough for these names and two spaces."""
        return cls(2 + max(map(len, ("sensor", *sensors))), 2 + max(map(len, ("set", *set_names))))

    @property
    def header(self) -> str:
        """The header line of the table."""
        return (
            f"{'sensor':{self.sensor}}{'set':{self.set_name}}{'time':21}{'verdict':{VERDICT}}"
            f"{'white':>7}{'black':>7}{'cut':>7}{'apart':>7}{'error':>9}  battery  sensor by its readings"
        )


def show_store(path: Path, set_name: str | None) -> int:
    """Print the stored calibrations of a set, or of all sets (None), oldest first. Returns exit status 1 if
    there is none."""
    stored = TophatStore(path).history()
    entries = [each for each in stored if set_name in (None, each.set_name)]
    if not stored:
        print(f"{path}: no tophat calibrations yet")
        return 1
    if not entries:
        sets = ", ".join(dict.fromkeys(each.set_name for each in stored))
        print(f"{path}: no set {set_name}; there is {sets}")
        return 1
    layout = Layout.of((entry.sensor for entry in entries), (entry.set_name for entry in entries))
    print(layout.header)
    for entry in entries:
        print(_row(entry, layout))
    return 0


def calibrate_recordings(
    recordings: Sequence[Path], robot_file: Path, store: Path, set_name: str, *, write: bool
) -> int:
    """Calibrate every tophat of robot.toml on the recordings, and store the usable results if `write`.
    Returns exit status 1 if one sensor gave no threshold. Raises ConfigError if robot.toml has no tophat."""
    robot = load_robot(robot_file)
    if not robot.tophats:
        raise ConfigError(f"{robot_file}: it has no [tophat.NAME]")
    with show_progress():
        runs = load_runs(*recordings)
    now = datetime.now(UTC).isoformat(timespec="seconds")
    layout = Layout.of(robot.tophats, [set_name])
    print(layout.header)
    failed, usable = 0, []
    simulated = is_any_simulated(runs)
    whose = robot.name + SIMULATED_ONE if simulated else robot.name
    voltage = _mean_voltage(runs)
    for name, sensor in robot.tophats.items():
        found = calibrate(*_counts_and_ways(runs, robot, sensor))
        entry = _entry(name, set_name, now, found, whose, voltage)
        print(_row(entry, layout))
        failed += not found.usable
        if found.usable:
            usable.append(entry)
    if write and usable:
        TophatStore(store).add(*usable)
    if not write:
        print(f"{store} is unchanged: add --write to store these")
    elif failed < len(robot.tophats):
        print(f"wrote {store}, set {set_name}")
        if simulated:
            print(SIMULATED_NOTE)
    return 1 if failed else 0


def _entry(
    name: str, set_name: str, now: str, found: TophatCalibration, robot: str, voltage: float | None
) -> StoredCalibration:
    known = list(_known(found))
    ambient = known[0].ambient if len(known) == 1 else None
    generation = known[0].generation if len(known) == 1 else None
    return StoredCalibration(name, set_name, now, found, robot, ambient, voltage, generation)


def _counts_and_ways(
    runs: Sequence[Run], robot: RobotConfig, sensor: TophatConfig
) -> tuple[Array, Array | None]:
    """A sensor's counts in all recordings, joined, and the way to each reading from the one before, m, as
    `calibrate` takes them. The ways are None if a recording does not give them or the robot drove less than
    MIN_WAY: then the floor was moved instead."""
    counts, ways = [np.zeros(0)], [np.zeros(0)]
    for run in runs:
        column = run.recording.columns.get(f"analog.{sensor.analog}")
        if column is None:
            continue
        read = np.isfinite(column)
        counts.append(column[read])
        ways.append(np.diff(_way(run, robot, sensor)[read], prepend=np.nan))
    joined = np.concatenate(ways)
    driven = float(np.nansum(joined))
    seams = sum(len(each) > 0 for each in ways)
    told = driven >= MIN_WAY and np.isnan(joined).sum() == seams
    return np.concatenate(counts), joined if told else None


def _way(run: Run, robot: RobotConfig, sensor: TophatConfig) -> Array:
    """Way of a sensor over the floor until each row, m, computed from the wheels; NaN if they do not give
    it."""
    columns, device = run.recording.columns, run.recording.device
    try:
        x, y, heading = integrate_path(
            np.ones(3), robot, manoeuvre_from_columns(columns, robot, device=device)
        ).T
    except CalibrationError:
        return np.full(len(columns["t"]), np.nan)
    x = x + sensor.forward * np.cos(heading) - sensor.left * np.sin(heading)
    y = y + sensor.forward * np.sin(heading) + sensor.left * np.cos(heading)
    return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])


def _mean_voltage(runs: Sequence[Run]) -> float | None:
    """Mean battery voltage over all recordings, V; None if none contains it."""
    columns = [run.recording.columns.get("battery.voltage") for run in runs]
    voltages = [float(np.nanmean(each)) for each in columns if each is not None and np.isfinite(each).any()]
    return sum(voltages) / len(voltages) if voltages else None


def _known(found: TophatCalibration) -> Iterator[Explanation]:
    if found.usable:
        white, black = found.surfaces()
        yield from explain_levels(white.mean, black.mean)


def _row(entry: StoredCalibration, layout: Layout) -> str:
    found = entry.calibration
    start = (
        f"{entry.sensor:{layout.sensor}}{entry.set_name:{layout.set_name}}"
        f"{entry.time[:19]:21}{found.verdict!s:{VERDICT}}"
    )
    if not found.usable:
        return f"{start}{found.reason}"
    white, black = found.surfaces()
    battery = "   -   " if entry.battery_voltage is None else f"{entry.battery_voltage:5.2f} V"
    known = " or ".join(
        f"{each.generation} at {1000 * each.height:.0f} mm" for each in explain_levels(white.mean, black.mean)
    )
    light = "" if entry.ambient is None else f", in {entry.ambient:.2f} of direct sunlight"
    return (
        f"{start}{white.mean:7.0f}{black.mean:7.0f}{found.threshold:7.0f}{found.separation:7.1f}"
        f"{100 * (found.error_rate or 0.0):8.3f}%  {battery}  {known or 'not one of the two'}{light}"
    )
