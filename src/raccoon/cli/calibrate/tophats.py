"""`raccoon calibrate tophats`: the work behind it (no command of its own)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.cli.doing import doing_shown
from raccoon.cli.measured import SIMULATED, recorded_in_simulation
from raccoon.core.config import load_robot
from raccoon.core.errors import ConfigError
from raccoon.core.sections import SIMULATED_ONE
from raccoon.estimate.tophat import TophatCalibration, Verdict, calibrate
from raccoon.estimate.tophat.sensor import Explanation, explanations
from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
from raccoon.trace.loading import Run, load_runs

VERDICT = 2 + max(len(verdict) for verdict in Verdict)
"""Width of a column of verdicts."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Widths of the columns whose entries are as long as people make them."""

    sensor: int
    set_name: int

    @classmethod
    def of(cls, sensors: Iterable[str], set_names: Iterable[str]) -> Layout:
        """Wide enough for all of these, and two spaces."""
        return cls(2 + max(map(len, ("sensor", *sensors))), 2 + max(map(len, ("set", *set_names))))

    @property
    def header(self) -> str:
        """The line above the rows."""
        return (
            f"{'sensor':{self.sensor}}{'set':{self.set_name}}{'time':21}{'verdict':{VERDICT}}"
            f"{'white':>7}{'black':>7}{'cut':>7}{'apart':>7}{'error':>9}  battery  sensor by its readings"
        )


def show_store(path: Path, set_name: str | None) -> int:
    """Print every stored calibration of a set, or of all; oldest first. Exit status 1 where there is none."""
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
    """Calibrate every sensor of robot.toml on the recordings; exit status 1 where one gave no threshold."""
    robot = load_robot(robot_file)
    if not robot.tophats:
        raise ConfigError(f"{robot_file}: it has no [tophat.NAME]")
    with doing_shown():
        runs = load_runs(*recordings)
    readings, voltage = _readings(runs, {sensor.analog for sensor in robot.tophats.values()})
    now = datetime.now(UTC).isoformat(timespec="seconds")
    layout = Layout.of(robot.tophats, [set_name])
    print(layout.header)
    failed, usable = 0, []
    simulated = recorded_in_simulation(runs)
    whose = robot.name + SIMULATED_ONE if simulated else robot.name
    for name, sensor in robot.tophats.items():
        found = calibrate(readings.get(sensor.analog, []))
        entry = _entry(name, set_name, now, found, whose, voltage)
        print(_row(entry, layout))
        failed += not found.usable
        if found.usable:
            usable.append(entry)
    if write and usable:
        TophatStore(store).add(*usable)
    if not write:
        print(f"{store} is as it was: say --write to store these")
    elif failed < len(robot.tophats):
        print(f"wrote {store}, set {set_name}")
        if simulated:
            print(SIMULATED)
    return 1 if failed else 0


def _entry(
    name: str, set_name: str, now: str, found: TophatCalibration, robot: str, voltage: float | None
) -> StoredCalibration:
    known = list(_known(found))
    ambient = known[0].ambient if len(known) == 1 else None
    generation = known[0].generation if len(known) == 1 else None
    return StoredCalibration(name, set_name, now, found, robot, ambient, voltage, generation)


def _readings(runs: Sequence[Run], ports: set[int]) -> tuple[dict[int, NDArray[np.float64]], float | None]:
    """(counts by analog port, mean battery voltage) of all recordings together."""
    found: dict[int, list[NDArray[np.float64]]] = {}
    voltages: list[float] = []
    for run in runs:
        columns = run.recording.columns
        for port in ports:
            column = columns.get(f"analog.{port}")
            if column is not None:
                found.setdefault(port, []).append(column[np.isfinite(column)])
        battery = columns.get("battery.voltage")
        if battery is not None and np.isfinite(battery).any():
            voltages.append(float(np.nanmean(battery)))
    joined = {port: np.concatenate(parts) for port, parts in found.items()}
    return joined, sum(voltages) / len(voltages) if voltages else None


def _known(found: TophatCalibration) -> Iterator[Explanation]:
    if found.usable:
        white, black = found.surfaces()
        yield from explanations(white.mean, black.mean)


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
        f"{each.generation} at {1000 * each.height:.0f} mm" for each in explanations(white.mean, black.mean)
    )
    return (
        f"{start}{white.mean:7.0f}{black.mean:7.0f}{found.threshold:7.0f}{found.separation:7.1f}"
        f"{100 * (found.error_rate or 0.0):8.3f}%  {battery}  {known or 'not one of the two'}"
    )
