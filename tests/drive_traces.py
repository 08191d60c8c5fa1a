"""A small kinematic robot for tests of the estimators: known motion in, raw words and truth out.

The readings follow docs/quantities.md: back-EMF through the board's filter, a counter that sums it in
whole ticks, a gyro in its own counts. It is not the simulator: no forces, no battery, and every
disturbance is set directly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from raccoon.core.readings import SIMULATOR, Device, Inputs, Outputs, Truth

Segment = tuple[float, float, float]
"""(seconds, velocity m/s, turn rate rad/s); reached with a limited acceleration."""


@dataclass(frozen=True)
class Errors:
    """What is wrong with the robot. Left before right; scales are reading over truth."""

    offset_counts: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    track: float = 1.0
    gyro_bias: float = 0.0
    gyro_drift: float = 0.0
    gyro_scale: float = 1.0
    bemf_noise_counts: float = 7.0
    gyro_noise: float = 0.0012
    slip_noise: float = 0.0005
    imu_latency: float = 0.0
    slip: tuple[float, float, str, float] | None = None
    """(from s, to s, side, share of the wheel's travel that is lost)"""


RADIUS, TRACK, K_E, LAG = 0.0345, 0.16, 1.08, 0.0225
PER_COUNT = SIMULATOR.bemf_volts / K_E


def commands(segments: Sequence[Segment], dt: float) -> Iterator[tuple[float, float, bool]]:
    """Velocity, turn rate and whether a duty is on, a cycle each, with limited accelerations."""
    velocity = turn_rate = 0.0
    for seconds, goal_velocity, goal_turn in segments:
        for _ in range(round(seconds / dt)):
            velocity += max(-0.8 * dt, min(0.8 * dt, goal_velocity - velocity))
            turn_rate += max(-10.0 * dt, min(10.0 * dt, goal_turn - turn_rate))
            yield velocity, turn_rate, bool(goal_velocity or goal_turn)


def drive(
    segments: Sequence[Segment],
    errors: Errors = Errors(),
    *,
    seed: int = 0,
    dt: float = 0.005,
    device: Device = SIMULATOR,
    counters: bool = True,
    bemf: bool = True,
    gyro_every: int = 1,
) -> Iterator[tuple[Inputs, Outputs]]:
    """The cycles of a drive: inputs (with truth) and the command in force. gyro_every 0: no gyro."""
    return iter(_recorded(tuple(segments), errors, seed, dt, device, counters, bemf, gyro_every))


@lru_cache(maxsize=32)
def _recorded(
    segments: tuple[Segment, ...],
    errors: Errors,
    seed: int,
    dt: float,
    device: Device,
    counters: bool,
    bemf: bool,
    gyro_every: int,
) -> tuple[tuple[Inputs, Outputs], ...]:
    """The cycles of a drive. Many tests damage the same drives, each in its own way."""
    cycles: list[tuple[Inputs, Outputs]] = []
    noise = (
        np.random.default_rng(seed)
        .normal(size=(round(sum(each[0] for each in segments) / dt) + 8, 5))
        .tolist()
    )
    alpha = 1.0 - math.exp(-dt / LAG)
    x = y = heading = 0.0
    filtered, counter = list(errors.offset_counts), [0.0, 0.0]
    rates: list[float] = []
    track = TRACK * errors.track
    for cycle, (velocity, turn_rate, driven) in enumerate(commands(segments, dt)):
        time, draw = cycle * dt, noise[cycle]
        side = 0.5 * track * turn_rate
        ground = [velocity - side, velocity + side]
        for each in (0, 1):
            counts = ground[each] * errors.scale[each] / RADIUS / PER_COUNT + errors.offset_counts[each]
            counts += errors.bemf_noise_counts * draw[each]
            if cycle:
                filtered[each] += alpha * (counts - filtered[each])
            counter[each] += filtered[each] * dt / device.position_counts_seconds
            ground[each] += errors.slip_noise * math.sqrt(abs(ground[each]) * dt) * draw[2 + each] / dt
        if errors.slip and errors.slip[0] <= time < errors.slip[1]:
            ground[("left", "right").index(errors.slip[2])] *= 1.0 - errors.slip[3]
        way, true_turn = 0.5 * (ground[0] + ground[1]) * dt, (ground[1] - ground[0]) / track
        middle = heading + 0.5 * true_turn * dt
        x, y, heading = x + way * math.cos(middle), y + way * math.sin(middle), heading + true_turn * dt
        rates.append(true_turn)
        late = rates[max(0, len(rates) - 1 - round(errors.imu_latency / dt))]
        bias = errors.gyro_bias + errors.gyro_drift * time
        rate = errors.gyro_scale * late + bias + errors.gyro_noise * draw[4]
        word = round(rate / device.gyro_rad_s)
        has_gyro = gyro_every > 0 and cycle % gyro_every == 0
        duty = 0.5 if driven else 0.0
        inputs = Inputs(
            time=time,
            device=device,
            bemf=(*(float(round(each)) for each in filtered), None, None) if bemf else (None,) * 4,
            position=(*(float(math.floor(each)) for each in counter), None, None)
            if counters
            else (None,) * 4,
            gyro=(0.0, 0.0, float(word)) if has_gyro else None,
            truth=Truth(x, y, heading),
        )
        cycles.append((inputs, Outputs(duty=(duty, duty, 0.0, 0.0))))
    return tuple(cycles)
