"""A recorded manoeuvre as arrays: wheel angles, and a reference at the same times.

Columns are those of the interchange format, one array each, NaN where a sensor had no new reading.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.estimate.drive_calibration.resting import MOVING_COUNTS, resting_offset
from raccoon.model.bemf import counts_scale

Array = NDArray[np.float64]
MIN_KNOWN_ROWS = 20
"""Least number of rows with a pose that make a reference."""


@dataclass(frozen=True, slots=True)
class TapedWay:
    """A straight piece measured by tape: `distance` m (negative: backwards) from `begin` to `end`, s; std:
    m."""

    begin: float
    end: float
    distance: float
    std: float = 0.002


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """One recording, ready for a fit.

    t: s, (n,). left, right: rad at nominal scale since the start, without the offset's part, (n,).
    gyro: rad turned by the gyro without its bias, at the scale of robot.toml, (n,), or None.
    truth: x, y, heading of the reference, (n, 3), NaN in rows without one, or None.
    offsets: back-EMF counts at rest of left and right, with standard deviations; None without a rest.
    battery_voltage: V. taped: pieces measured by tape.
    """

    t: Array
    left: Array
    right: Array
    gyro: Array | None
    truth: Array | None
    offsets: tuple[tuple[float, float] | None, tuple[float, float] | None]
    battery_voltage: float | None
    taped: Sequence[TapedWay] = ()

    def piece(self, begin: int, end: int) -> Manoeuvre:
        """The part from sample `begin` to before `end`, without tape."""
        cut = slice(begin, end)
        return Manoeuvre(
            self.t[cut],
            self.left[cut],
            self.right[cut],
            None if self.gyro is None else self.gyro[cut],
            None if self.truth is None else self.truth[cut],
            self.offsets,
            self.battery_voltage,
        )

    @property
    def known_rows(self) -> NDArray[np.intp]:
        """Indices of the rows in which the reference has a pose."""
        return np.flatnonzero([] if self.truth is None else np.isfinite(self.truth[:, 0]))

    @property
    def heading(self) -> Array | None:
        """Heading by the reference, where it has one, else by the gyro."""
        return self.truth[self.known_rows, 2] if self.truth is not None else self.gyro


def manoeuvre_from_columns(
    columns: Mapping[str, Array],
    robot: RobotConfig,
    *,
    taped: Sequence[TapedWay] = (),
    device: Device = SI_WORDS,
) -> Manoeuvre:
    """Make a manoeuvre from a recording's columns.

    Raises CalibrationError naming the column that is missing or unusable.
    """
    t = _column(columns, "t")
    if len(t) < 20 or not np.all(np.isfinite(t)) or np.any(np.diff(t) < 0.0):
        raise CalibrationError("column t: at least 20 rising times are needed")
    rest = _count_resting(columns, robot, t)
    sides = [_wheel_angle(columns, robot, side, t, rest, device) for side in ("left", "right")]
    return Manoeuvre(
        t=t,
        left=sides[0][0],
        right=sides[1][0],
        gyro=_gyro_turn(columns, robot, t, rest),
        truth=_truth(columns),
        offsets=(sides[0][1], sides[1][1]),
        battery_voltage=_mean(columns.get("battery.voltage")),
        taped=taped,
    )


def _column(columns: Mapping[str, Array], name: str) -> Array:
    if name not in columns:
        raise CalibrationError(f"the recording has no column {name}")
    return np.asarray(columns[name], dtype=float)


def _mean(column: Array | None) -> float | None:
    if column is None or not np.any(np.isfinite(column)):
        return None
    return float(np.nanmean(column))


def _forward_fill(values: Array) -> Array:
    """The values with NaN replaced by the last value before it (at the start by the first one)."""
    known = np.flatnonzero(np.isfinite(values))
    place = np.clip(np.searchsorted(known, np.arange(len(values)), side="right") - 1, 0, None)
    held: Array = values[known[place]]
    return held


def _count_resting(columns: Mapping[str, Array], robot: RobotConfig, t: Array) -> int:
    """Number of samples before the first wheel moves, less 0.2 s."""
    first = len(t)
    for port in (robot.drive.left, robot.drive.right):
        bemf, position = columns.get(f"motor.{port}.bemf"), columns.get(f"motor.{port}.position")
        if bemf is not None and np.any(np.isfinite(bemf)):
            held = _forward_fill(np.asarray(bemf, dtype=float))
            moved = np.abs(held - np.mean(held[:20])) > MOVING_COUNTS
        elif position is not None and np.any(np.isfinite(position)):
            held = _forward_fill(np.asarray(position, dtype=float))
            moved = np.abs(held - held[0]) > 3.0
        else:
            raise CalibrationError(f"motor {port} has neither position nor back-EMF in the recording")
        first = min(first, int(np.argmax(moved)) if np.any(moved) else len(t))
    return int(np.searchsorted(t, t[min(first, len(t) - 1)] - 0.2))


def _wheel_angle(
    columns: Mapping[str, Array], robot: RobotConfig, side: str, t: Array, rest: int, device: Device
) -> tuple[Array, tuple[float, float] | None]:
    port: int = getattr(robot.drive, side)
    motor = robot.motor(port)
    scale = counts_scale(robot, side, device) * (-1.0 if motor.inverted else 1.0)
    bemf = columns.get(f"motor.{port}.bemf")
    position = columns.get(f"motor.{port}.position")
    offset = None
    if bemf is not None:
        words = np.asarray(bemf, dtype=float)
        found = resting_offset(words[:rest][np.isfinite(words[:rest])], device.bemf_dead_zone)
        offset = None if found is None else (found.value, found.std)
    configured = motor.bemf_offset or robot.model.bemf.offset
    counts = configured.value if offset is None else offset[0]
    if position is not None and np.any(np.isfinite(position)):
        held = _forward_fill(np.asarray(position, dtype=float))
        summed = (held - held[0]) * device.position_counts_seconds
    else:
        held = _forward_fill(np.asarray(bemf, dtype=float))
        summed = integral(t, held)
    return scale * (summed - counts * (t - t[0])), offset


def _gyro_turn(columns: Mapping[str, Array], robot: RobotConfig, t: Array, rest: int) -> Array | None:
    rates = columns.get("imu.gyro.z")
    if rates is None or not np.any(np.isfinite(rates)):
        return None
    values = np.asarray(rates, dtype=float)
    resting = values[:rest][np.isfinite(values[:rest])]
    if len(resting) < 10:
        return None
    known = np.isfinite(values)
    # gyro = scale * turn rate + bias, as in the odometry
    rate = (np.interp(t, t[known], values[known]) - resting.mean()) / robot.model.imu.gyro_scale.value
    return integral(t, rate)


def integral(t: Array, rate: Array) -> Array:
    """Integral of a rate from the first of the times t (s) to each, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))])


def _truth(columns: Mapping[str, Array]) -> Array | None:
    names = ("truth.x", "truth.y", "truth.heading")
    if not all(name in columns for name in names):
        return None
    truth = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
    known = np.isfinite(truth).all(axis=1)
    if known.sum() < MIN_KNOWN_ROWS:
        return None
    truth[~known] = np.nan  # rows are blank if the reference has another rate or loses the robot
    truth[known, 2] = np.unwrap(truth[known, 2])
    return truth
