"""Fit of the drive's geometry to recorded manoeuvres: distance per tick of both wheels, and track width.

The unknowns are three factors on the configured values: left distance, right distance, track width. Against
motion capture the whole path is fitted (position and heading); with a gyro, its turns over stretches of a
second or two, and the taped pieces. Standard deviations come from leaving out one recording (or, of a few,
one of their eight or more parts) at a time: neighbouring samples of a path are strongly dependent, so the
fit's own covariance would be too small.

Wheel radius and radians per tick are observable only as their product, the distance per tick. It is given
both ways: as radians per tick at the configured radius, which robot.toml keeps, and as wheel radii at the
configured ticks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from raccoon.core.config import DriveModel, Measured, NominalModel, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre
from raccoon.estimate.drive_calibration.deviations import jackknife_deviations, split_into_parts
from raccoon.estimate.drive_calibration.motors import MotorsCalibration
from raccoon.estimate.drive_calibration.paths import residuals
from raccoon.estimate.drive_calibration.plausibility import check_plausible, describe_surprises
from raccoon.model.bemf import counts_scale

MIN_TURN = math.radians(90.0)
MIN_SHARE = 0.2
"""Least share of the rarer turning direction."""
MIN_WAY = 0.3
MAX_DEVIATION = 0.05
"""Bound on the relative standard deviation of a factor, above which it is undetermined."""
BOTH_WAYS = (
    "drive a square of about 0.6 m once to the left and once to the right, or eight quarter turns each way, "
    "with one side measured by tape"
)


@dataclass(frozen=True, slots=True)
class DriveCalibration(MotorsCalibration):
    """The fitted drive.

    track_width: m. left_radius, right_radius: m, the same result as wheel radii. error_before, error_after:
    root mean square of the weighted residuals before and after the fit. remarks: surprising results, in
    words.
    """

    track_width: Measured
    left_radius: Measured
    right_radius: Measured
    error_before: float
    error_after: float
    remarks: tuple[str, ...] = ()

    def entries(self, robot: RobotConfig) -> Mapping[str, Measured]:
        """The values by their keys in robot.toml."""
        return {"model.drive.track_width": self.track_width, **MotorsCalibration.entries(self, robot)}

    def applied(self, robot: RobotConfig) -> RobotConfig:
        """The robot with this calibration instead of its own."""
        drive: DriveModel = replace(robot.model.drive, track_width=self.track_width)
        model: NominalModel = replace(robot.model, drive=drive)
        return replace(MotorsCalibration.applied(self, robot), model=model)


def calibrate_drive(
    robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], *, device: Device = SI_WORDS
) -> DriveCalibration:
    """Fit the drive of this robot to one or more recordings.

    Raises CalibrationError as `fit_drive`, and for a value that is implausible for this robot.
    """
    found = fit_drive(robot, manoeuvres, device=device)
    for side, value in (("left", found.left), ("right", found.right)):
        check_plausible(robot, side, device, value, "the tape and its times, the reference")
    return replace(found, remarks=describe_surprises(robot, device, (found.left, found.right)))


def fit_drive(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], *, device: Device) -> DriveCalibration:
    """The same fit for a robot that may differ from robot.toml.

    Raises CalibrationError, naming a sufficient manoeuvre, if the recordings are not sufficient: one turning
    direction only, no length by tape or motion capture, no turn by gyro or motion capture, or an undetermined
    value.
    """
    if not manoeuvres:
        raise CalibrationError("no recording was given")
    _check_tapes(manoeuvres)
    _check_lengths(robot, manoeuvres)
    _check_turns(manoeuvres)
    # A long path keeps its early errors: a few recordings are fitted in the same pieces as in the jackknife.
    seen = all(each.truth is not None and not each.taped for each in manoeuvres)
    fitted = split_into_parts(manoeuvres)[0] if seen else manoeuvres
    factors, before, after = _fit_factors(robot, fitted)
    deviations = jackknife_deviations(robot, manoeuvres, factors, fitted)
    for name, deviation in zip(("left wheel", "right wheel", "track width"), deviations, strict=True):
        if not math.isfinite(deviation):
            raise CalibrationError(
                f"{name}: without a part of these recordings it is not determined at all, so its standard "
                f"deviation is unknown: {BOTH_WAYS}"
            )
        if deviation > MAX_DEVIATION:
            raise CalibrationError(
                f"{name}: these recordings determine it only to {100 * deviation:.1f} % (5 % are allowed): "
                f"{BOTH_WAYS}"
            )
    return _calibration_of_factors(robot, device, manoeuvres, factors, deviations, (before, after))


def _calibration_of_factors(
    robot: RobotConfig,
    device: Device,
    manoeuvres: Sequence[Manoeuvre],
    factors: Array,
    deviations: Array,
    errors: tuple[float, float],
) -> DriveCalibration:
    voltages = [each.battery_voltage for each in manoeuvres if each.battery_voltage is not None]
    voltage = float(np.mean(voltages)) if voltages else None

    def times(value: float, place: int) -> Measured:
        factor = float(factors[place])
        return Measured(value * factor, value * float(deviations[place]), battery_voltage=voltage)

    drive = robot.model.drive
    ticks = [counts_scale(robot, side, device) * device.position_counts_seconds for side in ("left", "right")]
    offsets = [_mean_offset(manoeuvres, side, voltage) for side in (0, 1)]
    return DriveCalibration(
        left=times(ticks[0], 0),
        right=times(ticks[1], 1),
        track_width=times(drive.track_width.value, 2),
        left_radius=times(drive.wheel_radius.value, 0),
        right_radius=times(drive.wheel_radius.value, 1),
        left_offset=offsets[0],
        right_offset=offsets[1],
        error_before=errors[0],
        error_after=errors[1],
    )


def _mean_offset(manoeuvres: Sequence[Manoeuvre], side: int, voltage: float | None) -> Measured | None:
    """Resting back-EMF of a side: the mean over recordings, weighted by their inverse variances."""
    known = [each.offsets[side] for each in manoeuvres]
    pairs = [each for each in known if each is not None]
    if not pairs:
        return None
    weights = [1.0 / std**2 for _, std in pairs]
    mean = sum(w * value for w, (value, _) in zip(weights, pairs, strict=True)) / sum(weights)
    return Measured(mean, math.sqrt(1.0 / sum(weights)), battery_voltage=voltage)


def _check_tapes(manoeuvres: Sequence[Manoeuvre]) -> None:
    for each in manoeuvres:
        for taped in each.taped:
            if not each.t[0] <= taped.begin < taped.end <= each.t[-1]:
                raise CalibrationError(
                    f"the piece taped from {taped.begin:g} to {taped.end:g} s is not in the recording, which "
                    f"is from {each.t[0]:.2f} to {each.t[-1]:.2f} s"
                )


def _check_lengths(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre]) -> None:
    if not any(each.truth is not None or each.taped for each in manoeuvres):
        raise CalibrationError(
            "no length is known: give the taped distance of a straight piece, or truth.x and truth.y"
        )
    radius = robot.model.drive.wheel_radius.value
    way = sum(float(np.abs(np.diff(each.left + each.right)).sum()) for each in manoeuvres) * 0.5 * radius
    if way < MIN_WAY:
        raise CalibrationError(f"the wheels went {way:.2f} m: at least {MIN_WAY} m are needed")


def _check_turns(manoeuvres: Sequence[Manoeuvre]) -> None:
    """Require both turning directions: with one, track width and the wheels' ratio are indistinguishable."""
    headings = [each.heading for each in manoeuvres]
    if not all(heading is not None for heading in headings):
        raise CalibrationError(
            "no turn is known: a recording has neither truth.heading nor a gyro with 1 s of rest before it"
        )
    turns = np.concatenate([np.diff(_without_jitter(heading)) for heading in headings if heading is not None])
    left, right = float(turns[turns > 0].sum()), float(np.abs(turns[turns < 0]).sum())
    if min(left, right) < max(MIN_TURN, MIN_SHARE * max(left, right)):
        raise CalibrationError(
            f"the robot turned {math.degrees(left):.0f} degrees left and {math.degrees(right):.0f} right: "
            f"with one turning direction, track width and unequal wheels look the same; {BOTH_WAYS}"
        )


def _without_jitter(heading: Array) -> Array:
    """The heading without jitter: only turns of more than 2 degrees in one direction count."""
    kept = [float(heading[0])]
    for value in heading:
        if abs(value - kept[-1]) > math.radians(2.0):
            kept.append(float(value))
    return np.array(kept)


def _fit_factors(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre]) -> tuple[Array, float, float]:
    """Factors (3,) and the weighted error before and after the fit."""
    from scipy.optimize import least_squares

    def off(factors: Array) -> Array:
        return np.concatenate([residuals(factors, robot, each) for each in manoeuvres])

    start = np.ones(3)
    solution: Any = least_squares(off, start, bounds=(0.05, 20.0), x_scale=0.01, loss="soft_l1")
    before = float(np.sqrt(np.mean(off(start) ** 2)))
    after = float(np.sqrt(np.mean(off(solution.x) ** 2)))
    factors: Array = solution.x
    return factors, before, after
