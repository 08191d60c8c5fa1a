"""Torques that go round with a wheel, and how the readings follow them.

A motor that cogs, or a wheel that rubs at one place, pushes as sin(n angle). At 5 rad/s and five times in a
turn that is 25 rad/s, and neither the wheels (J R / K^2 is 20 to 30 ms) nor a filter of 22 ms follow it all
the way: readings lag by a quarter of the wave, and by as much the other way going back. By the response to a
torque that lasts, a motor that cogs came out at a third of its size, its drives there and back at odds.

A torque T more at one wheel changes the mean m of both wheels' speeds and half their difference h by

    J m' = T / 2 - D m,   J: what a motor feels going straight, or turning,   D = K^2 / R while it is driven,

with D = 0 where it coasts, also where that is only to be measured, and nothing moves where the wheel sticks.
Readings follow by their filters. Of what a motor that cogs by 0.02 N m changes that is 95 %.

A wheel's angle is counted from readings that are late by the filter, and by a K_E that may be 0.7 % off: 0.3
rad after ten turns, of a wave that comes five times in one a quarter. So waves may change evenly on the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

COGGING, RUBBING = 6, 3
"""Waves in a turn up to which a motor may cog, and a wheel rub."""
CHANGE = 0.5
"""Of a wave's usual size, by how much it usually changes from the middle of the way to its end."""
SAMPLED = 0.0075
"""s by which a median of three samples of 5 ms, and waiting for the next row, delay a back-EMF."""
STICKS = 0.3
"""rad/s below which a wheel is about to stand, and friction decides how fast it is."""
AT_ONCE = 1e-3
"""s in which what a stuck wheel had is gone."""
COASTING = 10.0
"""s in which a motor that coasts would lose its speed but for friction, which is what it is."""


@dataclass(frozen=True, slots=True)
class Waves:
    """curves (count, bins): torques at a wheel, of a unit each. columns (count, bins, channels): responses.
    parts: those that may be all there is, of one order, as it is or as it changes on the way."""

    curves: Array
    columns: Array
    parts: tuple[tuple[int, ...], ...]


def waves(angle: Array, orders: int) -> Array:
    """Sines and then cosines of the multiples of an angle, (2 orders, bins)."""
    multiples = np.arange(1, orders + 1)[:, None] * angle[None]
    return np.concatenate([np.sin(multiples), np.cos(multiples)])


def angle_of(problem: Problem, settings: Settings, counted: Array, wheel: int) -> Array:
    """A wheel's angle, (bins,), from that which is counted from its readings, and is late as they are."""
    if f"bemf_{SIDES[wheel]}" not in problem.features.roles:
        return counted
    late = settings["bemf.filter_lag", SIDES[wheel], "time_constant"] + SAMPLED
    return np.asarray(np.interp(problem.features.time + late, problem.features.time, counted))


def counts_of(problem: Problem, settings: Settings, side: str) -> float:
    """Counts of back-EMF that a rad/s of a wheel reads."""
    volts = getattr(problem.robot.model, side).back_emf_constant.value
    volts *= settings["motor.back_emf_constant", side, "factor"] * settings["bemf.scale", side, "factor"]
    return float(volts / BEMF_VOLTS_PER_COUNT)


def wheel_waves(
    problem: Problem, settings: Settings, angle: Array, speeds: Array, wheel: int, friction: bool
) -> Waves:
    """Waves over the angle, (bins,), of a wheel: torques forward, or friction against it, as of one that
    rubs or a tooth that is bent. speeds (bins, 2): of both wheels, rad/s."""
    orders = RUBBING if friction else COGGING
    kinds = waves(angle, orders)
    torques = -np.sign(speeds[:, wheel]) * kinds if friction else kinds
    answers = _read(problem, settings, _pushed(problem, settings, torques, speeds, wheel))
    along = CHANGE * (2.0 * (angle - angle.min()) / max(float(np.ptp(angle)), 1e-9) - 1.0)
    curves = np.concatenate([kinds, along * kinds])
    columns = np.concatenate([answers, along[:, None] * answers])
    kept = [(order, order + orders) for order in range(orders)]
    changed = [tuple(range(order, len(curves), orders)) for order in range(orders)]
    return Waves(curves, columns, (*kept, *changed))


def _pushed(problem: Problem, settings: Settings, torques: Array, speeds: Array, wheel: int) -> Array:
    """rad/s by which both wheels are faster, (count, bins, 2), for torques at one of them, (count, bins)."""
    drive, driven, width = problem.robot.model.drive, problem.features.driven, problem.features.width
    damping = np.mean(driven * [_damping(problem, settings, side) for side in SIDES], axis=1)
    sticks = np.abs(speeds) < STICKS
    courses = []
    for inertia, way in ((drive.inertia_straight, "straight"), (drive.inertia_turn, "turn")):
        felt = inertia.value * settings["inertia", None, way] * settings["drive.inertia", None, "factor"]
        lasts = felt / np.maximum(damping, felt / COASTING)
        lasts = np.where(sticks[:, wheel], AT_ONCE, lasts)
        courses.append(_followed(0.5 * torques, lasts, width, lasts / felt))
    mean, half = courses
    faster = np.stack([mean + half, mean - half] if wheel == 0 else [mean - half, mean + half], axis=2)
    return np.where(sticks, 0.0, faster)


def _damping(problem: Problem, settings: Settings, side: str) -> float:
    """N m s/rad of a driven motor, K^2 / R, less what it is not driven meanwhile."""
    motor = getattr(problem.robot.model, side)
    resistance = motor.armature_resistance.value * settings["motor.armature_resistance", side, "factor"]
    constant = motor.back_emf_constant.value * settings["motor.back_emf_constant", side, "factor"]
    return float((1.0 - problem.coasts) * constant**2 / resistance)


def _read(problem: Problem, settings: Settings, faster: Array) -> Array:
    """What wheels that are faster by so much, (count, bins, 2), make of readings (count, bins, channels)."""
    model, features = problem.robot.model, problem.features
    found = np.zeros((*faster.shape[:2], len(features.roles)))
    for place, role in enumerate(features.roles):
        side = role.rpartition("_")[2]
        if role.startswith("speed_"):
            found[:, :, place] = faster[:, :, SIDES.index(side)]
        elif role.startswith("bemf_"):
            counts = counts_of(problem, settings, side)
            lag = np.full(faster.shape[1], max(settings["bemf.filter_lag", side, "time_constant"], AT_ONCE))
            read = _followed(counts * faster[:, :, SIDES.index(side)], lag, features.width)
            found[:, :, place] = _late(read, SAMPLED / features.width)
        elif role == "gyro":
            radii = [
                model.drive.wheel_radius.value * settings["drive.wheel_radius", side, "factor"]
                for side in SIDES
            ]
            rims = faster * radii
            track = model.drive.track_width.value * settings["drive.track_width", None, "factor"]
            scale = model.imu.gyro_scale.value * settings["imu.gyro_scale", None, "factor"]
            found[:, :, place] = scale * (rims[:, :, 1] - rims[:, :, 0]) / track
    return found


def _followed(pushes: Array, lasts: Array, width: float, gain: Array | float = 1.0) -> Array:
    """y with lasts y' = gain pushes - y, (count, bins), of pushes that are lines from bin to bin. lasts, gain
    (bins,): in each bin, lasts in s.

    y[k] = e y[k - 1] + gain ((1 - g) pushes[k] + (g - e) pushes[k - 1]),   e = exp(-width / lasts),
    g = (1 - e) lasts / width
    """
    from scipy.linalg import solve_banded

    gone = np.exp(-width / lasts)
    mean = (1.0 - gone) * lasts / width
    pushed = (1.0 - mean) * pushes
    pushed[:, 1:] += (mean - gone)[1:] * pushes[:, :-1]
    bands = np.ones((2, len(lasts)))
    bands[1, :-1] = -gone[1:]
    return np.asarray(solve_banded((1, 0), bands, (gain * pushed).T, check_finite=False).T)


def _late(values: Array, bins: float) -> Array:
    """Values (count, bins) so many bins later, not whole ones."""
    whole = int(bins)
    share = bins - whole
    padded = np.pad(values, ((0, 0), (whole + 1, 0)))[:, : values.shape[1] + 1]
    return np.asarray((1.0 - share) * padded[:, 1:] + share * padded[:, :-1])
