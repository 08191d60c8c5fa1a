"""Free curves that are added to what a sensor says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.fit.linear_model import Group

Array = NDArray[np.float64]

PREFIX = "unknown: "
GYRO, BATTERY = 0.02, 0.02
"""rad/s and V, the usual sizes of what a sensor is off by."""
RATE = "rad/s of the wheels"


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe(Group):
    """A free curve over what something may depend on. quantity, unit: what the curve is. over (bins,), in
    over_unit: what it runs along. curves (count, bins): what one unit of each column is of the quantity
    (of an inertia the logarithm of its factor)."""

    quantity: str
    unit: str
    over: Array
    over_unit: str
    curves: Array


def hats(values: Array, count: int) -> Array:
    """(count, n): triangles over the range of the values."""
    low, high = float(np.quantile(values, 0.01)), float(np.quantile(values, 0.99))
    knots = np.linspace(low, high, count)
    width = max(high - low, 1e-9) / (count - 1)
    return np.maximum(0.0, 1.0 - np.abs(np.clip(values, low, high)[None] - knots[:, None]) / width)


def _bent(curves: Array, values: Array) -> Array:
    """The curves without their straight part: a bias and a drift are in the catalogue."""
    straight = np.stack([np.ones_like(values), values - values.mean()])
    straight /= np.linalg.norm(straight, axis=1)[:, None]
    return np.asarray(curves - (curves @ straight.T) @ straight, float)


def gyro_over_speed(features: Features, wheels: Array) -> list[Probe]:
    """A gyro that hears the motors, and one that reads more to one side than to the other. wheels (bins, 2):
    rad/s of both."""
    forward, turn = wheels.mean(axis=1), 0.5 * (wheels[:, 1] - wheels[:, 0])
    size = np.abs(turn)[None]  # one curve, since each that may be there takes evidence from what is
    alike = size / max(float(np.quantile(size, 0.99)), 1e-9)
    return [
        *sensor_probe(features, "gyro", "gyro over speed", GYRO * hats(forward, 6), forward, RATE),
        *sensor_probe(features, "gyro", "gyro over turn rate", GYRO * alike, turn, RATE),
    ]


def sensor_probes(features: Features, time: Array) -> list[Probe]:
    """What a gyro and a battery's reading may be off by over time, beyond a bias and a drift."""
    over_time = _bent(hats(time, 8), time)
    return [
        *sensor_probe(features, "gyro", "gyro over time", GYRO * over_time, time, "s"),
        *sensor_probe(features, "battery", "battery over time", BATTERY * over_time, time, "s"),
    ]


def sensor_probe(
    features: Features, role: str, name: str, curves: Array, over: Array, over_unit: str
) -> list[Probe]:
    """Curves (count, bins) added to a sensor, if there is one."""
    if role not in features.roles:
        return []
    columns = np.zeros((len(curves), *features.measured.shape))
    columns[:, :, features.roles.index(role)] = curves
    unit = {"gyro": "rad/s", "battery": "V"}[role]
    return [
        Probe(
            PREFIX + name, columns, quantity=f"error of the {role}'s reading", unit=unit, over=over,
            over_unit=over_unit, curves=curves,
        )
    ]  # fmt: skip
