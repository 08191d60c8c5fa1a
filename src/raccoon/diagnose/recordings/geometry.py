"""Wheel angles against a reference of the pose (motion capture), without commands: what is the geometry?"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import DriveModel, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.extend import with_causes
from raccoon.diagnose.reports.wording import MANOEUVRES
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Curve,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    Unexplained,
    Verdict,
)
from raccoon.estimate.drive_calibration.columns import Manoeuvre, manoeuvre
from raccoon.estimate.drive_calibration.fit import calibrate_drive, path
from raccoon.sim.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

SURE = 3.0
"""Standard deviations from the configured value at which a factor is a cause."""
LEAST_GAIN = 0.03
LEAST_FACTOR = 0.001
"""A wheel that is 0.1 % off is as good as a wheel gets."""
SHARE_FITTED = 0.7
POSITION, HEADING = "truth position", "truth.heading"
NO_COMMANDS = "not identifiable: motor.N.duty is missing, so what drove the wheels is unknown"


@dataclass(frozen=True, slots=True)
class _Errors:
    """Pooled root mean squares: position m, heading rad."""

    position: float
    heading: float


def diagnose_geometry(
    runs: Sequence[Columns],
    robot: RobotConfig,
    *,
    holdout: Sequence[Columns] = (),
    device: Device = SI_WORDS,
) -> Diagnosis:
    """Compare dead reckoning with the reference, over one or many runs of the same robot.

    holdout: runs to judge on; without them every second run, or the last 30 % of a single one. What one
    turning direction cannot tell is `not_identifiable`. Raises CalibrationError naming a column that is not
    usable.
    """
    begin = time.perf_counter()
    fitted, unseen = _shared(runs, holdout, robot, device)
    try:
        found = calibrate_drive(robot, fitted, device=device)
    except CalibrationError as error:
        return _cannot_tell(str(error), fitted, robot, begin)
    radius, track = robot.model.drive.wheel_radius.value, robot.model.drive.track_width.value
    pairs = ((found.left_radius, radius), (found.right_radius, radius), (found.track_width, track))
    whole = np.array([number.value / nominal for number, nominal in pairs])
    stds = np.array([number.std / nominal for number, nominal in pairs])
    return _judged(_Fitted(robot, whole, stds, fitted, unseen), begin)


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Factors (3,) on left way, right way and track width, with deviations, and the runs."""

    robot: RobotConfig
    factors: Array
    stds: Array
    fitted: Sequence[Manoeuvre]
    unseen: Sequence[Manoeuvre]

    def errors(self, factors: Array) -> _Errors:
        """Over the unseen runs; each starts at the reference's pose."""
        parts = [_differences(factors, self.robot, each) for each in self.unseen]
        whole = np.concatenate(parts)
        return _Errors(
            float(np.sqrt((whole[:, :2] ** 2).sum(axis=1).mean())), float(np.sqrt((whole[:, 2] ** 2).mean()))
        )


def _shared(
    runs: Sequence[Columns], holdout: Sequence[Columns], robot: RobotConfig, device: Device
) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    made = [manoeuvre(each, robot, device=device) for each in runs]
    if holdout:
        return made, [manoeuvre(each, robot, device=device) for each in holdout]
    if len(made) > 1:
        return made[::2], made[1::2]
    count = len(made[0].t)
    split = int(SHARE_FITTED * count)
    return [made[0].piece(0, split)], [made[0].piece(split, count)]


def _differences(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Dead reckoning minus reference, (n, 3), from the reference's first pose on."""
    if each.truth is None:
        raise CalibrationError("a run to judge on has no truth.x, truth.y and truth.heading")
    driven, start = path(factors, robot, each), each.truth[0]
    c, s = math.cos(start[2]), math.sin(start[2])
    turned = np.column_stack(
        [c * driven[:, 0] - s * driven[:, 1], s * driven[:, 0] + c * driven[:, 1], driven[:, 2]]
    )
    return np.asarray(turned + start - each.truth)


def _judged(fit: _Fitted, begin: float) -> Diagnosis:
    nominal = np.ones(3)
    before = fit.errors(nominal)
    parts = _parts(fit)
    named = [each for each in parts if each.sure]
    after_factors = _combined(named)
    after = fit.errors(after_factors)
    causes, useless = [], []
    for each in named:
        without = fit.errors(_combined([other for other in named if other is not each]))
        if after.position > (1.0 - LEAST_GAIN) * without.position:
            useless.append(each)
        else:
            causes.append((without, each))
    causes.sort(key=lambda pair: -pair[0].position)
    floor = replace(fit, unseen=fit.fitted).errors(fit.factors)
    results = tuple(
        _cause(*pair, (before, after, floor), rank + 1, fit.robot.model.drive)
        for rank, pair in enumerate(causes)
    )
    rejected = [
        Rejected(each.name, "inside its deviation" if each not in useless else "it does not help unseen runs")
        for each in parts
        if each in useless or not each.sure
    ]
    return Diagnosis(
        Verdict.EXPLAINED if results else Verdict.ADEQUATE,
        (
            ChannelResult(POSITION, "m", before.position, after.position, floor.position, 0.0),
            ChannelResult(HEADING, "rad", before.heading, after.heading, floor.heading, 0.0),
        ),
        results,
        (*rejected, *_without_commands()),
        Unexplained(float(np.clip(after.position**2 / max(before.position**2, 1e-300), 0.0, 1.0))),
        (),
        time.perf_counter() - begin,
        with_causes(Parameters.from_robot(fit.robot), results),
        (f"{len(fit.fitted)} runs fitted, {len(fit.unseen)} others to judge on",),
        _identified(fit),
        (),
        _curves(fit, nominal, after_factors),
    )


@dataclass(frozen=True, slots=True)
class _Part:
    """One factor that may be a cause, and what it does to (left, right, track)."""

    id: str
    where: str | None
    factor: float
    std: float
    factors: Array

    @property
    def name(self) -> str:
        return self.id if self.where is None else f"{self.id}@{self.where}"

    @property
    def sure(self) -> bool:
        return abs(self.factor - 1.0) > max(SURE * self.std, LEAST_FACTOR)


def _parts(fit: _Fitted) -> list[_Part]:
    """Both wheels' common factor, what the left has beyond it, and the track.

    Wheels that differ by less than their deviations are one cause, both wheels'; else each is its own.
    """
    left, right, track = (float(each) for each in fit.factors)
    one, two, wide = (float(each) for each in fit.stds)
    found = [_Part("drive.track_width", None, track, wide, np.array([1.0, 1.0, track]))]
    if abs(left - right) > SURE * math.hypot(one, two):
        found.append(_Part("drive.wheel_radius", "left", left, one, np.array([left, 1.0, 1.0])))
        found.append(_Part("drive.wheel_radius", "right", right, two, np.array([1.0, right, 1.0])))
    else:
        both = 0.5 * (left + right)
        found.append(_Part("drive.wheel_radius", None, both, 0.5 * (one + two), np.array([left, right, 1.0])))
    return found


def _combined(parts: Sequence[_Part]) -> Array:
    return np.asarray(np.prod([np.ones(3), *(each.factors for each in parts)], axis=0))


def _cause(
    without: _Errors, part: _Part, errors: tuple[_Errors, _Errors, _Errors], rank: int, drive: DriveModel
) -> CauseResult:
    """errors: before, after and the floor."""
    before, after, floor = errors
    track = part.id.endswith("track_width")
    number = (drive.track_width if track else drive.wheel_radius).value * part.factor
    value = f"{'track_width' if track else 'wheel_radius'} = {number:.5f} (m)"

    wheels = "both wheels" if part.where is None else f"the {part.where} wheel"
    what = {
        "drive.track_width": "The wheels touch the floor",
        "drive.wheel_radius": f"The radius of {wheels} is",
    }[part.id]
    percent = abs(part.factor - 1.0) * 100.0
    more, less = ("further apart", "closer together") if part.id.endswith("width") else ("larger", "smaller")
    sentence = (
        f"{what} {percent:.2f} % {more if part.factor > 1.0 else less} than configured: put {value} into "
        "robot.toml."
    )
    removable = max(before.position - after.position, 1e-300)
    unit = max(floor.position, 1e-12)
    return CauseResult(
        part.id,
        part.where,
        rank,
        {"factor": ParameterResult(part.factor, part.std, "", 1.0)},
        Gain(
            without.position / unit,
            after.position / unit,
            float(np.clip((without.position - after.position) / removable, 0.0, 1.0)),
        ),
        0.99,
        (),
        sentence,
    )


def _identified(fit: _Fitted) -> Mapping[str, ParameterResult]:
    drive = fit.robot.model.drive
    radius, track = drive.wheel_radius.value, drive.track_width.value
    left, right, wide = fit.factors
    return {
        "wheel_radius@left": ParameterResult(radius * left, radius * fit.stds[0], "m", radius),
        "wheel_radius@right": ParameterResult(radius * right, radius * fit.stds[1], "m", radius),
        "track_width": ParameterResult(track * wide, track * fit.stds[2], "m", track),
    }


def _without_commands() -> tuple[Rejected, ...]:
    return tuple(
        Rejected(each, NO_COMMANDS) for each in ("motor.*", "friction.*", "actuation.*", "battery.*")
    )


def _curves(fit: _Fitted, before: Array, after: Array) -> tuple[Curve, ...]:
    """Distance from the reference along the unseen runs, put one behind the other."""
    times, curves, offset = [], [], 0.0
    for each in fit.unseen:
        pair = [np.hypot(*_differences(factors, fit.robot, each)[:, :2].T) for factors in (before, after)]
        times.append(offset + each.t - each.t[0])
        curves.append(np.column_stack(pair))
        offset += float(each.t[-1] - each.t[0])
    table = np.concatenate(curves)
    return (
        Curve(
            "distance from the reference", "m", np.concatenate(times), np.zeros(len(table)), table[:, 0],
            table[:, 1],
        ),
    )  # fmt: skip


def _cannot_tell(reason: str, runs: Sequence[Manoeuvre], robot: RobotConfig, begin: float) -> Diagnosis:
    rejected = tuple(
        Rejected(each, f"not identifiable: {reason}")
        for each in ("drive.wheel_radius", "drive.track_width", "imu.gyro_scale")
    )
    channels: tuple[ChannelResult, ...] = ()
    if all(each.truth is not None for each in runs):
        nominal = _Fitted(robot, np.ones(3), np.zeros(3), runs, runs).errors(np.ones(3))
        channels = (
            ChannelResult(POSITION, "m", nominal.position, nominal.position, nominal.position, 0.0),
            ChannelResult(HEADING, "rad", nominal.heading, nominal.heading, nominal.heading, 0.0),
        )
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        channels,
        (),
        (*rejected, *_without_commands()),
        Unexplained(1.0),
        (MANOEUVRES["turns"],),
        time.perf_counter() - begin,
        None,
        (reason,),
    )
