"""A step change at one moment of a drive: a gyro whose zero jumps, or a wheel that has another size from then
on.

A search would report these as a drift, or as an eccentric wheel. The gyro's residual shows one step of one
number: the zero, or the turn rate per speed of a wheel, differs from that moment on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.bins import bin_means
from raccoon.diagnose.drives.log import StepChange
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX, USUAL_GYRO_ERROR, Probe, sensor_probe
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

CANDIDATE_MOMENTS = 64
"""Number of moments that are tried."""
EDGE_SHARE = 0.1
"""Share of a drive at either end in which no change is reported."""
CURVE_KNOTS = 8
"""Number of knots of the free curve over time with which a step is compared."""
CLIP_STDS = 4.0
"""Standard deviations at which residuals are clipped."""
MIN_LOG_EVIDENCE = 45.0
"""Log evidence that a step must have, with correlated bins weighted down. Of fault-free robots and of others
without a change the best has 25 at most; a zero that jumps by 0.02 rad/s has 53, a wheel that grows by 4 % 81
to 300."""
BIN_S = 0.02
"""Width in s of the means that are tested. In shorter ones there is so much noise that slow variations look
white: of five fault-free robots with wheel loops, with means of 5 ms, two had more than
`MIN_LOG_EVIDENCE`."""
KNOWN_CHANGE_LOG_EVIDENCE = 14.0
"""Log evidence that counts for a known change while causes are searched for beside it: the smallest that is
accepted."""
GYRO_ZERO = "gyro"
RADIUS_UNIT = 0.01
"""Relative change of a wheel's radius per unit of its curve: 1 %."""
MIN_SHARE_OF_CURVE = 0.97
"""Share of the power explained by a free curve over time that the step must explain: a zero that creeps is no
step."""


def find_step_change(time: Array, gyro: Array, wheels: Mapping[str, Array]) -> StepChange | None:
    """Find the step change of a drive; None if no change is certain. gyro (bins,): its residual, rad/s.
    wheels (bins,): rad/s, of each side."""
    rows = max(round(BIN_S / max(float(np.median(np.diff(time))), 1e-9)), 1)
    count = len(time) // rows
    bins = np.repeat(np.arange(count), rows)

    def means(values: Array) -> Array:
        return bin_means(bins, values[: len(bins)], count)

    time, gyro = means(time), means(gyro)
    wheels = {side: means(each) for side, each in wheels.items()}
    std = 1.48 * float(np.median(np.abs(gyro))) or 1.0
    clipped = np.clip(gyro, -CLIP_STDS * std, CLIP_STDS * std)
    share = (time - time[0]) / max(float(time[-1] - time[0]), 1e-9)
    one = np.ones_like(share)
    base = np.stack([one, share, *wheels.values()])
    knots = np.linspace(0.0, 1.0, CURVE_KNOTS)
    hats = np.maximum(0.0, 1.0 - (CURVE_KNOTS - 1) * np.abs(share - knots[:, None]))
    without_step = _residual_power(clipped, base)
    if without_step == 0.0:
        return None
    courses = {GYRO_ZERO: one, **wheels}

    def power_with_step(of: str, place: float) -> float:
        return _residual_power(clipped, np.vstack([base, (share >= place) * courses[of]]))

    moments = np.linspace(EDGE_SHARE, 1.0 - EDGE_SHARE, CANDIDATE_MOMENTS)
    near = moments[1] - moments[0]
    _, of, about = min((power_with_step(each, place), each, place) for each in courses for place in moments)
    best, place = min(
        (power_with_step(of, each), float(each)) for each in share[np.abs(share - about) <= near]
    )
    course, at = courses[of], float(time[0] + place * (time[-1] - time[0]))
    residual = _residual(clipped, np.vstack([base, (share >= place) * course]))
    correlation = max(float(residual[1:] @ residual[:-1]) / max(best, 1e-300), 0.0)  # between adjacent bins
    independent_bins = len(clipped) * (1.0 - correlation) / (1.0 + correlation)
    evidence = 0.5 * independent_bins * float(np.log(without_step / max(best, 1e-300)))
    curve = _residual_power(clipped, np.vstack([base, hats[1:] * course]))
    if evidence < MIN_LOG_EVIDENCE or without_step - best < MIN_SHARE_OF_CURVE * (without_step - curve):
        return None
    return StepChange(at, of)


def change_name(change: StepChange) -> str:
    """The name of the change among the unknown causes."""
    return f"{UNKNOWN_PREFIX}time ({change.of if change.of == GYRO_ZERO else f'{change.of} wheel'})"


def change_probes(problem: Problem, settings: Settings, wheels: Array) -> list[Probe]:
    """The probe of the known step change; empty if there is none. wheels (bins, 2): simulated, rad/s."""
    change, features = problem.change, problem.features
    if change is None:
        return []
    name, time = change_name(change), features.time
    step = np.array(time >= change.at, float)[None]
    if change.of == GYRO_ZERO:
        return sensor_probe(
            features, GYRO_ZERO, name.removeprefix(UNKNOWN_PREFIX), USUAL_GYRO_ERROR * step, time, "s"
        )
    drive, side = problem.robot.model.drive, SIDES.index(change.of)
    radius = drive.wheel_radius.value * settings[("drive.wheel_radius", change.of, "factor")]
    track = drive.track_width.value * settings[("drive.track_width", None, "factor")]
    scale = problem.robot.model.imu.gyro_scale.value * settings[("imu.gyro_scale", None, "factor")]
    sign = 1.0 if change.of == "right" else -1.0
    turns = sign * RADIUS_UNIT * scale * radius / track * wheels[:, side]
    columns = np.zeros((1, *features.measured.shape))
    columns[0, :, features.roles.index("gyro")] = step[0] * turns
    return [
        Probe(
            name, columns, quantity=f"radius of the {change.of} wheel", unit="%", over=time, over_unit="s",
            curves=step,
        )
    ]  # fmt: skip


def _residual_power(values: Array, columns: Array) -> float:
    """Sum of squares of the values that columns (count, bins) do not explain."""
    return float((_residual(values, columns) ** 2).sum())


def _residual(values: Array, columns: Array) -> Array:
    solution = np.linalg.lstsq(columns.T, values, rcond=None)[0]
    return np.asarray(values - solution @ columns, float)
