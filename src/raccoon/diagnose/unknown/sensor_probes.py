"""Probes of sensors: free curves that are added to the reading of a gyro or of the battery."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.fit.linear_model import ColumnGroup

Array = NDArray[np.float64]

UNKNOWN_PREFIX = "unknown: "
USUAL_GYRO_ERROR, USUAL_BATTERY_ERROR = 0.02, 0.02
"""Prior standard deviations of a sensor's error, in rad/s and V."""
WHEEL_SPEED_UNIT = "rad/s of the wheels"


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe(ColumnGroup):
    """A free curve over a covariate on which an unknown effect may depend. quantity, unit: of the curve's
    values. over (bins,), in over_unit: the covariate. curves (count, bins): values of the quantity for one
    unit of each column (for an inertia the logarithm of its factor)."""

    quantity: str
    unit: str
    over: Array
    over_unit: str
    curves: Array


def hat_functions(values: Array, count: int) -> Array:
    """Hat functions (count, n): triangles on equidistant knots over the range of the values."""
    low, high = float(np.quantile(values, 0.01)), float(np.quantile(values, 0.99))
    knots = np.linspace(low, high, count)
    width = max(high - low, 1e-9) / (count - 1)
    return np.maximum(0.0, 1.0 - np.abs(np.clip(values, low, high)[None] - knots[:, None]) / width)


def without_straight_line(curves: Array, values: Array) -> Array:
    """The curves without their linear part: a bias and a drift are in the catalogue."""
    straight = np.stack([np.ones_like(values), values - values.mean()])
    straight /= np.linalg.norm(straight, axis=1)[:, None]
    return np.asarray(curves - (curves @ straight.T) @ straight, float)


def gyro_speed_probes(features: Features, wheels: Array) -> list[Probe]:
    """Probes of a gyro that the motors disturb, and of one that reads more in one direction than in the
    other. wheels (bins, 2): rad/s of both."""
    forward, turn = wheels.mean(axis=1), 0.5 * (wheels[:, 1] - wheels[:, 0])
    size = np.abs(turn)[None]  # one curve only, since each further one costs evidence
    symmetric = size / max(float(np.quantile(size, 0.99)), 1e-9)
    return [
        *sensor_probe(
            features,
            "gyro",
            "gyro over speed",
            USUAL_GYRO_ERROR * hat_functions(forward, 6),
            forward,
            WHEEL_SPEED_UNIT,
        ),
        *sensor_probe(
            features, "gyro", "gyro over turn rate", USUAL_GYRO_ERROR * symmetric, turn, WHEEL_SPEED_UNIT
        ),
    ]


def sensor_time_probes(features: Features, time: Array) -> list[Probe]:
    """Probes of the error of a gyro and of a battery's reading over time, beyond a bias and a drift."""
    over_time = without_straight_line(hat_functions(time, 8), time)
    return [
        *sensor_probe(features, "gyro", "gyro over time", USUAL_GYRO_ERROR * over_time, time, "s"),
        *sensor_probe(features, "battery", "battery over time", USUAL_BATTERY_ERROR * over_time, time, "s"),
    ]


def sensor_probe(
    features: Features, role: str, name: str, curves: Array, over: Array, over_unit: str
) -> list[Probe]:
    """The probe of curves (count, bins) added to a sensor; empty if it is not measured."""
    if role not in features.roles:
        return []
    columns = np.zeros((len(curves), *features.measured.shape))
    columns[:, :, features.roles.index(role)] = curves
    unit = {"gyro": "rad/s", "battery": "V"}[role]
    return [
        Probe(
            UNKNOWN_PREFIX + name, columns, quantity=f"error of the {role}'s reading", unit=unit, over=over,
            over_unit=over_unit, curves=curves,
        )
    ]  # fmt: skip
