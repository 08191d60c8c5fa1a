"""The diagnosis of the geometry from wheel angles and a reference of the pose (motion capture), without
commands."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.findings.fitted_model import with_causes
from raccoon.diagnose.hypotheses.cause_catalogue import TURN_SCALE_CAUSES
from raccoon.diagnose.recordings.channels.review import wrong_robot_notes
from raccoon.diagnose.recordings.geometry.checks import check_wheels, without_spikes
from raccoon.diagnose.recordings.geometry.fit import (
    GeometryFit,
    PoseErrors,
    candidates,
    combine_factors,
    describe_departure,
)
from raccoon.diagnose.recordings.geometry.sentences import MEASURE_WITH_RULER, geometry_cause
from raccoon.diagnose.recordings.reference.units import check_reference
from raccoon.diagnose.reports.manoeuvre_text import MANOEUVRES
from raccoon.diagnose.result import (
    ChannelResult,
    Curve,
    Diagnosis,
    ParameterResult,
    Rejected,
    SensorFault,
    Unexplained,
    Verdict,
)
from raccoon.estimate.drive_calibration.columns import Manoeuvre, manoeuvre_from_columns
from raccoon.estimate.drive_calibration.fit import fit_drive
from raccoon.estimate.drive_calibration.paths import truth_residuals
from raccoon.sim.effects.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MIN_GAIN = 0.03
"""Least relative reduction of the held-out error by a named cause."""
MAX_ERROR_RATIO = 3.0
"""Ratio of the held-out error to that of the fitted runs above which no size of wheels explains it."""
MAX_FACTOR = 2.5
"""Largest factor on wheels and track, as in a drive with commands (`plausibility/implausible.py`)."""
FITTED_SHARE = 0.7
"""Share of a single run that is fitted; the rest is held out."""
MAX_STEP_S = 0.9
"""Longest row, s. Counters lose nothing between rows, so this only detects a time in milliseconds, which
advances by 1 or more."""
POSITION, HEADING = "truth position", "truth.heading"
WITHIN_STD = "within its standard deviation"
UNHELPFUL = "it does not improve the held-out runs"
NO_COMMANDS = "not identifiable: motor.N.duty is missing, so what drove the wheels is unknown"


def diagnose_geometry(
    runs: Sequence[Columns],
    robot: RobotConfig,
    *,
    holdout: Sequence[Columns] = (),
    device: Device = SI_WORDS,
) -> Diagnosis:
    """Compare dead reckoning with the reference, over one or several runs of the same robot.

    holdout: runs on which to judge; by default every second run, or the last 30 % of a single one. What turns
    in one direction alone or an unusable column do not determine is `not_identifiable`. Raises TraceError for
    a time or a reference in other units.
    """
    begin = time.perf_counter()
    try:
        prepared = [prepare_run(each, robot, device) for each in runs]
        prepared_holdout = [prepare_run(each, robot, device) for each in holdout]
    except CalibrationError as error:
        return _not_identifiable(str(error), [], robot, begin)
    fitted, heldout = _split_runs([each for each, _ in prepared], [each for each, _ in prepared_holdout])
    faults = tuple(fault for _, each in prepared for fault in each)
    try:
        calibrated = fit_drive(robot, fitted, device=device)
    except CalibrationError as error:
        return replace(_not_identifiable(str(error), fitted, robot, begin), sensor_faults=faults)
    radius, track = robot.model.drive.wheel_radius.value, robot.model.drive.track_width.value
    pairs = (
        (calibrated.left_radius, radius),
        (calibrated.right_radius, radius),
        (calibrated.track_width, track),
    )
    factors = np.array([number.value / nominal for number, nominal in pairs])
    stds = np.array([number.std / nominal for number, nominal in pairs])
    impossible = describe_impossible_factor(factors)
    if impossible:
        return _not_identifiable(impossible, fitted, robot, begin)
    return replace(_judge(GeometryFit(robot, factors, stds, fitted, heldout), begin), sensor_faults=faults)


def prepare_run(
    columns: Columns, robot: RobotConfig, device: Device = SI_WORDS
) -> tuple[Manoeuvre, tuple[SensorFault, ...]]:
    """A recording as a run that can be fitted, and the faults of single values that were left out.

    Raises CalibrationError that names an unusable column, and TraceError for a time or a reference in other
    units.
    """
    times = np.unique(np.asarray(columns["t"], float))  # duplicate samples are harmless here
    check_time(times[np.isfinite(times)], MAX_STEP_S)
    columns, faults = without_spikes(columns, robot, device)
    check_reference(columns, robot, device)
    run = manoeuvre_from_columns(columns, robot, device=device)
    check_wheels(run, robot)
    return run, faults


def describe_impossible_factor(factors: Array) -> str:
    """A note if a wheel or the track has a factor that is impossible for this robot.toml; "" otherwise.

    A reference that never moved, and counters in another unit, gave factors at the bounds of the fit, each
    with a probability of 0.99.
    """
    logs = np.abs(np.log(factors))
    worst = int(np.argmax(logs))
    if logs[worst] < math.log(MAX_FACTOR):
        return ""
    name = ("the left wheel", "the right wheel", "the track")[worst]
    return (
        f"by the reference {name} is {factors[worst]:.2g} times as large as in robot.toml, or more, which a "
        "ruler would show. Check radians_per_tick, the columns of the wheels, whether truth.x and truth.y "
        "are in metres and follow the robot, and whether robot.toml is this robot's"
    )


def _split_runs(
    runs: list[Manoeuvre], holdout_runs: list[Manoeuvre]
) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    if holdout_runs:
        return runs, holdout_runs
    if len(runs) > 1:
        return runs[::2], runs[1::2]
    count = len(runs[0].t)
    rows = runs[0].known_rows if runs[0].truth is not None else np.arange(count)
    split = int(rows[int(FITTED_SHARE * len(rows))])
    return [runs[0].piece(0, split)], [runs[0].piece(split, count)]


def _judge(fit: GeometryFit, begin: float) -> Diagnosis:
    nominal = np.ones(3)
    before = fit.errors(nominal)
    all_candidates = candidates(fit)
    named = [each for each in all_candidates if each.is_significant]
    after_factors = combine_factors(named)
    after = fit.errors(after_factors)
    causes, unhelpful = [], []
    for each in named:
        without = fit.errors(combine_factors([other for other in named if other is not each]))
        if after.position > (1.0 - MIN_GAIN) * without.position:
            unhelpful.append(each)
        else:
            causes.append((without, each))
    causes.sort(key=lambda pair: -pair[0].position)
    in_sample = replace(fit, heldout=fit.fitted)
    floor = in_sample.errors(fit.factors)
    results = tuple(
        geometry_cause(*pair, (before, after, floor), rank + 1, fit.robot) for rank, pair in enumerate(causes)
    )
    rejected = [
        Rejected(each.name, UNHELPFUL if each in unhelpful else WITHIN_STD)
        for each in all_candidates
        if each in unhelpful or not each.is_significant
    ]
    # A slightly wrong initial heading rotates the whole path, which is no departure from the wheels.
    shape_errors = [
        each.errors(factors, from_start=False)
        for each, factors in ((fit, after_factors), (in_sample, fit.factors))
    ]
    is_unexplained = shape_errors[0].position > MAX_ERROR_RATIO * shape_errors[1].position
    return Diagnosis(
        _verdict(bool(results), is_unexplained),
        _channels(before, after, floor),
        results,
        (*rejected, *_rejected_without_commands()),
        _unexplained(before, after, is_unexplained),
        (MEASURE_WITH_RULER,) if any(each.confounded_with for each in results) else (),
        time.perf_counter() - begin,
        with_causes(Parameters.from_robot(fit.robot), results),
        (
            _split_note(fit),
            *wrong_robot_notes(results),
            *([describe_departure(fit, after_factors)] if is_unexplained else []),
        ),
        _identified(fit),
        (),
        _curves(fit, nominal, after_factors),
    )


def _unexplained(before: PoseErrors, after: PoseErrors, is_unexplained: bool) -> Unexplained:
    """The unexplained rest, if it is more than chance and wheels explain."""
    if not is_unexplained:
        return Unexplained(0.0)
    share = after.position**2 / max(before.position**2, 1e-300)
    return Unexplained(float(np.clip(share, 0.0, 1.0)), ("time",))


def _verdict(has_causes: bool, is_unexplained: bool) -> Verdict:
    if is_unexplained:
        return Verdict.PARTLY if has_causes else Verdict.UNKNOWN
    return Verdict.EXPLAINED if has_causes else Verdict.ADEQUATE


def _split_note(fit: GeometryFit) -> str:
    fitted_count, heldout_count = len(fit.fitted), len(fit.heldout)
    if fitted_count == heldout_count == 1 and fit.fitted[0].t[-1] < fit.heldout[0].t[0]:
        return f"the first {100 * FITTED_SHARE:.0f} % of the run was fitted, the rest was held out"
    fitted = f"{fitted_count} run{'' if fitted_count == 1 else 's'}"
    heldout = f"{heldout_count} other{'' if heldout_count == 1 else 's'}"
    return f"{fitted} fitted, {heldout} held out"


def _channels(before: PoseErrors, after: PoseErrors, floor: PoseErrors) -> tuple[ChannelResult, ...]:
    return (
        ChannelResult(POSITION, "m", before.position, after.position, floor.position),
        ChannelResult(HEADING, "rad", before.heading, after.heading, floor.heading),
    )


def _identified(fit: GeometryFit) -> Mapping[str, ParameterResult]:
    drive = fit.robot.model.drive
    radius, track = drive.wheel_radius.value, drive.track_width.value
    left, right, wide = fit.factors
    return {
        "wheel_radius@left": ParameterResult(radius * left, radius * fit.stds[0], "m", radius),
        "wheel_radius@right": ParameterResult(radius * right, radius * fit.stds[1], "m", radius),
        "track_width": ParameterResult(track * wide, track * fit.stds[2], "m", track),
    }


def _rejected_without_commands() -> tuple[Rejected, ...]:
    return tuple(
        Rejected(each, NO_COMMANDS) for each in ("motor.*", "friction.*", "actuation.*", "battery.*")
    )


def _curves(fit: GeometryFit, before: Array, after: Array) -> tuple[Curve, ...]:
    """Distance from the reference along the held-out runs in sequence, m."""
    times, curves, offset = [], [], 0.0
    for each in fit.heldout:
        pair = [np.hypot(*truth_residuals(factors, fit.robot, each)[:, :2].T) for factors in (before, after)]
        times.append(offset + each.t[each.known_rows] - each.t[0])
        curves.append(np.column_stack(pair))
        offset += float(each.t[-1] - each.t[0])
    table = np.concatenate(curves)
    return (
        Curve(
            "distance from the reference", "m", np.concatenate(times), np.zeros(len(table)), table[:, 0],
            table[:, 1],
        ),
    )  # fmt: skip


def _not_identifiable(reason: str, runs: Sequence[Manoeuvre], robot: RobotConfig, begin: float) -> Diagnosis:
    rejected = tuple(Rejected(each, f"not identifiable: {reason}") for each in TURN_SCALE_CAUSES)
    channels: tuple[ChannelResult, ...] = ()
    if runs and all(each.truth is not None for each in runs):
        nominal = GeometryFit(robot, np.ones(3), np.zeros(3), runs, runs).errors(np.ones(3))
        channels = _channels(nominal, nominal, nominal)
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        channels,
        (),
        (*rejected, *_rejected_without_commands()),
        Unexplained(0.0),
        (MANOEUVRES["turns"],),
        time.perf_counter() - begin,
        None,
        (reason,),
    )
