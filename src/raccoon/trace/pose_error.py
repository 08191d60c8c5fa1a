"""The error of an estimated pose against that of a reference system."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from raccoon.core.errors import TraceError
from raccoon.trace.recording import Column, Recording


@dataclass(frozen=True, slots=True)
class PoseError:
    """Error of the estimated poses of a drive against the truth.

    distance: length of the true path, m. rms: of the position error over all samples with truth, m; final:
    position error at the last of them, m. heading_rms, heading_final: rad, the latter signed (estimate minus
    truth). samples: number of samples with truth.
    """

    distance: float
    rms: float
    final: float
    heading_rms: float
    heading_final: float
    samples: int


@dataclass(frozen=True, slots=True)
class PooledError:
    """Root mean squares over several runs, m and rad: `rms` and `heading_rms` weight every sample equally,
    `final` and `heading_final` every run."""

    runs: int
    rms: float
    final: float
    heading_rms: float
    heading_final: float


def field_truth(recording: Recording) -> tuple[Column, Column, Column]:
    """True x, y (m) and heading (rad) relative to the first true pose, as odometry starts at (0, 0) with
    heading 0.

    The heading is unwrapped, because many references give it between -pi and pi. NaN in rows without truth.
    Raises TraceError if no row has truth.
    """
    x, y, heading = (recording[f"truth.{name}"] for name in ("x", "y", "heading"))
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(heading))
    if not known.size:
        raise TraceError("truth.x, truth.y and truth.heading have no row in common")
    start = known[0]
    heading = heading.copy()
    heading[known] = np.unwrap(heading[known])
    ahead, left = x - x[start], y - y[start]
    cosine, sine = math.cos(heading[start]), math.sin(heading[start])
    return ahead * cosine + left * sine, left * cosine - ahead * sine, heading - heading[start]


def pose_error(recording: Recording, x: Column, y: Column, heading: Column) -> PoseError:
    """Error of the estimated pose of each row (m, m, rad, unwrapped) in the field frame of the start.

    Raises TraceError if the recording has no truth.
    """
    true_x, true_y, true_heading = field_truth(recording)
    known = np.isfinite(true_x) & np.isfinite(true_y) & np.isfinite(true_heading)
    true_x, true_y = true_x[known], true_y[known]
    distance = np.hypot(x[known] - true_x, y[known] - true_y)
    turned = heading[known] - true_heading[known]
    return PoseError(
        distance=float(np.hypot(np.diff(true_x), np.diff(true_y)).sum()),
        rms=_rms(distance),
        final=float(distance[-1]),
        heading_rms=_rms(turned),
        heading_final=float(turned[-1]),
        samples=len(distance),
    )


def pool_errors(errors: Iterable[PoseError]) -> PooledError:
    """The root mean squares over runs. Raises ValueError if there is none."""
    errors = list(errors)
    if not errors:
        raise ValueError("there is no run to pool")
    weights = np.array([error.samples for error in errors], np.float64)
    return PooledError(
        runs=len(errors),
        rms=_rms(np.array([error.rms for error in errors]), weights),
        final=_rms(np.array([error.final for error in errors])),
        heading_rms=_rms(np.array([error.heading_rms for error in errors]), weights),
        heading_final=_rms(np.array([error.heading_final for error in errors])),
    )


def _rms(values: Column, weights: Column | None = None) -> float:
    return math.sqrt(float(np.average(np.square(values), weights=weights)))
