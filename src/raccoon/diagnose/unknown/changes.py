"""What changed at one moment of a drive: a gyro whose zero jumps, a wheel that has another size from then on.

To a search that is a drift, or a wheel that is not round. In what it leaves of the gyro, one step of one
number stands out: from when on the zero, or what a wheel's speed turns the robot by, was another.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.binned import bin_means
from raccoon.diagnose.drives.log import Change
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.unknown.sensors import GYRO, PREFIX, Probe, sensor_probe
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

PLACES = 64
"""Moments that are tried."""
EDGE = 0.1
"""Part of a drive at either end in which nothing is said to have changed."""
HATS = 8
"""Knots of a curve over time that a step is compared with."""
FAR = 4.0
"""Usual errors beyond which one counts for no more."""
CLEAR = 45.0
"""Log evidence that one step must have, where bins that are alike count for less. Of sound robots and of
others without a change the best has 25 at most; a zero that jumps by 0.02 rad/s 53, a wheel that grows by
4 % 81 to 300."""
BIN = 0.02
"""s of the means that are judged so. In shorter ones there is so much noise that what wanders looks white: of
five sound robots with wheel loops, which are looked at in means of 5 ms, two had more than `CLEAR`."""
KNOWN = 14.0
"""Log evidence that counts for a change while causes are sought beside it, as for the least that is taken."""
GYRO_ZERO = "gyro"
PERCENT = 0.01
"""A unit of what a wheel's radius changes by."""
AS_A_CURVE = 0.97
"""Part of what a free curve over time explains that it must explain: a zero that creeps is no step."""


def changed(time: Array, gyro: Array, wheels: Mapping[str, Array]) -> Change | None:
    """What changed in a drive, None where nothing surely did. gyro (bins,): rad/s that a search left of it.
    wheels (bins,): rad/s, of each side."""
    rows = max(round(BIN / max(float(np.median(np.diff(time))), 1e-9)), 1)
    count = len(time) // rows
    bins = np.repeat(np.arange(count), rows)

    def means(values: Array) -> Array:
        return bin_means(bins, values[: len(bins)], count)

    time, gyro = means(time), means(gyro)
    wheels = {side: means(each) for side, each in wheels.items()}
    usual = 1.48 * float(np.median(np.abs(gyro))) or 1.0
    left = np.clip(gyro, -FAR * usual, FAR * usual)
    share = (time - time[0]) / max(float(time[-1] - time[0]), 1e-9)
    one = np.ones_like(share)
    base = np.stack([one, share, *wheels.values()])
    knots = np.linspace(0.0, 1.0, HATS)
    hats = np.maximum(0.0, 1.0 - (HATS - 1) * np.abs(share - knots[:, None]))
    whole = _left(left, base)
    courses = {GYRO_ZERO: one, **wheels}

    def power(of: str, place: float) -> float:
        return _left(left, np.vstack([base, (share >= place) * courses[of]]))

    moments = np.linspace(EDGE, 1.0 - EDGE, PLACES)
    near = moments[1] - moments[0]
    _, of, about = min((power(each, place), each, place) for each in courses for place in moments)
    best, place = min((power(of, each), float(each)) for each in share[np.abs(share - about) <= near])
    course, at = courses[of], float(time[0] + place * (time[-1] - time[0]))
    rest = _rest(left, np.vstack([base, (share >= place) * course]))
    alike = max(float(rest[1:] @ rest[:-1]) / max(best, 1e-300), 0.0)  # from one bin to the next
    alone = len(left) * (1.0 - alike) / (1.0 + alike)
    evidence = 0.5 * alone * float(np.log(whole / max(best, 1e-300)))
    curve = _left(left, np.vstack([base, hats[1:] * course]))
    if evidence < CLEAR or whole - best < AS_A_CURVE * (whole - curve):
        return None
    return Change(at, of)


def name_of(change: Change) -> str:
    """What it is called among what is unknown."""
    return f"{PREFIX}time ({change.of if change.of == GYRO_ZERO else f'{change.of} wheel'})"


def change_probes(problem: Problem, settings: Settings, wheels: Array) -> list[Probe]:
    """The step of what is known to have changed, none where nothing did. wheels (bins, 2): rad/s as
    simulated."""
    change, features = problem.change, problem.features
    if change is None:
        return []
    name, time = name_of(change), features.time
    step = np.array(time >= change.at, float)[None]
    if change.of == GYRO_ZERO:
        return sensor_probe(features, GYRO_ZERO, name.removeprefix(PREFIX), GYRO * step, time, "s")
    drive, side = problem.robot.model.drive, SIDES.index(change.of)
    radius = drive.wheel_radius.value * settings[("drive.wheel_radius", change.of, "factor")]
    track = drive.track_width.value * settings[("drive.track_width", None, "factor")]
    scale = problem.robot.model.imu.gyro_scale.value * settings[("imu.gyro_scale", None, "factor")]
    sign = 1.0 if change.of == "right" else -1.0
    turns = sign * PERCENT * scale * radius / track * wheels[:, side]
    columns = np.zeros((1, *features.measured.shape))
    columns[0, :, features.roles.index("gyro")] = step[0] * turns
    return [
        Probe(
            name, columns, quantity=f"radius of the {change.of} wheel", unit="%", over=time, over_unit="s",
            curves=step,
        )
    ]  # fmt: skip


def _left(values: Array, columns: Array) -> float:
    """Power of what columns (count, bins) do not explain."""
    return float((_rest(values, columns) ** 2).sum())


def _rest(values: Array, columns: Array) -> Array:
    found = np.linalg.lstsq(columns.T, values, rcond=None)[0]
    return np.asarray(values - found @ columns, float)
