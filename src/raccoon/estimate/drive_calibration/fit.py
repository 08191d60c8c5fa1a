"""Fit the drive's geometry to recorded manoeuvres: both wheels' way a tick, and the track width.

The unknowns are three factors on the configured values: left way, right way, track width. Against motion
capture the whole driven path is fitted (position and heading); with a gyro, its turns over stretches of a
second or two, and the taped pieces. Deviations come from leaving out one recording (or a fifth of a single
one) at a time: neighbouring samples of a path are anything but independent, so the fit's own covariance
would promise too much.

Wheel radius and radians a tick only ever show as their product, way a tick. It is reported both ways: as
radians a tick at the configured radius, which is what robot.toml keeps, and as wheel radii at the
configured ticks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from raccoon.core.config import DriveModel, Measured, MotorConfig, NominalModel, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre
from raccoon.model.bemf import counts_scale

LEAST_TURN = math.radians(90.0)
LEAST_SHARE = 0.2
"""Share of the turning that the rarer direction needs."""
LEAST_WAY = 0.3
MOST_DEVIATION = 0.05
"""A factor whose relative deviation is larger is not determined."""
PLACE_STD, HEADING_STD = 0.01, math.radians(1.0)
"""m and rad, what an integrated path is expected to be off by: weights of the fit."""
STRETCH = 1.5
"""s of a stretch whose turn is compared with the gyro's."""
BOTH_WAYS = (
    "drive a square of about 0.6 m once to the left and once to the right, or eight quarter turns each way, "
    "with one side measured by tape"
)


@dataclass(frozen=True, slots=True)
class DriveCalibration:
    """The drive as fitted. Every value with its standard deviation.

    left, right: radians per tick. track_width: m. left_radius, right_radius: m, the same finding as wheel
    radii.
    left_offset, right_offset: back-EMF counts at rest, None where there was no rest with back-EMF.
    error_before, error_after: root mean square of the fitted residuals over their weights, before and after.
    """

    left: Measured
    right: Measured
    track_width: Measured
    left_radius: Measured
    right_radius: Measured
    left_offset: Measured | None
    right_offset: Measured | None
    error_before: float
    error_after: float

    def entries(self, robot: RobotConfig) -> Mapping[str, Measured]:
        """The values by their key in robot.toml."""
        found = {"model.drive.track_width": self.track_width}
        for port, ticks, offset in self._by_port(robot):
            found[f"motor.{port}.radians_per_tick"] = ticks
            if offset is not None:
                found[f"motor.{port}.bemf_offset"] = offset
        return found

    def applied(self, robot: RobotConfig) -> RobotConfig:
        """The robot with this calibration in place of its own."""
        motors = dict(robot.motors)
        for port, ticks, offset in self._by_port(robot):
            motor = motors.get(port, MotorConfig())
            offset = motor.bemf_offset if offset is None else offset
            motors[port] = replace(motor, radians_per_tick=ticks, bemf_offset=offset)
        drive: DriveModel = replace(robot.model.drive, track_width=self.track_width)
        model: NominalModel = replace(robot.model, drive=drive)
        return replace(robot, motors=motors, model=model)

    def _by_port(self, robot: RobotConfig) -> tuple[tuple[int, Measured, Measured | None], ...]:
        return (
            (robot.drive.left, self.left, self.left_offset),
            (robot.drive.right, self.right, self.right_offset),
        )


def calibrate_drive(
    robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], *, device: Device = SI_WORDS
) -> DriveCalibration:
    """Fit the drive to one or more recordings.

    Raises CalibrationError where the recordings cannot tell: one turning direction only, no length by tape
    or motion capture, no turn by gyro or motion capture, or a value that stays undetermined. It says which
    manoeuvre would do.
    """
    if not manoeuvres:
        raise CalibrationError("no recording was given")
    _check_lengths(robot, manoeuvres)
    _check_turns(manoeuvres)
    factors, before, after = _fitted(robot, manoeuvres)
    deviations = _left_out(robot, manoeuvres, factors)
    for name, deviation in zip(("left wheel", "right wheel", "track width"), deviations, strict=True):
        if not deviation <= MOST_DEVIATION:
            raise CalibrationError(
                f"{name}: these recordings tell it to {100 * deviation:.1f} % only (5 % are allowed): "
                f"{BOTH_WAYS}"
            )
    voltages = [each.battery_voltage for each in manoeuvres if each.battery_voltage is not None]
    voltage = float(np.mean(voltages)) if voltages else None
    return _result(robot, device, manoeuvres, factors, deviations, voltage, (before, after))


def _result(
    robot: RobotConfig,
    device: Device,
    manoeuvres: Sequence[Manoeuvre],
    factors: Array,
    deviations: Array,
    voltage: float | None,
    errors: tuple[float, float],
) -> DriveCalibration:
    def times(value: float, place: int) -> Measured:
        factor = float(factors[place])
        return Measured(value * factor, value * float(deviations[place]), battery_voltage=voltage)

    drive = robot.model.drive
    ticks = [counts_scale(robot, side, device) * device.position_counts_seconds for side in ("left", "right")]
    offsets = [_offset(manoeuvres, side, voltage) for side in (0, 1)]
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


def _offset(manoeuvres: Sequence[Manoeuvre], side: int, voltage: float | None) -> Measured | None:
    """Resting back-EMF of a side, the recordings weighted by what each knows."""
    known = [each.offsets[side] for each in manoeuvres]
    pairs = [each for each in known if each is not None]
    if not pairs:
        return None
    weights = [1.0 / std**2 for _, std in pairs]
    mean = sum(w * value for w, (value, _) in zip(weights, pairs, strict=True)) / sum(weights)
    return Measured(mean, math.sqrt(1.0 / sum(weights)), battery_voltage=voltage)


def _check_lengths(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre]) -> None:
    if not any(each.truth is not None or each.taped for each in manoeuvres):
        raise CalibrationError(
            "no length is known: give the taped distance of a straight piece, or truth.x and truth.y"
        )
    radius = robot.model.drive.wheel_radius.value
    way = sum(float(np.abs(np.diff(each.left + each.right)).sum()) for each in manoeuvres) * 0.5 * radius
    if way < LEAST_WAY:
        raise CalibrationError(f"the wheels went {way:.2f} m: at least {LEAST_WAY} m are needed")


def _check_turns(manoeuvres: Sequence[Manoeuvre]) -> None:
    """Both turning directions: with one alone, track width and the wheels' ratio look the same."""
    headings = [each.heading for each in manoeuvres]
    if not all(heading is not None for heading in headings):
        raise CalibrationError(
            "no turn is known: a recording has neither truth.heading nor a gyro with 1 s of rest before it"
        )
    turns = np.concatenate([np.diff(_smooth(heading)) for heading in headings if heading is not None])
    left, right = float(turns[turns > 0].sum()), float(np.abs(turns[turns < 0]).sum())
    if min(left, right) < max(LEAST_TURN, LEAST_SHARE * max(left, right)):
        raise CalibrationError(
            f"the robot turned {math.degrees(left):.0f} degrees left and {math.degrees(right):.0f} right: "
            f"with one turning direction, track width and unequal wheels look the same; {BOTH_WAYS}"
        )


def _smooth(heading: Array) -> Array:
    """A heading without jitter: only turns of more than 2 degrees one way count."""
    kept = [float(heading[0])]
    for value in heading:
        if abs(value - kept[-1]) > math.radians(2.0):
            kept.append(float(value))
    return np.array(kept)


def path(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """x, y, heading (n, 3) that the wheels of a manoeuvre make, from 0."""
    drive = robot.model.drive
    left = factors[0] * drive.wheel_radius.value * np.diff(each.left)
    right = factors[1] * drive.wheel_radius.value * np.diff(each.right)
    turn = (right - left) / (factors[2] * drive.track_width.value)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    middle = heading[:-1] + 0.5 * turn
    way = 0.5 * (left + right)
    x = np.concatenate([[0.0], np.cumsum(way * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(way * np.sin(middle))])
    return np.column_stack([x, y, heading])


def _residuals(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    parts = []
    if each.truth is not None:
        errors = off_truth(factors, robot, each) / (PLACE_STD, PLACE_STD, HEADING_STD)
        parts.append(errors[1:].ravel() / math.sqrt(max(len(errors), 1)))
    elif each.gyro is not None:
        parts.append(_gyro_residuals(factors, robot, each, each.gyro))
    driven = path(factors, robot, each)
    for taped in each.taped:
        begin, end = np.searchsorted(each.t, [taped.begin, taped.end]).clip(0, len(each.t) - 1)
        chord = math.dist(driven[begin, :2], driven[end, :2])
        parts.append(np.array([(chord - abs(taped.distance)) / taped.std]))
    return np.concatenate(parts)


def off_truth(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Path minus truth, x, y, heading, in its known rows (k, 3); the first of them is where it starts.

    Raises CalibrationError for a manoeuvre without truth.
    """
    if each.truth is None:
        raise CalibrationError("a recording has no truth.x, truth.y and truth.heading")
    truth, driven = each.truth[each.known], path(factors, robot, each)[each.known]
    if not len(truth):
        return truth
    turned, moved = truth[0, 2] - driven[0, 2], driven - driven[0]
    c, s = math.cos(turned), math.sin(turned)
    x = truth[0, 0] + c * moved[:, 0] - s * moved[:, 1]
    y = truth[0, 1] + s * moved[:, 0] + c * moved[:, 1]
    return np.column_stack([x, y, truth[0, 2] + moved[:, 2]]) - truth


def _gyro_residuals(factors: Array, robot: RobotConfig, each: Manoeuvre, gyro: Array) -> Array:
    """Turn by the wheels minus turn by the gyro, stretch by stretch."""
    times = np.arange(each.t[0], each.t[-1], STRETCH)
    ends = np.append(np.searchsorted(each.t, times), len(each.t) - 1)
    heading = path(factors, robot, each)[:, 2]
    turns: Array = (np.diff(heading[ends]) - np.diff(gyro[ends])) / HEADING_STD
    return turns


def _fitted(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre]) -> tuple[Array, float, float]:
    """Factors (3,) and the weighted error before and after."""
    from scipy.optimize import least_squares

    def residuals(factors: Array) -> Array:
        return np.concatenate([_residuals(factors, robot, each) for each in manoeuvres])

    start = np.ones(3)
    solution: Any = least_squares(residuals, start, bounds=(0.2, 5.0), x_scale=0.01, loss="soft_l1")
    before = float(np.sqrt(np.mean(residuals(start) ** 2)))
    after = float(np.sqrt(np.mean(residuals(solution.x) ** 2)))
    factors: Array = solution.x
    return factors, before, after


def _left_out(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], factors: Array) -> Array:
    """Relative deviations (3,) by the jackknife: how far the fit moves when one recording is left out.

    Each refit is one Gauss-Newton step from the whole fit, which is as good as a refit this near.
    """
    parts, kept = _parts(manoeuvres)
    normal = [_normal_equations(robot, part, factors) for part in parts]
    always = [_normal_equations(robot, part, factors) for part in kept]
    whole_A = np.sum([A for A, _ in normal + always], axis=0)
    whole_b = np.sum([b for _, b in normal + always], axis=0)
    moved = []
    for A, b in normal:
        rest = whole_A - A
        if np.linalg.cond(rest) > 1e10:
            return np.full(3, math.inf)
        moved.append(-np.linalg.solve(rest, whole_b - b))
    spread = np.array(moved) - np.mean(moved, axis=0)
    count = len(normal)
    common = np.zeros(3)  # what is wrong with all parts alike: the tape, and for the track the gyro's scale
    if not any(each.truth is not None for each in manoeuvres):
        tape = [taped.std / abs(taped.distance) for each in manoeuvres for taped in each.taped]
        scale = robot.model.imu.gyro_scale
        common += min(tape) / math.sqrt(len(tape))
        common[2] = math.hypot(common[2], scale.std / scale.value)
    deviations: Array = np.sqrt((count - 1) / count * (spread**2).sum(axis=0) + common**2)
    return deviations


def _normal_equations(robot: RobotConfig, part: Manoeuvre, factors: Array) -> tuple[Array, Array]:
    """J'J (3, 3) and J'r (3,) of a manoeuvre at these factors."""
    here, step = _residuals(factors, robot, part), 1e-5
    J = np.column_stack([(_residuals(factors + step * row, robot, part) - here) / step for row in np.eye(3)])
    return J.T @ J, J.T @ here


def _parts(manoeuvres: Sequence[Manoeuvre]) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    """What is left out in turn, a recording or a fifth of a single one, and what never is: its tape."""
    if len(manoeuvres) > 1:
        return list(manoeuvres), []
    whole = manoeuvres[0]
    edges = np.linspace(0, len(whole.t), 6).astype(int)
    pieces = [whole.piece(begin, end) for begin, end in pairwise(edges)]
    return pieces, [replace(whole, gyro=None, truth=None)] if whole.taped else []
