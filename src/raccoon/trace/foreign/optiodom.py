"""OptiOdom sessions: wheel encoder ticks at 20 Hz with the pose from motion capture.

A session is a folder with `metadata.csv` (gear, counts per revolution of the motor, nominal track width and
wheel diameters) and runs without a header line: time, true x, y, heading, then the ticks of the right and of
the left wheel in this cycle.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from raccoon.core.config import (
    ControllerConfig,
    DriveConfig,
    DriveModel,
    Measured,
    MotorConfig,
    NominalModel,
    RobotConfig,
)
from raccoon.core.errors import ConfigError, TraceError
from raccoon.trace.foreign.table import read_table
from raccoon.trace.recording import Recording

METADATA = "metadata.csv"
LEFT, RIGHT = 0, 1
DIAMETER_SPREAD = 0.01
TRACK_SPREAD = 0.02
"""Standard deviations as shares of the diameter and the track width: for the same robot the sessions state 84
and 85 mm, 200 and 205 mm."""
_NAMES = ("t", "truth.x", "truth.y", "truth.heading", "right", "left")


def read_run(path: str | Path) -> Recording:
    """Read one run: `motor.0.position` (left) and `motor.1.position` (right) in ticks from 0, and `truth.*`.
    Raises TraceError if the file is not of this kind."""
    table = read_table(Path(path), _NAMES, header=False)
    columns = {
        "t": table["t"],
        f"motor.{LEFT}.position": np.cumsum(table["left"]),
        f"motor.{RIGHT}.position": np.cumsum(table["right"]),
        "truth.x": table["truth.x"],
        "truth.y": table["truth.y"],
        "truth.heading": np.unwrap(table["truth.heading"]),
    }
    try:
        return Recording(columns)
    except TraceError as error:
        raise TraceError(f"{path}: {error}") from None


def read_robot(path: str | Path) -> RobotConfig:
    """The robot of a session, left wheel on motor port 0, right on 1. Raises TraceError for unusable
    metadata.

    One tick is 2 pi / (gear x counts) of the wheel. A difference between the two diameters is included in the
    size of the ticks, so that one wheel radius holds for both.
    """
    entries = _metadata(Path(path))
    tick = 2.0 * math.pi / (_number(path, entries, "ngear") * _number(path, entries, "encRes"))
    # In the order of the tick columns: right, left.
    diameters = {RIGHT: _number(path, entries, "Di", 0), LEFT: _number(path, entries, "Di", 1)}
    mean = sum(diameters.values()) / 2.0
    motors = {
        # An encoder reads 0 at rest.
        port: MotorConfig(radians_per_tick=_nominal(tick * diameter / mean, 0.0), bemf_offset=Measured(0.0))
        for port, diameter in diameters.items()
    }
    radius = _nominal(mean / 2.0, DIAMETER_SPREAD)
    track = _nominal(_number(path, entries, "Li"), TRACK_SPREAD)
    try:
        return RobotConfig(
            name=Path(path).parent.name,
            controller=ControllerConfig(rate_hz=20.0),
            drive=DriveConfig(LEFT, RIGHT),
            motors=motors,
            model=NominalModel(drive=DriveModel(wheel_radius=radius, track_width=track)),
        )
    except ConfigError as error:
        raise TraceError(f"{path}: {error}") from None


def _nominal(value: float, spread: float) -> Measured:
    return Measured(value, value * spread)


def _metadata(path: Path) -> dict[str, list[str]]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        text = file.read(100_000)
    entries = {row[0]: [cell for cell in row[1:] if cell] for row in csv.reader(text.splitlines()) if row}
    if entries.get("type") != ["diff"]:
        raise TraceError(f"{path}: type is {entries.get('type')}: only two-wheel drives (diff) are read")
    return entries


def _number(path: str | Path, entries: dict[str, list[str]], key: str, index: int = 0) -> float:
    cells = entries.get(key, [])
    try:
        value = float(cells[index])
    except (IndexError, ValueError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise TraceError(f"{path}: {key} is {cells}: allowed are numbers above 0")
    return value
