"""Implausible values in a diagnosis: hints at wrong units, a wrong time base, and commands that are
speeds."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import arrange_columns
from raccoon.diagnose.drives.speed_loop import SpeedLoop, find_speed_loop
from raccoon.diagnose.drives.units import only_free_driving
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.recordings.plausibility.rounded_commands import with_rounding_doubt
from raccoon.diagnose.result import (
    NO_DUTY,
    CauseResult,
    Diagnosis,
    Rejected,
    SensorFault,
    Unexplained,
    Verdict,
)
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.log_building import build_log
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class PlausibleRange:
    """Plausible range of a cause's parameter, as a factor on robot.toml's value, or as the value itself if
    robot.toml has 0. hint: what to check outside the range. parameter: its name."""

    low: float
    high: float
    hint: str
    parameter: str = "factor"


_CHECK_UNITS = "check the units, robot.toml (is it this robot's?) and what the commands' columns hold"
PLAUSIBLE_RANGES: Mapping[str, PlausibleRange] = {
    "motor.armature_resistance": PlausibleRange(
        0.5, 2.5, f"No motor's winding is that far off: {_CHECK_UNITS}."
    ),
    "motor.back_emf_constant": PlausibleRange(
        0.6, 1.6, f"No motor of one make is that far off: {_CHECK_UNITS}."
    ),
    "bemf.scale": PlausibleRange(0.75, 1.35, f"No controller reads that far off: {_CHECK_UNITS}."),
    "imu.gyro_scale": PlausibleRange(0.75, 1.35, f"No gyro reads that far off: {_CHECK_UNITS}."),
    "drive.wheel_radius": PlausibleRange(
        0.4, 2.5, "So much would be visible: measure it with a ruler before anything else."
    ),
    "drive.track_width": PlausibleRange(
        0.4, 2.5, "So much would be visible: measure it with a ruler before anything else."
    ),
    "drive.inertia": PlausibleRange(0.15, 5.0, f"No load makes that much of a difference: {_CHECK_UNITS}."),
    "friction.coulomb": PlausibleRange(
        0.2, 4.0, f"No gears and tyres have a friction that different: {_CHECK_UNITS}.", "torque"
    ),
    "friction.quadratic": PlausibleRange(
        0.0, 0.01, f"No wheel is braked that much: {_CHECK_UNITS}.", "coefficient"
    ),
    "actuation.deadband": PlausibleRange(
        0.0, 0.3, f"No motor driver has a deadband that large: {_CHECK_UNITS}.", "duty"
    ),
}
"""Plausible ranges by id of the cause. All unmeasured robots, with wheels from 21 to 50 mm and inertias from
4 to 60 g m2, are inside these ranges of the default robot.toml."""
TIME_PARAMETERS = {"drive.inertia": "factor", "bemf.filter_lag": "time_constant"}
"""Parameters that a time base that is too fast or too slow changes, by id of the cause."""
MIN_LOG_STRETCH, MAX_LOG_DIFFERENCE = 0.3, 0.25
"""Least logarithm of the factors of both parameters for a wrong time base, and largest logarithm of their
ratio."""
MIN_LOG_ROW_ERROR, MAX_LOG_ROW_DIFFERENCE, MAX_ROW_SIGMAS = 0.03, 0.02, 2.0
"""Logarithm of the ratio of a row to whole cycles above which the time may be wrong; largest difference from
it of the logarithm of a parameter's factor that it explains (a time 10 % off made a filter 1.102 to 1.106 and
0.897 times what it was); and the same in standard deviations, for a less certain parameter such as the
inertia."""
MAX_LOOP_FACTOR = 0.5
"""Factor of both motors' resistance (or of the inertia, which may stand in for it) below which a speed loop
drives the motors."""
LOOP_CAUSES = ("motor.armature_resistance", "drive.inertia")


def diagnose_speed_commands(
    columns: Columns, robot: RobotConfig, firmware: Firmware | None
) -> Diagnosis | None:
    """The diagnosis of commands that are clearly speeds; None for other commands. A search with the commands
    of a speed loop would take minutes and name nothing. Raises TraceError as `diagnose` does."""
    begin = time.perf_counter()
    loop = find_speed_loop(arrange_columns(columns, robot), robot)
    if loop is not None:
        loop = find_speed_loop(build_log([columns], robot, firmware), robot)
    if loop is None or not loop.clear:
        return None
    rejected = tuple(Rejected(id_, "") for id_ in dict.fromkeys(each.id for each in drive_causes()))
    found = Diagnosis(Verdict.UNKNOWN, (), (), rejected, Unexplained(0.0), (), time.perf_counter() - begin)
    return _with_speed_commands(found, robot, loop, is_certain=True)


def with_plausibility_hints(found: Diagnosis, columns: Columns, robot: RobotConfig) -> Diagnosis:
    """The diagnosis with hints at implausible values, or with the fault that the commands are no duties."""
    if found.verdict in (Verdict.ADEQUATE, Verdict.NOT_IDENTIFIABLE):
        return found
    is_too_quick = any(
        each.id in LOOP_CAUSES and each.where is None and _factor(each) < MAX_LOOP_FACTOR
        for each in found.causes
    )
    if is_too_quick or not found.causes:
        log = arrange_columns(columns, robot)
        loop = find_speed_loop(only_free_driving(log, robot), robot)
        if loop is not None:
            return _with_speed_commands(found, robot, loop, is_certain=is_too_quick or loop.clear)
    time_notes = _stretched_time_notes(found)
    found = replace(found, notes=(*found.notes, *time_notes)) if time_notes else found
    found = with_rounding_doubt(found, columns)
    row_error = _log_row_error(columns, robot)
    causes = tuple(_with_wrong_time_hint(_with_range_hint(each), row_error) for each in found.causes)
    if causes == found.causes:
        return found
    verdict = Verdict.PARTLY if found.verdict is Verdict.EXPLAINED else found.verdict
    return replace(found, causes=causes, verdict=verdict)


def _factor(cause: CauseResult, parameter: str = "factor") -> float:
    number = cause.parameters.get(parameter)
    return 1.0 if number is None else number.value / (number.nominal or 1.0)


def _stretched_time_notes(found: Diagnosis) -> tuple[str, ...]:
    """A note if all time constants are stretched by the same factor, as by a wrong t."""
    by_id = {each.id: each for each in found.causes if each.id in TIME_PARAMETERS and each.where is None}
    if len(by_id) < len(TIME_PARAMETERS):
        return ()
    inertia, lag = (_factor(by_id[id_], parameter) for id_, parameter in TIME_PARAMETERS.items())
    log_stretch = 0.5 * math.log(inertia * lag)
    if abs(log_stretch) < MIN_LOG_STRETCH or abs(math.log(inertia / lag)) > MAX_LOG_DIFFERENCE:
        return ()
    names = " and ".join(TIME_PARAMETERS)
    return (
        f"{names} are both about {math.exp(log_stretch):.2g} times what robot.toml says, as if t advanced "
        "too fast by that factor: compare the length of the recording with a watch before anything else",
    )


def _log_row_error(columns: Columns, robot: RobotConfig) -> float:
    """Logarithm of the ratio of a row's duration, by t, to the nearest whole number of controller cycles."""
    cycles = median_step(np.asarray(columns["t"], float)) * robot.controller.rate_hz
    return math.log(cycles / max(round(cycles), 1))


def _with_wrong_time_hint(cause: CauseResult, row_error: float) -> CauseResult:
    """The cause, with a hint at a wrong t if its time is stretched by the same factor as the rows."""
    parameter = TIME_PARAMETERS.get(cause.id)
    if parameter is None or cause.where is not None or abs(row_error) < MIN_LOG_ROW_ERROR:
        return cause
    number = cause.parameters[parameter]
    if abs(math.log(_factor(cause, parameter)) - row_error) > max(
        MAX_LOG_ROW_DIFFERENCE, MAX_ROW_SIGMAS * number.std / number.value
    ):
        return cause
    percent = 100.0 * abs(math.expm1(row_error))
    longer = "longer" if row_error > 0.0 else "shorter"
    return replace(
        cause,
        explanation=f"{cause.explanation} By t a row is also {percent:.0f} % {longer} than the controller's "
        "cycle, so more likely t is wrong by that much, or the controller's rate is not controller.rate_hz, "
        "and this number is right: compare the recording's length with a watch.",
    )


def _with_range_hint(cause: CauseResult) -> CauseResult:
    plausible = PLAUSIBLE_RANGES.get(cause.id)
    if (
        plausible is None
        or cause.is_negligible
        or plausible.low <= _factor(cause, plausible.parameter) <= plausible.high
    ):
        return cause
    return replace(cause, explanation=f"{cause.explanation} {plausible.hint}")


def _with_speed_commands(
    found: Diagnosis, robot: RobotConfig, loop: SpeedLoop, *, is_certain: bool
) -> Diagnosis:
    """The diagnosis of commands that the wheels follow as under a speed loop. If that is certain, all causes
    are withdrawn."""
    left, right = (f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right))
    holds = "hold a speed, not a duty" if is_certain else "seem to hold a speed, not a duty"
    text = (
        f"the columns {left} and {right} {holds}: a command of 1 keeps the wheels at {loop.counts:.0f} "
        f"counts of back-EMF, and friction takes {abs(loop.taken):.2f} V of that, not the {loop.usual:.2f} V "
        "that it takes under a duty. A controller that holds a speed does that (mav, move_at_velocity). "
        "Record the duty that it gives its motors, or drive by power (motor) for a diagnosis"
    )
    fault = SensorFault(left, NO_DUTY, text)
    if not is_certain:
        return replace(found, sensor_faults=(*found.sensor_faults, fault))
    names = [*(each.name for each in found.causes), *(each.id for each in found.rejected)]
    reason = f"not judged: {left} holds a speed, not a duty"
    return replace(
        found,
        verdict=Verdict.NOT_IDENTIFIABLE,
        causes=(),
        rejected=tuple(Rejected(each, reason) for each in names),
        unexplained=replace(found.unexplained, depends_on=()),
        suggested_manoeuvres=(),
        model=None,
        shapes=(),
        sensor_faults=(*found.sensor_faults, fault),
    )
