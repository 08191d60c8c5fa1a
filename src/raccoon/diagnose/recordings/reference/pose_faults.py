"""Faults of a reference of the pose: frozen while the robot moves, gaps, missing columns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.bins import describe_spans
from raccoon.diagnose.recordings.reference.stretches import MIN_SAMPLES
from raccoon.diagnose.result import SensorFault
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

POSE_COLUMNS = ("truth.x", "truth.y", "truth.heading")
MIN_FAULT_S = 1.0
"""Least duration of a frozen or blank column, s: a slow reference is blank or held between two samples."""
MIN_TURN_RATE = 0.2
"""Least turn rate of a turning robot, rad/s: if a wall holds the robot, the reference rightly stands
still."""
MIN_TURN, MIN_DISTANCE = 0.5, 0.1
"""Least turn, rad, and distance, m, that the robot moved meanwhile. On an arc of that length both x and y
change."""


def check_pose(columns: Columns, robot: RobotConfig) -> tuple[dict[str, Array], tuple[SensorFault, ...]]:
    """The `truth.*` columns of the pose with NaN where they are frozen, and their faults. Empty without a
    reference."""
    pose = {name: np.asarray(columns[name], float) for name in POSE_COLUMNS if name in columns}
    if not any(np.isfinite(each).any() for each in pose.values()):
        return {}, ()
    time, motion = np.asarray(columns["t"], float), _cumulative_motion(columns, robot)
    faults = []
    for name, values in pose.items():
        known = np.isfinite(values)
        if known.sum() < MIN_SAMPLES:
            text = (
                f"{name} holds {int(known.sum())} numbers: the reference is not used, it needs {MIN_SAMPLES}"
            )
            faults.append(SensorFault(name, "missing", text))
            continue
        if spans := _find_gaps(time, known):
            when = describe_spans(spans)
            text = f"{name} has no number {when}: the reference lost the robot, check its view of it"
            faults.append(SensorFault(name, "lost", text))
        if motion is not None and (rows := _find_frozen(time, values, motion[name == POSE_COLUMNS[2]])):
            spans = [(float(time[first]), float(time[last])) for first, last in rows]
            does = "turns" if name == POSE_COLUMNS[2] else "drives"
            text = (
                f"{name} stands still {describe_spans(spans)} although the robot {does}: left out there, "
                "check whether the reference still sees the robot"
            )
            faults.append(SensorFault(name, "frozen", text))
            values = values.copy()
            for first, last in rows:
                values[first : last + 1] = np.nan
            pose[name] = values
    if missing := [name for name in POSE_COLUMNS if name not in pose]:
        text = f"{missing[0]} is not in the recording: the rest of its reference is not used without it"
        if missing != list(POSE_COLUMNS[:2]):  # a heading alone determines the gyro's scale
            faults.append(SensorFault(missing[0], "missing", text))
    return pose, tuple(faults)


def _cumulative_motion(columns: Columns, robot: RobotConfig) -> tuple[Array, Array] | None:
    """Cumulative distance on arcs and cumulative turn up to each row by the robot's own sensors, in units of
    `MIN_DISTANCE` and `MIN_TURN`; None without the sensors."""
    model, drive = robot.model, robot.drive
    wheels = [
        _wheel_speed(columns, port, robot.motor(port).inverted, motor.back_emf_constant.value)
        for port, motor in ((drive.left, model.left), (drive.right, model.right))
    ]
    gyro = columns.get("imu.gyro.z")
    radius, width = model.drive.wheel_radius.value, model.drive.track_width.value
    left, right = (None if each is None else radius * each for each in wheels)
    if gyro is not None and np.isfinite(gyro).sum() >= MIN_SAMPLES:
        rate = np.asarray(gyro, float)
    elif left is not None and right is not None:
        rate = (right - left) / width
    else:
        return None
    rate = np.abs(np.nan_to_num(rate))
    if left is None or right is None:
        forward = np.zeros_like(rate)
    else:
        forward = 0.5 * np.abs(np.nan_to_num(left + right))
    steps = np.diff(np.asarray(columns["t"], float), prepend=columns["t"][0])
    turning = np.where(rate > MIN_TURN_RATE, steps, 0.0)
    return np.cumsum(turning * forward) / MIN_DISTANCE, np.cumsum(turning * rate) / MIN_TURN


def _wheel_speed(columns: Columns, port: int, inverted: bool, k_e: float) -> Array | None:
    """Speed of a wheel, rad/s; None without a reading."""
    sign = -1.0 if inverted else 1.0
    if f"motor.{port}.bemf" in columns:
        return sign * BEMF_VOLTS_PER_COUNT / k_e * np.asarray(columns[f"motor.{port}.bemf"], float)
    if f"motor.{port}.speed" in columns:
        return sign * np.asarray(columns[f"motor.{port}.speed"], float)
    return None


def _find_frozen(time: Array, values: Array, motion: Array) -> list[tuple[int, int]]:
    """First and last row of each stretch with constant readings although the robot moves enough."""
    known = np.flatnonzero(np.isfinite(values))
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values[known]) != 0.0) + 1])
    ends = np.concatenate([starts[1:], [len(known)]]) - 1
    return [
        (int(known[first]), int(known[last]))
        for first, last in zip(starts, ends, strict=True)
        if time[known[last]] - time[known[first]] >= MIN_FAULT_S
        and motion[known[last]] - motion[known[first]] >= 1.0
    ]


def _find_gaps(time: Array, known: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and end, s, of long spans with rows but without a number in them; missing rows are no gaps."""
    edges = np.concatenate([[time[0]], time[known], [time[-1]]])
    usual = median_step(time[known])
    gaps = np.flatnonzero(np.diff(edges) > max(MIN_FAULT_S, 4.0 * usual))
    counts = np.diff(np.searchsorted(time, edges))
    return [(float(edges[each]), float(edges[each + 1])) for each in gaps if counts[each] > 1]
