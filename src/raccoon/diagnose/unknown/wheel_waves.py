"""Torques that are waves over a wheel's angle, and the response of the readings to them.

A motor that cogs, or a wheel that rubs at one place, has a torque like sin(n angle). Five times in a turn at
5 rad/s that is 25 rad/s, which neither the wheels (J R / K^2 is 20 to 30 ms) nor a filter of 22 ms follow
completely: readings lag by a quarter of the wave, and on the way back in the opposite sense. With the
response to a constant torque, a motor that cogs came out at a third of its size, since its drives there and
back contradicted each other.

An additional torque T at one wheel changes the mean m of both wheels' speeds and half their difference h by

    J m' = T / 2 - D m,   J: inertia per motor, straight ahead or turning,   D = K^2 / R while it is driven,

with D = 0 while it coasts, also if only to be measured, and no change while the wheel sticks. Filters of the
readings follow. This predicts 95 % of the change by a motor that cogs by 0.02 N m.

A wheel's angle is integrated from readings that are delayed by the filter and scaled by a K_E that may be 0.7
% off: in 45 rad that is 0.3 rad, a quarter of a wave that comes five times in a turn. So waves may change
linearly along the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.bins import solve_recursion
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

COGGING_ORDERS, RUBBING_ORDERS = 6, 3
"""Largest number of waves in a turn of a motor that cogs, and of a wheel that rubs."""
USUAL_CHANGE_SHARE = 0.5
"""Prior change of a wave from the middle of the way to its end, relative to its own prior size."""
SAMPLING_DELAY_S = 0.0075
"""Delay in s of a back-EMF by a median of three samples of 5 ms and by the wait for the next row."""
STICKING_SPEED = 0.3
"""Speed in rad/s below which a wheel is about to stop, and friction determines its speed."""
STUCK_TIME_CONSTANT_S = 1e-3
"""Time constant in s with which the speed of a stuck wheel decays."""
COASTING_TIME_CONSTANT_S = 10.0
"""Time constant in s with which the speed of a coasting motor would decay without friction."""


@dataclass(frozen=True, slots=True)
class Waves:
    """curves (count, bins): unit torques at a wheel. columns (count, bins, channels): the readings'
    responses. parts: indices of curves that may act alone: sine and cosine of one order, constant or
    changing."""

    curves: Array
    columns: Array
    parts: tuple[tuple[int, ...], ...]


def sines_and_cosines(angle: Array, orders: int) -> Array:
    """Sines and then cosines of the multiples of an angle, (2 orders, bins)."""
    multiples = np.arange(1, orders + 1)[:, None] * angle[None]
    return np.concatenate([np.sin(multiples), np.cos(multiples)])


def wheel_angle(problem: Problem, settings: Settings, counted: Array, wheel: int) -> Array:
    """A wheel's angle (bins,) corrected for the delay of its readings, from which `counted` was
    integrated."""
    if f"bemf_{SIDES[wheel]}" not in problem.features.roles:
        return counted
    delay = settings["bemf.filter_lag", SIDES[wheel], "time_constant"] + SAMPLING_DELAY_S
    return np.asarray(np.interp(problem.features.time + delay, problem.features.time, counted))


def bemf_counts_per_speed(problem: Problem, settings: Settings, side: str) -> float:
    """Counts of back-EMF per rad/s of a wheel."""
    volts = getattr(problem.robot.model, side).back_emf_constant.value
    volts *= settings["motor.back_emf_constant", side, "factor"] * settings["bemf.scale", side, "factor"]
    return float(volts / BEMF_VOLTS_PER_COUNT)


def torque_waves(
    problem: Problem, settings: Settings, angle: Array, speeds: Array, wheel: int, friction: bool
) -> Waves:
    """Waves over the angle, (bins,), of a wheel: forward torques, or friction, as of a wheel that rubs or a
    bent tooth. speeds (bins, 2): of both wheels, rad/s."""
    orders = RUBBING_ORDERS if friction else COGGING_ORDERS
    waves = sines_and_cosines(angle, orders)
    torques = -np.sign(speeds[:, wheel]) * waves if friction else waves
    faster = _speed_responses(problem, settings, torques, speeds, wheel)
    responses = _reading_responses(problem, settings, faster)
    along = USUAL_CHANGE_SHARE * (2.0 * (angle - angle.min()) / max(float(np.ptp(angle)), 1e-9) - 1.0)
    curves = np.concatenate([waves, along * waves])
    columns = np.concatenate([responses, along[:, None] * responses])
    constant = [(order, order + orders) for order in range(orders)]
    changing = [tuple(range(order, len(curves), orders)) for order in range(orders)]
    return Waves(curves, columns, (*constant, *changing))


def _speed_responses(
    problem: Problem, settings: Settings, torques: Array, speeds: Array, wheel: int
) -> Array:
    """Changes of both wheels' speeds in rad/s, (count, bins, 2), by torques at one of them, (count, bins)."""
    drive, driven, width = problem.robot.model.drive, problem.features.driven, problem.features.width
    damping = np.mean(driven * [_damping(problem, settings, side) for side in SIDES], axis=1)
    sticks = np.abs(speeds) < STICKING_SPEED
    sum_and_difference = []
    for inertia, way in ((drive.inertia_straight, "straight"), (drive.inertia_turn, "turn")):
        total_inertia = (
            inertia.value * settings["inertia", None, way] * settings["drive.inertia", None, "factor"]
        )
        time_constant = total_inertia / np.maximum(damping, total_inertia / COASTING_TIME_CONSTANT_S)
        time_constant = np.where(sticks[:, wheel], STUCK_TIME_CONSTANT_S, time_constant)
        gain = time_constant / total_inertia
        sum_and_difference.append(_low_pass(0.5 * torques, time_constant, width, gain))
    mean, half = sum_and_difference
    faster = np.stack([mean + half, mean - half] if wheel == 0 else [mean - half, mean + half], axis=2)
    return np.where(sticks, 0.0, faster)


def _damping(problem: Problem, settings: Settings, side: str) -> float:
    """Damping in N m s/rad of a driven motor, K^2 / R, less the share of a cycle in which it coasts to be
    measured."""
    motor = getattr(problem.robot.model, side)
    resistance = motor.armature_resistance.value * settings["motor.armature_resistance", side, "factor"]
    constant = motor.back_emf_constant.value * settings["motor.back_emf_constant", side, "factor"]
    return float((1.0 - problem.coast_share) * constant**2 / resistance)


def _reading_responses(problem: Problem, settings: Settings, faster: Array) -> Array:
    """Changes of the readings (count, bins, channels) by changes of the wheels' speeds, (count, bins, 2),
    rad/s."""
    model, features = problem.robot.model, problem.features
    changes = np.zeros((*faster.shape[:2], len(features.roles)))
    for place, role in enumerate(features.roles):
        side = role.rpartition("_")[2]
        if role.startswith("speed_"):
            changes[:, :, place] = faster[:, :, SIDES.index(side)]
        elif role.startswith("bemf_"):
            counts = bemf_counts_per_speed(problem, settings, side)
            lag = np.full(
                faster.shape[1],
                max(settings["bemf.filter_lag", side, "time_constant"], STUCK_TIME_CONSTANT_S),
            )
            read = _low_pass(counts * faster[:, :, SIDES.index(side)], lag, features.width)
            changes[:, :, place] = _delayed(read, SAMPLING_DELAY_S / features.width)
        elif role == "gyro":
            radii = [
                model.drive.wheel_radius.value * settings["drive.wheel_radius", side, "factor"]
                for side in SIDES
            ]
            rims = faster * radii
            track = model.drive.track_width.value * settings["drive.track_width", None, "factor"]
            scale = model.imu.gyro_scale.value * settings["imu.gyro_scale", None, "factor"]
            changes[:, :, place] = scale * (rims[:, :, 1] - rims[:, :, 0]) / track
    return changes


def _low_pass(inputs: Array, time_constant: Array, width: float, gain: Array | float = 1.0) -> Array:
    """First-order low-pass: y (count, bins) with T y' = gain inputs - y, for inputs that are linear between
    bins. time_constant T, s, and gain (bins,): of each bin.

        y[k] = e y[k - 1] + gain ((1 - g) inputs[k] + (g - e) inputs[k - 1]),   e = exp(-width / T),
        g = (1 - e) T / width
    """
    decay = np.exp(-width / time_constant)
    mean = (1.0 - decay) * time_constant / width
    driven = (1.0 - mean) * inputs
    driven[:, 1:] += (mean - decay)[1:] * inputs[:, :-1]
    return solve_recursion(decay, gain * driven)


def _delayed(values: Array, bins: float) -> Array:
    """Values (count, bins) delayed by so many bins, by linear interpolation."""
    whole = int(bins)
    share = bins - whole
    padded = np.pad(values, ((0, 0), (whole + 1, 0)))[:, : values.shape[1] + 1]
    return np.asarray((1.0 - share) * padded[:, 1:] + share * padded[:, :-1])
