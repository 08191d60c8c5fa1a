"""Axes and motors with known faults, made by an integrator of their own: smooth friction, scipy's solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Columns = dict[str, Array]


@dataclass(frozen=True)
class Axis:
    """Numbers of a carriage: kg, N s/m, N. viscous_asymmetry: share; load: share of the driving force."""

    mass: float = 40.0
    viscous: float = 90.0
    coulomb: float = 12.0
    viscous_asymmetry: float = 0.0
    quadratic: float = 0.0
    stiction: float = 0.0
    late: float = 0.0
    load: float = 0.0


def steps(rng: np.random.Generator, seconds: float, size: float) -> Callable[[float], float]:
    """Random levels, each 0.2 to 0.7 s, as a function of time."""
    edges = np.cumsum(rng.uniform(0.2, 0.7, int(seconds / 0.2)))
    levels = size * rng.choice([-1.0, -0.7, -0.4, 0.0, 0.4, 0.7, 1.0], len(edges))
    return lambda t: float(levels[int(np.searchsorted(edges, t, side="right"))]) if t >= 0.0 else 0.0


def carriage(axis: Axis, seed: int, seconds: float = 10.0) -> Columns:
    """Force and travel at 500 Hz; noise: pushes of 0.3 N that last 0.1 s, and 5 um of the encoder."""
    rng = np.random.default_rng(seed)
    force = steps(rng, seconds, 60.0)
    pushes = _pushes(rng, seconds, 0.3)

    def change(t: float, state: Array) -> list[float]:
        w = state[1]
        drive = force(t - axis.late)
        side = np.tanh(w / 2e-4)
        dry = axis.coulomb + axis.stiction * np.exp(-((w / 0.02) ** 2)) + axis.load * abs(drive)
        drag = axis.viscous * (1.0 + axis.viscous_asymmetry * side) + axis.quadratic * abs(w)
        return [w, (drive + pushes(t) - dry * side - drag * w) / axis.mass]

    time = np.arange(0.0, seconds, 0.002)
    found = solve_ivp(change, (0.0, seconds), [0.0, 0.0], "LSODA", time, rtol=1e-6, atol=1e-8, max_step=0.02)
    travel = found.y[0] + 5e-6 * rng.standard_normal(len(time))
    return {"t": time, "motor.0.force": np.array([force(each) for each in time]), "motor.0.travel": travel}


def _pushes(rng: np.random.Generator, seconds: float, size: float) -> Callable[[float], float]:
    grid = np.arange(0.0, seconds + 1.0, 0.02)
    walk = np.zeros(len(grid))
    for index in range(1, len(grid)):
        walk[index] = 0.82 * walk[index - 1] + size * 0.57 * rng.standard_normal()
    return lambda t: float(np.interp(t, grid, walk))


def motor(
    seed: int, coulomb: float = 0.0, port: int = 0, backwards: bool = False, seconds: float = 1.2
) -> Columns:
    """Voltage steps, current and speed of one brushed motor at 1 kHz: 4 ohm, 4 mH, 0.09 V s/rad."""
    rng = np.random.default_rng(seed)
    levels = [2.0, 4.0, -4.0, 3.0, -2.0, 0.0]
    time = np.arange(0.0, seconds, 0.001)
    sign = -1.0 if backwards else 1.0

    def volts(t: float) -> float:
        return levels[min(int(t / 0.2), len(levels) - 1)]

    def change(t: float, state: Array) -> list[float]:
        i, w = state
        return [
            (sign * volts(t) - 4.0 * i - 0.09 * w) / 4e-3,
            (0.09 * i - coulomb * np.tanh(w / 0.05)) / 8e-5,
        ]

    found = solve_ivp(change, (0.0, seconds), [0.0, 0.0], "LSODA", time, rtol=1e-7, atol=1e-9, max_step=0.002)
    current = found.y[0] + 0.02 * rng.standard_normal(len(time))
    speed = found.y[1] + 0.3 * rng.standard_normal(len(time))
    names = ("voltage", "current", "speed")
    values = (np.array([volts(each) for each in time]), current, speed)
    return {"t": time, **{f"motor.{port}.{name}": each for name, each in zip(names, values, strict=True)}}


def bench(
    seed: int,
    coulomb: float = 0.0,
    asymmetry: float = 0.0,
    late: float = 0.0,
    dead_below: float = 0.0,
    deadband: float = 0.0,
    seconds: float = 8.0,
) -> Columns:
    """A motor on a bench under held random volts and ramps, 500 Hz: 2 ohm, 1 mH, 0.25 V s/rad, 2 g m2.

    dead_below: volts below which nothing comes through, all of it above. deadband: nothing up to it, then
    linearly to all of 8 V. One step of Euler's method every 0.1 ms, the winding's exact.
    """
    rng = np.random.default_rng(seed)
    step, every = 1e-4, 20
    volts = np.zeros(round(seconds * 500))
    row = 0
    while row < len(volts):
        length = int(rng.integers(100, 300))
        flat, slope = rng.uniform(-6.0, 6.0, 2)
        ramp = np.linspace(-1.0, 1.0, length) * slope * (rng.random() < 0.3)
        volts[row : row + length] = (ramp if ramp.any() else np.full(length, flat))[: len(volts) - row]
        row += length
    size = np.abs(volts)
    acting = np.sign(volts) * np.maximum(size - deadband, 0.0) * 8.0 / (8.0 - deadband)
    acting = np.where(size < dead_below, 0.0, acting)
    kept, lag = float(np.exp(-step * 2.0 / 1e-3)), round(late / step)
    speed, current = np.zeros(len(volts)), np.zeros(len(volts))
    w = i = 0.0
    for index in range(len(volts) * every):
        if index % every == 0:
            speed[index // every], current[index // every] = w, i
        u = float(acting[(index - lag) // every]) if index >= lag else 0.0
        settled = (u - 0.25 * w) / 2.0
        i = settled + (i - settled) * kept
        side = float(np.sign(w) or np.sign(i))
        dry = coulomb * (1.0 + asymmetry * side)
        new = w + step * (0.25 * i - side * dry) / 0.002
        w = 0.0 if w * new < 0.0 or (w == 0.0 and abs(0.25 * i) <= dry) else new
    return {
        "t": 0.002 * np.arange(len(volts), dtype=np.float64),
        "motor.0.voltage": volts,
        "motor.0.speed": speed + 0.05 * rng.standard_normal(len(volts)),
        "motor.0.current": current + 0.01 * rng.standard_normal(len(volts)),
        "battery.voltage": 8.0 + 0.01 * rng.standard_normal(len(volts)),
    }
