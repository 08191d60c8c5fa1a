"""What a reference of the pose decides: gyro scale, track width and wheel radius are twins without it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.extend import with_causes
from raccoon.diagnose.reports.wording import explanation
from raccoon.diagnose.result import CauseResult, Diagnosis, ParameterResult
from raccoon.estimate.drive_calibration.columns import manoeuvre
from raccoon.estimate.drive_calibration.fit import calibrate_drive

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

TWINS = ("imu.gyro_scale", "drive.track_width", "drive.wheel_radius")
STRETCH = 1.0
"""S over which the gyro's turn is compared with the reference's."""
READING = ("bemf.scale", "motor.back_emf_constant")
"""What makes the counts of a turning wheel larger than assumed, and is no length."""
CLEAR = 3.5
LEAST_TURN = math.pi


@dataclass(frozen=True, slots=True)
class _Factor:
    """A number over its configured value, with both deviations together."""

    value: float
    std: float

    @property
    def clear(self) -> float:
        """How many deviations it is from 1."""
        return abs(self.value - 1.0) / max(self.std, 1e-9)


def with_reference(
    found: Diagnosis, columns: Columns, robot: RobotConfig, device: Device = SI_WORDS
) -> Diagnosis:
    """The diagnosis with its twins decided by `truth.*`, where those are recorded and decide."""
    factors = _factors(columns, robot, device, found.causes)
    if not factors:
        return found
    identified = {
        f"{id_.partition('.')[2]} by the reference": ParameterResult(each.value, each.std, "", 1.0)
        for id_, each in factors.items()
    }
    clear = [id_ for id_, each in factors.items() if each.clear > CLEAR]
    causes = tuple(_decided(each, factors, clear) for each in found.causes)
    model = found.model
    for wrong, right in zip(found.causes, causes, strict=True):
        if model is not None and right.id != wrong.id:
            model = with_causes(model.without_effect(wrong.id), [right])
    return replace(found, causes=causes, model=model, identified={**found.identified, **identified})


def _decided(cause: CauseResult, factors: Mapping[str, _Factor], clear: list[str]) -> CauseResult:
    """One of the twins as the reference says; a cause of one side only is no twin."""
    if cause.id not in TWINS or cause.where is not None:
        return cause
    if cause.id in clear:
        return replace(cause, confounded_with=_others(cause, factors))
    rivals = [each for each in clear if each in cause.confounded_with]
    if not rivals:
        return cause
    right = max(rivals, key=lambda each: factors[each].clear)
    number = ParameterResult(factors[right].value, factors[right].std, "", 1.0)
    values = {"factor": number}
    return replace(
        cause, id=right, parameters=values, explanation=explanation(right, None, values),
        confounded_with=_others(cause, factors),
    )  # fmt: skip


def _others(cause: CauseResult, factors: Mapping[str, _Factor]) -> tuple[str, ...]:
    return tuple(each for each in cause.confounded_with if each not in factors and each not in TWINS)


def _factors(
    columns: Columns, robot: RobotConfig, device: Device, causes: Sequence[CauseResult]
) -> dict[str, _Factor]:
    found: dict[str, _Factor] = {}
    gyro = _gyro(columns, robot)
    if gyro is not None:
        found["imu.gyro_scale"] = gyro
    reading = {side: _reading(causes, side) for side in ("left", "right")}
    try:
        driven = manoeuvre(columns, robot, device=device)
        driven = replace(
            driven,
            left=driven.left / reading["left"].value,
            right=driven.right / reading["right"].value,
        )
        fitted = calibrate_drive(robot, [driven], device=device)
    except CalibrationError:
        return found
    drive, unsure = robot.model.drive, max(each.std for each in reading.values())
    found["drive.track_width"] = _factor(fitted.track_width, drive.track_width, unsure)
    left, right = (
        _factor(each, drive.wheel_radius, unsure) for each in (fitted.left_radius, fitted.right_radius)
    )
    found["drive.wheel_radius"] = _Factor(0.5 * (left.value + right.value), 0.5 * (left.std + right.std))
    return found


def _reading(causes: Sequence[CauseResult], side: str) -> _Factor:
    """By what the causes that were named make a wheel's counts larger than assumed. Its std is relative."""
    named = [
        each.parameters["factor"] for each in causes if each.id in READING and each.where in (None, side)
    ]
    value = math.prod(each.value for each in named)
    return _Factor(value, math.hypot(*(each.std / each.value for each in named)))


def _factor(fitted: Measured, configured: Measured, unsure: float) -> _Factor:
    """unsure: relative deviation of the readings themselves."""
    std = math.hypot(fitted.std, configured.std, unsure * fitted.value)
    return _Factor(fitted.value / configured.value, std / configured.value)


def _gyro(columns: Columns, robot: RobotConfig) -> _Factor | None:
    """Slope of the gyro's turn over the reference's, beside a bias, over stretches of a second."""
    if "truth.heading" not in columns or "imu.gyro.z" not in columns:
        return None
    time, rate, heading = (columns[name] for name in ("t", "imu.gyro.z", "truth.heading"))
    known, seen = np.isfinite(rate), np.isfinite(heading)
    if known.sum() < 50 or seen.sum() < 50:
        return None
    rates = np.interp(time, time[known], rate[known])
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time))])
    truth = np.interp(time, time[seen], np.unwrap(heading[seen]))
    ends = np.searchsorted(time, np.arange(time[0], time[-1], STRETCH))
    x, y, dt = np.diff(truth[ends]), np.diff(turned[ends]), np.diff(time[ends])
    if len(x) < 5 or float(np.abs(x).sum()) < LEAST_TURN:
        return None
    J = np.column_stack([x, dt])
    found = np.linalg.lstsq(J, y, rcond=None)[0]
    left = y - J @ found
    std = math.sqrt(float(left @ left) / max(len(x) - 2, 1) * float(np.linalg.inv(J.T @ J)[0, 0]))
    scale = robot.model.imu.gyro_scale
    return _Factor(float(found[0]) / scale.value, math.hypot(std, scale.std) / scale.value)
