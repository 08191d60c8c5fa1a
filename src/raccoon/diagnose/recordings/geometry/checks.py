"""Checks of wheels and reference: no jumps, no wheel that stands still or counts backwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Device
from raccoon.diagnose.recordings.reference.stretches import stretch_starts
from raccoon.diagnose.result import SensorFault
from raccoon.estimate.drive_calibration.columns import Manoeuvre
from raccoon.model.bemf import counts_scale

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MIN_JUMP_RATIO, USUAL_QUANTILE = 20.0, 0.98
"""Least rate of a jump, relative to the usual largest rate, which is this quantile of the rates."""
MIN_JUMP_SPEED = 5.0
"""Least speed of a jump, m/s: no small robot is as fast."""
MIN_BEMF_RATIO, MIN_BEMF_SPEED = 5.0, 1.0
"""The same for back-EMF: ratio to the usual largest reading, and least speed, m/s."""
MAX_DISTANCE_M = 1e6
"""Upper bound of the distance by a robot's counter or reference, m."""
MAX_SPIKE_ROWS = 3
"""Largest number of rows of a spike; more are a shift of the zero, as of a counter that was reset."""
MIN_ROWS = 50
"""Least number of values in a column that is searched for spikes."""
WINDOW_S = 0.5
"""Time over which turns of the wheels and the reference are compared, s."""
MIN_TURN_RAD = 0.5
"""Least total turn for the comparison, rad."""
BACKWARDS_FACTOR = -0.4
"""Fitted factor on a wheel's distance below which the wheel counts backwards."""
MAX_CONDITION = 10.0
"""Condition number of both wheels' distances above which they are not separable, as in turns on the spot."""


def without_spikes(
    columns: Columns, robot: RobotConfig, device: Device
) -> tuple[Columns, tuple[SensorFault, ...]]:
    """The columns without single values that jump there and back, and their faults.

    Raises CalibrationError for a counter or reference that continues elsewhere after a jump, or that reaches
    `MAX_DISTANCE_M`.
    """
    cleaned = dict(columns)
    faults: list[SensorFault] = []
    metres = {"truth.x": 1.0, "truth.y": 1.0}
    for side, port in (("left", robot.drive.left), ("right", robot.drive.right)):
        tick = counts_scale(robot, side, device) * device.position_counts_seconds
        metres[f"motor.{port}.position"] = tick * robot.model.drive.wheel_radius.value
        name = f"motor.{port}.bemf"
        if name in columns:
            speed = counts_scale(robot, side, device) * robot.model.drive.wheel_radius.value
            cleaned[name], spikes = _without_fast_bemf(columns[name], speed)
            faults += _spike_faults(name, spikes)
    for name in (each for each in metres if each in columns):
        values, spikes = _without_jumps(np.asarray(columns["t"], float), columns[name], name, metres[name])
        faults += _spike_faults(name, spikes)
        if float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) * metres[name] > MAX_DISTANCE_M:
            raise CalibrationError(f"{name} reaches {np.nanmax(np.abs(values)):.3g}, which no robot reaches")
        cleaned[name] = values
    return cleaned, tuple(faults)


def _spike_faults(name: str, spikes: Sequence[float]) -> list[SensorFault]:
    """The fault of values that were left out, if any."""
    if not len(spikes):
        return []
    text = f"{name} has {len(spikes)} impossible values such as {spikes[0]:.3g}: left out"
    return [SensorFault(name, "impossible", text)]


def _without_fast_bemf(counts: Array, metres_per_second: float) -> tuple[Array, list[float]]:
    """Back-EMF without readings far above the wheel's usual maximum, and these readings. metres_per_second:
    speed of one count, m/s."""
    size = np.abs(np.nan_to_num(counts))
    is_spike = (size > MIN_BEMF_RATIO * np.quantile(size, USUAL_QUANTILE)) & (
        size * metres_per_second > MIN_BEMF_SPEED
    )
    if is_spike.mean() > 1.0 - USUAL_QUANTILE:
        return counts, []
    return np.where(is_spike, np.nan, counts), counts[is_spike].tolist()


def _without_jumps(time: Array, values: Array, name: str, metres: float) -> tuple[Array, list[float]]:
    """Values without spikes, and the spikes. metres: worth of the column's unit, m."""
    rows = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    spikes: list[float] = []
    while len(rows) >= MIN_ROWS:
        with np.errstate(over="ignore"):
            steps = np.diff(values[rows])
            rates = np.abs(steps) / np.maximum(np.diff(time[rows]), 1e-6)
        usual = float(np.quantile(rates, USUAL_QUANTILE))
        jumps = np.flatnonzero((rates > MIN_JUMP_RATIO * usual) & (rates * metres > MIN_JUMP_SPEED))
        if usual == 0.0 or not len(jumps):
            break
        spike_rows = _find_spike_rows(jumps, len(rows))
        if spike_rows is None:
            raise CalibrationError(_jump_text(name, float(steps[jumps[0]]), float(time[rows[jumps[0] + 1]])))
        spikes += values[rows[spike_rows]].tolist()
        rows = np.delete(rows, spike_rows)
    kept = np.full(len(values), np.nan)
    kept[rows] = values[rows]
    return kept, spikes


def _find_spike_rows(jumps: NDArray[np.intp], count: int) -> slice | None:
    """The rows of a spike at the first jump, out of `count` rows; None if all rows after it are displaced."""
    first = int(jumps[0])
    if len(jumps) > 1 and jumps[1] - first <= MAX_SPIKE_ROWS:
        return slice(first + 1, int(jumps[1]) + 1)
    if first < MAX_SPIKE_ROWS:
        return slice(0, first + 1)
    return slice(first + 1, count) if count - 1 - first <= MAX_SPIKE_ROWS else None


def _jump_text(name: str, step: float, when: float) -> str:
    if name.startswith("truth"):
        return (
            f"{name} jumps by {step:.3g} m at {when:.4g} s: the reference was moved or tracked something "
            "else; use the part before or after it"
        )
    return (
        f"{name} jumps by {step:.3g} at {when:.4g} s: it was reset or wraps, as a counter of 16 bits does; "
        "record one that counts on, or use the part before or after it"
    )


def check_wheels(run: Manoeuvre, robot: RobotConfig) -> None:
    """Raise CalibrationError if a wheel never turns although the robot does, or counts backwards."""
    if run.truth is None or not len(run.known_rows):
        return
    known = run.known_rows
    time = run.t[known]
    ends = known[np.unique(stretch_starts(time, time[0], time[-1], WINDOW_S))]
    turns = np.diff(run.truth[ends, 2])
    ways = np.column_stack([-np.diff(run.left[ends]), np.diff(run.right[ends])])
    if float(np.abs(turns).sum()) < MIN_TURN_RAD:
        return
    names = [f"motor.{port}" for port in (robot.drive.left, robot.drive.right)]
    still = [name for name, way in zip(names, ways.T, strict=True) if not way.any()]
    if len(still) == 1:
        raise CalibrationError(
            f"{still[0]} never turns although the robot does: check its encoder and its plug"
        )
    if still or np.linalg.cond(ways) > MAX_CONDITION:
        return
    scale = robot.model.drive.wheel_radius.value / robot.model.drive.track_width.value
    factors, *_ = np.linalg.lstsq(scale * ways, turns, rcond=None)
    for name, factor, other in zip(names, factors, factors[::-1], strict=True):
        if factor < BACKWARDS_FACTOR and other > -BACKWARDS_FACTOR:
            raise CalibrationError(
                f"{name} turns against what the reference says: set inverted for it in robot.toml, or write "
                "its counter with the other sign"
            )
