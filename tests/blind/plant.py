"""A two-wheel robot written apart from the package: its own equations, step and sensor chain.

It shares no line with `raccoon.sim`. Different on purpose: friction is the deflection of bristles, stepped
implicitly (no clamp, no torque of bristles), backlash is a stiff damped contact (no play operator), the
current limit saturates smoothly, heating has two thermal masses, the step is 0.25 ms and the firmware's cycle
jitters.

Torques in N m at the wheel shaft, left before right; SI throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

STEP = 0.00025
COUNTS_PER_VOLT = 4096 / 3.3 * 2.2 / 9.0
BRISTLE = 600.0
BRISTLE_DAMPING = 0.4
LINE_AHEAD, LINE_EDGE, LINE_SHARE = 0.11, 0.0003, 0.8
"""m from the axle to a line's sensor, m of its hysteresis, and what it takes of each new reading."""
FULL_SPEED = 1900.0
"""Counts that a program's speed loop expects of duty 1."""
CONTACT_RATE = 900.0
COASTING_RATE = 150.0

NEUTRAL = {
    "voc": 6.8, "rint": 0.05, "discharge": 0.0,
    "resistance_l": 1.8, "resistance_r": 1.8, "ke_l": 1.08, "ke_r": 1.08,
    "heat_gain": 0.0, "heat_tau": 15.0, "current_limit": 1e9,
    "coulomb": 0.18, "viscous": 0.004, "stiction": 0.0, "stiction_speed": 0.5, "load_friction": 0.0,
    "dir_coulomb": 0.0, "dir_viscous": 0.0, "quadratic": 0.0,
    "backlash": 0.0, "slip": 0.0, "scrub": 0.0,
    "radius_l": 0.0345, "radius_r": 0.0345, "track": 0.16, "inertia_straight": 0.020, "inertia_turn": 0.014,
    "slope_x": 0.0, "slope_y": 0.0,
    "ecc_l": 0.0, "ecc_phase_l": 0.0, "ecc_r": 0.0, "ecc_phase_r": 0.0,
    "deadband": 0.0, "latency": 0.0,
    "bemf_offset_l": 0.0, "bemf_offset_r": 0.0, "bemf_scale_l": 1.0, "bemf_scale_r": 1.0,
    "dead_zone": 0.0, "filter_tau": 0.0225,
    "gyro_bias": 0.0, "gyro_scale": 1.0, "gyro_drift": 0.0, "imu_latency": 0.0,
    "cogging_l": 0.0, "cogging_r": 0.0, "rub_l": 0.0, "rub_r": 0.0, "payload": 0.0, "payload_time": 1e9,
    "patch": 0.0, "patch_length": 0.5, "gyro_speed": 0.0, "gyro_side": 0.0,
    "bristle": BRISTLE, "bristle_damping": BRISTLE_DAMPING, "smooth": 0.0, "gyro_smooth": 0.0,
    "own_cycle": 0.0, "speed_loop": 0.0, "line_steer": 0.0,
}  # fmt: skip
"""Every parameter and the value at which the robot is the textbook's. The last lines hold causes that are in
no catalogue (torque that depends on the wheel's angle, a wheel that rubs in a third of each turn, a load that
falls on the robot, a rough patch of floor, a gyro that hears the motors, or whose scale is larger to one
side), and what is no fault: how friction gives, or the rad/s over which it is a smooth curve instead, the s
by which two filters in the gyro's chip delay, the s of a firmware's cycle that is not in step with the rows,
the duty with which a program answers each count of a wheel's speed, and the share of its duty by which it
steers at a line (bang-bang, of the x
axis, by a sensor in front)."""


def parameters(values: Mapping[str, float]) -> tuple[float, ...]:
    """The kernel's tuple; what is not named is neutral. Raises KeyError for a name that does not exist."""
    unknown = sorted(set(values) - set(NEUTRAL))
    if unknown:
        raise KeyError(f"no such parameters: {unknown}")
    return tuple(float(values.get(name, neutral)) for name, neutral in NEUTRAL.items())


def compiled(function: Function) -> Function:
    """The function compiled by numba."""
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))


@compiled
def _median(a: float, b: float, c: float) -> float:
    return max(min(a, b), min(max(a, b), c))


@compiled
def _friction(
    w: float, z: float, level: float, slope: float, quadratic: float, stiff: float, damping: float
) -> tuple[float, float]:
    """Torque against the motion and the bristle's new deflection.

    Canudas de Wit et al. (1995): z' = w - s0 |w| z / level; torque = s0 z + s1 z' + viscous part. The
    deflection
    is stepped implicitly, which is stable for any level.
    """
    new = (z + STEP * w) / (1.0 + STEP * stiff * abs(w) / level)
    torque = stiff * new + damping * (new - z) / STEP + slope * w + quadratic * w * abs(w)
    return torque, new


@compiled
def _current(duty: float, bus: float, w: float, resistance: float, ke: float, limit: float) -> float:
    if abs(duty) < 1e-9:
        return 0.0
    current = (duty * bus - ke * w) / resistance
    beyond = 1.0 + abs(current / limit) ** 12
    saturated: float = current / beyond ** (1.0 / 12.0) if beyond > 1.0 else current
    return saturated


@compiled
def _through_deadband(duty: float, width: float) -> float:
    """Nothing below `width`, full at 1, with a corner rounded over a tenth of the width."""
    if width <= 0.0:
        return duty
    sharp = 0.1 * width
    above = abs(duty) - width
    soft = sharp * np.logaddexp(0.0, above / sharp) if above < 20.0 * sharp else above
    full = 1.0 - width
    if abs(duty) < 1e-9:
        return 0.0
    return float(np.sign(duty) * soft / full)


@compiled
def simulate(
    p: Any,
    cycle_times: Array,
    duty: Array,
    torque_noise: Array,
    floor: Array,
    bemf_noise: Array,
    coast_share: float,
) -> Any:
    """Drive the robot; one row a firmware cycle of (bemf L, R, position L, R, bus V, gyro, x, y, heading).

    cycle_times: s; duty (n, 2) is commanded at the cycle and holds until the next, and becomes what a speed
    loop makes of it where there is one; torque_noise (n, 2) N m and
    floor (n, 2) (share of Coulomb friction) hold likewise; bemf_noise (n, 2) counts. The gyro column is the
    true turn rate with its scale, bias, drift and latency, without noise. What is neutral is not
    computed, where that leaves every bit as it is.
    """
    (
        voc, rint, discharge, res_l, res_r, ke_l, ke_r, heat_gain, heat_tau, limit,
        coulomb, viscous, stiction, stiction_speed, load_friction, dir_c, dir_v, quadratic,
        backlash, slip, scrub, radius_l, radius_r, track, j_straight, j_turn, slope_x, slope_y,
        ecc_l, ecc_pl, ecc_r, ecc_pr, deadband, latency,
        off_l, off_r, scale_l, scale_r, dead_zone, filter_tau,
        gyro_bias, gyro_scale, gyro_drift, imu_latency,
        cog_l, cog_r, rub_l, rub_r, payload, payload_time, patch, patch_length, gyro_speed, gyro_side,
        bristle, bristle_damping, smooth, gyro_smooth, own_cycle, speed_loop, line_steer,
    ) = p  # fmt: skip
    ke, res = (ke_l, ke_r), (res_l, res_r)
    radius, cog, rub = (radius_l, radius_r), (cog_l, cog_r), (rub_l, rub_r)
    ecc, ecc_phase = (ecc_l, ecc_r), (ecc_pl, ecc_pr)
    offset, scale = (off_l, off_r), (scale_l, scale_r)
    n = cycle_times.shape[0]
    out = np.zeros((n, 11))
    w, z, angle = np.zeros(2), np.zeros(2), np.zeros(2)
    heat_fast, heat_slow = np.zeros(2), np.zeros(2)
    roll, load, load_angle = np.zeros(2), np.zeros(2), np.zeros(2)
    torque, current = np.zeros(2), np.zeros(2)
    window, filtered, position = np.zeros((2, 3)), np.zeros(2), np.zeros(2)
    reported, waited = np.zeros(2), np.array([0.0, 0.25 * own_cycle])
    x = y = heading = charge = draw = seen = 0.0
    cosine, sine = 1.0, 0.0
    on_left = False
    bus = voc
    idle = np.zeros(2)
    rate_history = np.zeros(4096)
    chip = np.zeros(2)
    ticks = 0
    pointer = 0
    for k in range(n - 1):
        out[k, 0], out[k, 1] = reported[0], reported[1]
        out[k, 2], out[k, 3] = position[0], position[1]
        seen += LINE_SHARE * (y + LINE_AHEAD * np.sin(heading) - seen)
        on_left = seen > (-LINE_EDGE if on_left else LINE_EDGE)
        for side in range(2):
            planned = duty[k, side]
            if line_steer > 0.0:
                duty[k, side] = planned * (1.0 + (line_steer if (side == 0) == on_left else -line_steer))
            if speed_loop > 0.0 and planned != 0.0:
                answer = planned + speed_loop * (FULL_SPEED * planned - reported[side])
                duty[k, side] = round(1e4 * min(max(answer, -1.0), 1.0)) / 1e4
        delay = min(int(imu_latency / STEP + 0.5), 4095)
        rate = rate_history[(ticks - delay) % 4096]
        speed = 0.5 * (roll[0] + roll[1]) * 0.0345
        out[k, 5] = gyro_scale * rate + gyro_bias + gyro_drift * cycle_times[k] + gyro_speed * abs(speed)
        out[k, 5] += gyro_side * abs(rate)
        out[k, 6], out[k, 7], out[k, 8] = x, y, heading
        out[k, 9], out[k, 10] = angle[0], angle[1]
        steps = max(int((cycle_times[k + 1] - cycle_times[k]) / STEP + 0.5), 1)
        dt = (cycle_times[k + 1] - cycle_times[k]) / steps
        smooths = 1.0 - np.exp(-dt / max(0.5 * gyro_smooth, 1e-9))
        follows = 1.0 - np.exp(-dt / max(slip, 1e-9))  # creep: a tyre pushes as much as it turns too fast
        for step in range(steps):
            now = cycle_times[k] + step * dt
            while pointer + 1 < n and cycle_times[pointer + 1] <= now - latency:
                pointer += 1
            command = duty[pointer] if cycle_times[pointer] <= now - latency else idle
            u_l = _through_deadband(command[0], deadband)
            u_r = _through_deadband(command[1], deadband)
            for _ in range(3):  # a fixed point, warm from the last step: sag lowers the current that makes it
                bus = voc - discharge * charge - rint * draw
                for side in range(2):
                    u = u_l if side == 0 else u_r
                    hot = res[side] * (1.0 + heat_gain * (0.25 * heat_fast[side] + 0.75 * heat_slow[side]))
                    current[side] = (1.0 - coast_share) * _current(u, bus, w[side], hot, ke[side], limit)
                draw = u_l * current[0] + u_r * current[1]
            charge += draw * dt
            for side in range(2):
                square = current[side] ** 2 / (1.0 - coast_share)  # a mean of what flows while it is driven
                heat_fast[side] += dt * (square - heat_fast[side]) / (0.5 * heat_tau)
                heat_slow[side] += dt * (square - heat_slow[side]) / (1.2 * heat_tau)
                drive = ke[side] * current[side] + slope_x * cosine + slope_y * sine
                turn = 1.0 if side == 0 else -1.0
                if scrub != 0.0:
                    drive += turn * scrub * np.tanh((w[1] - w[0]) / 0.05)
                wave = cog[side] * np.sin(5.0 * angle[side]) if cog[side] != 0.0 else 0.0
                drive += torque_noise[k, side] + wave
                direction = np.tanh(w[side] / 0.02) if dir_c != 0.0 or dir_v != 0.0 else 0.0
                level = coulomb * (1.0 + dir_c * direction) * (1.0 + floor[k, side])
                if stiction != 0.0:
                    level += stiction * np.exp(-((w[side] / stiction_speed) ** 2))
                level += load_friction * abs(ke[side] * current[side])
                if rub[side] != 0.0:
                    level += rub[side] * (np.cos(angle[side]) > 0.5)
                if patch != 0.0:
                    level *= 1.0 + patch * (x % (3.0 * patch_length) < patch_length)
                slope = viscous * (1.0 + dir_v * direction)
                if smooth > 0.0:
                    against = level * np.tanh(w[side] / smooth) + w[side] * (slope + quadratic * abs(w[side]))
                else:
                    against, z[side] = _friction(
                        w[side], z[side], max(level, 1e-6), slope, quadratic, bristle, bristle_damping
                    )
                torque[side] = drive - against
            heavier = 1.0 + payload * (now > payload_time)
            mean = 0.5 * (torque[0] + torque[1]) / (j_straight * heavier)
            half = 0.5 * (torque[1] - torque[0]) / (j_turn * heavier)
            for side in range(2):
                gain = mean - half if side == 0 else mean + half
                w[side] += dt * gain
                angle[side] += dt * w[side]
                if backlash > 0.0:
                    gap = angle[side] - load_angle[side]
                    push = max(abs(gap) - 0.5 * backlash, 0.0) * np.sign(gap)
                    load[side] += dt * CONTACT_RATE**2 * push
                    touches = push != 0.0
                    damped = 2.0 * CONTACT_RATE * (load[side] - w[side]) if touches else 0.0
                    load[side] -= dt * (damped + COASTING_RATE * load[side])  # the floor brakes it always
                    load_angle[side] += dt * load[side]
                else:
                    load[side] = w[side]
                roll[side] += follows * (load[side] - roll[side])
            rim_l, rim_r = radius[0] * roll[0], radius[1] * roll[1]
            if ecc[0] != 0.0 or ecc[1] != 0.0:
                rim_l = radius[0] * (1.0 + ecc[0] * np.sin(angle[0] + ecc_phase[0])) * roll[0]
                rim_r = radius[1] * (1.0 + ecc[1] * np.sin(angle[1] + ecc_phase[1])) * roll[1]
            rate = (rim_r - rim_l) / track
            forward = 0.5 * (rim_l + rim_r)
            heading += dt * rate
            cosine, sine = np.cos(heading), np.sin(heading)
            x += dt * forward * cosine
            y += dt * forward * sine
            ticks += 1
            chip[0] += smooths * (rate - chip[0])
            chip[1] += smooths * (chip[0] - chip[1])
            rate_history[ticks % 4096] = chip[1]
            left_to_read = steps - 1 - step
            for side in range(2):
                due = left_to_read == (15 if side == 0 else 10)
                if own_cycle > 0.0:
                    waited[side] += dt
                    due = waited[side] >= own_cycle
                    waited[side] -= own_cycle if due else 0.0
                if due:
                    raw = ke[side] * w[side] * COUNTS_PER_VOLT * scale[side] + offset[side]
                    window[side, 0], window[side, 1] = window[side, 1], window[side, 2]
                    window[side, 2] = raw + bemf_noise[k, side]
                    value = _median(window[side, 0], window[side, 1], window[side, 2])
                    share = 1.0 - np.exp(-0.005 / max(filter_tau, 1e-6))
                    filtered[side] += share * (value - filtered[side])
                    reported[side] = filtered[side] if abs(filtered[side]) >= dead_zone else 0.0
        out[k + 1, 4] = out[k, 4] + 0.22 * (bus - out[k, 4]) if k > 0 else bus
        for side in range(2):
            position[side] += reported[side] * (cycle_times[k + 1] - cycle_times[k])
    return out
