"""Rough estimate of an axis by regression, the start of its fit, with typical sizes as scales of the
causes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis.fit import FreeParameter
from raccoon.diagnose.recordings.axis.log import AxisLog

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RoughAxis:
    """A rough estimate of an axis. parameters: of the base model. time_constant: s. effort, force, speed:
    typical sizes, in the units of the effort, of the force or torque, and of the speed."""

    parameters: tuple[FreeParameter, ...]
    time_constant: float
    effort: float
    force: float
    speed: float


def estimate_rough_axis(log: AxisLog) -> RoughAxis:
    """Estimate the base model by regression. Raises TraceError if the axis does not move."""
    speed, acceleration = _derivatives(log)
    usual = float(np.percentile(np.abs(speed), 95.0))
    if not usual > 0.0 or np.ptp(speed) < 1e-9:
        raise TraceError(f"{log.names[1]} never changes although {log.names[0]} does: nothing moves")
    if log.is_electrical and log.current is not None:
        return _rough_electrical(log, log.current, speed, acceleration, usual)
    return _rough_mechanical(log, speed, acceleration, usual)


def _derivatives(log: AxisLog) -> tuple[Array, Array]:
    from scipy.signal import savgol_filter

    known = np.isfinite(log.motion)
    filled = np.interp(log.time, log.time[known], log.motion[known])
    width = 41 if len(filled) > 2000 else 21
    first = 0 if log.is_speed else 1
    found = [
        savgol_filter(filled, width, 3, deriv=order, delta=log.step)
        if order
        else savgol_filter(filled, width, 3)
        for order in (first, first + 1)
    ]
    return found[0], found[1]


def _usual_effort(log: AxisLog) -> float:
    """Typical effort: the 95th percentile of its magnitude, or the largest one if it is 0 nearly all the
    time."""
    size = np.abs(log.effort)
    return float(np.percentile(size, 95.0)) or float(size.max())


def _rough_mechanical(log: AxisLog, speed: Array, acceleration: Array, usual: float) -> RoughAxis:
    columns = np.column_stack([acceleration, speed, np.sign(speed), np.ones_like(speed)])
    moving = np.abs(speed) > 0.05 * usual
    found = np.linalg.lstsq(columns[moving], log.effort[moving], rcond=None)[0]
    effort = _usual_effort(log)
    inertia = max(float(found[0]), 1e-3 * effort / max(float(np.abs(acceleration).max()), 1e-9))
    viscous = max(float(found[1]), 0.02 * effort / usual)
    base = [
        FreeParameter("inertia", inertia, 0.3, positive=True),
        FreeParameter("viscous", viscous, 0.3, positive=True),
    ]
    if log.effort_unit == "V":
        base.append(FreeParameter("inductance", 1e-3, 1.0, positive=True, low=1e-6, high=0.03))
    else:
        dry = max(float(found[2]), 0.02 * effort)
        base += [
            FreeParameter("coulomb", dry, 0.3, positive=True),
            FreeParameter("offset", 0.0, 0.1 * effort),
        ]
    return RoughAxis(tuple(base), inertia / viscous, effort, effort, usual)


def _rough_electrical(
    log: AxisLog, current: Array, speed: Array, acceleration: Array, usual: float
) -> RoughAxis:
    known = np.isfinite(current)
    pair = np.linalg.lstsq(np.column_stack([current, speed])[known], log.effort[known], rcond=None)[0]
    effort = _usual_effort(log)
    amps = float(np.percentile(np.abs(current[known]), 99.0))
    resistance = float(np.clip(pair[0], 0.2 * effort / amps, 5.0 * effort / amps))
    back_emf = float(np.clip(pair[1], 0.2 * effort / usual, 2.0 * effort / usual))
    torque = back_emf * current
    columns = np.column_stack([acceleration, np.sign(speed)])[known]
    found = np.linalg.lstsq(columns, torque[known], rcond=None)[0]
    force = float(np.percentile(np.abs(torque[known]), 95.0))
    inertia = max(float(found[0]), 1e-3 * force / max(float(np.abs(acceleration).max()), 1e-9))
    base = (
        FreeParameter(
            "resistance", resistance, 0.3, positive=True, low=0.1 * resistance, high=10.0 * resistance
        ),
        FreeParameter(
            "inductance", 1e-3 * resistance, 1.0, positive=True, low=1e-6 * resistance, high=0.05 * resistance
        ),
        FreeParameter("back_emf", back_emf, 0.3, positive=True, low=0.1 * back_emf, high=10.0 * back_emf),
        FreeParameter("inertia", inertia, 0.3, positive=True),
    )
    return RoughAxis(base, inertia * resistance / back_emf**2, effort, force, usual)
