"""Numbers that no robot has, and what a recording holds instead of what its names promise."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import arranged
from raccoon.diagnose.drives.speed_loop import SpeedLoop, speed_loop
from raccoon.diagnose.drives.units import driven_freely
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.recordings.doubts.rounded import with_rounded
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
from raccoon.diagnose.rollout.log_building import understood
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Range:
    """What numbers are a robot's, and what to look for beyond: factors of robot.toml's number, or the number
    itself where that is 0 in it. parameter: of the cause."""

    low: float
    high: float
    doubt: str
    parameter: str = "factor"


_UNITS = "look at units, at robot.toml (is it this robot's?) and at what the column of the commands holds"
RANGES: Mapping[str, Range] = {
    "motor.armature_resistance": Range(0.5, 2.5, f"No motor's winding is that far off: {_UNITS}."),
    "motor.back_emf_constant": Range(0.6, 1.6, f"No motor of one make is that far off: {_UNITS}."),
    "bemf.scale": Range(0.75, 1.35, f"No controller reads that far off: {_UNITS}."),
    "imu.gyro_scale": Range(0.75, 1.35, f"No gyro reads that far off: {_UNITS}."),
    "drive.wheel_radius": Range(0.4, 2.5, "That shows to the eye: measure it with a ruler before all else."),
    "drive.track_width": Range(0.4, 2.5, "That shows to the eye: measure it with a ruler before all else."),
    "drive.inertia": Range(0.15, 5.0, f"No load makes that much of a difference: {_UNITS}."),
    "friction.coulomb": Range(0.2, 4.0, f"No gears and tyres rub that differently: {_UNITS}.", "torque"),
    "friction.quadratic": Range(0.0, 0.01, f"No wheel is braked that much: {_UNITS}.", "coefficient"),
    "actuation.deadband": Range(0.0, 0.3, f"No driver swallows that much: {_UNITS}.", "duty"),
}
"""By id. Of robots that nobody has measured, from 21 mm wheels to 50 mm and from 4 to 60 g m2, none is beyond
what the default robot.toml has."""
SLOW = {"drive.inertia": "factor", "bemf.filter_lag": "time_constant"}
"""What a time that is too fast or too slow makes of a robot."""
STRETCHED, ALIKE = 0.3, 0.25
"""Logarithms: of how far both must be off for that, and by which they may differ."""
ROWS_OFF, AS_ROWS, AS_SURE = 0.03, 0.02, 2.0
"""Logarithms: of how far rows must be from whole cycles, and by how much more or less a filter may be off to
be so by the same factor (a time 10 % off made it 1.102 to 1.106 and 0.897 times what it was); and deviations
by which one that is less sure may be, as an inertia."""
TOO_LOW = 0.5
"""Factor of both motors' resistance (or inertia, which may stand in its place) below which a loop drives."""
QUICK = ("motor.armature_resistance", "drive.inertia")


def speeds_told(columns: Columns, robot: RobotConfig, firmware: Firmware | None) -> Diagnosis | None:
    """What is said of commands that are clearly speeds, None of others. Over a loop's commands a search takes
    minutes, and names nothing. Raises TraceError as `diagnose`."""
    begin = time.perf_counter()
    loop = speed_loop(arranged(columns, robot), robot)
    if loop is not None:
        loop = speed_loop(understood([columns], robot, firmware), robot)
    if loop is None or not loop.clear:
        return None
    asked = tuple(Rejected(id_, "") for id_ in dict.fromkeys(each.id for each in drive_causes()))
    found = Diagnosis(Verdict.UNKNOWN, (), (), asked, Unexplained(0.0), (), time.perf_counter() - begin)
    return _no_duty(found, robot, loop, sure=True)


def with_doubts(found: Diagnosis, columns: Columns, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that says where a number is none that a robot has, or that the commands are no duty."""
    if found.verdict in (Verdict.ADEQUATE, Verdict.NOT_IDENTIFIABLE):
        return found
    quick = any(each.id in QUICK and each.where is None and _factor(each) < TOO_LOW for each in found.causes)
    if quick or not found.causes:
        log = arranged(columns, robot)
        loop = speed_loop(driven_freely(log, robot), robot)
        if loop is not None:
            return _no_duty(found, robot, loop, sure=quick or loop.clear)
    slow = _slow_time(found)
    found = replace(found, notes=(*found.notes, *slow)) if slow else found
    found = with_rounded(found, columns)
    off = _rows_off(columns, robot)
    causes = tuple(_by_wrong_time(_doubted(each), off) for each in found.causes)
    if causes == found.causes:
        return found
    verdict = Verdict.PARTLY if found.verdict is Verdict.EXPLAINED else found.verdict
    return replace(found, causes=causes, verdict=verdict)


def _factor(cause: CauseResult, parameter: str = "factor") -> float:
    number = cause.parameters.get(parameter)
    return 1.0 if number is None else number.value / (number.nominal or 1.0)


def _slow_time(found: Diagnosis) -> tuple[str, ...]:
    """That all that takes time takes as much longer, or less: so it does where t is wrong."""
    both = {each.id: each for each in found.causes if each.id in SLOW and each.where is None}
    if len(both) < len(SLOW):
        return ()
    inertia, lag = (_factor(both[id_], parameter) for id_, parameter in SLOW.items())
    off = 0.5 * math.log(inertia * lag)
    if abs(off) < STRETCHED or abs(math.log(inertia / lag)) > ALIKE:
        return ()
    names = " and ".join(SLOW)
    return (
        f"{names} are both about {math.exp(off):.2g} times what robot.toml says, as they are where t "
        "advances by as much too far: compare the length of the recording with a watch before anything else",
    )


def _rows_off(columns: Columns, robot: RobotConfig) -> float:
    """Logarithm of how much longer a row is by t than the whole cycles of the controller nearest to it."""
    cycles = usual_step(np.asarray(columns["t"], float)) * robot.controller.rate_hz
    return math.log(cycles / max(round(cycles), 1))


def _by_wrong_time(cause: CauseResult, off: float) -> CauseResult:
    """What takes time, and takes longer by as much as rows do: more likely t is wrong, and nothing else."""
    parameter = SLOW.get(cause.id)
    if parameter is None or cause.where is not None or abs(off) < ROWS_OFF:
        return cause
    number = cause.parameters[parameter]
    if abs(math.log(_factor(cause, parameter)) - off) > max(AS_ROWS, AS_SURE * number.std / number.value):
        return cause
    percent = 100.0 * abs(math.expm1(off))
    longer = "longer" if off > 0.0 else "shorter"
    return replace(
        cause,
        explanation=f"{cause.explanation} By t a row is {percent:.0f} % {longer} than the controller's cycle "
        "as well, so more likely t is wrong by that, or the controller has another rate than "
        "controller.rate_hz, and this is right: compare the recording's length with a watch.",
    )


def _doubted(cause: CauseResult) -> CauseResult:
    usual = RANGES.get(cause.id)
    if usual is None or cause.little or usual.low <= _factor(cause, usual.parameter) <= usual.high:
        return cause
    return replace(cause, explanation=f"{cause.explanation} {usual.doubt}")


def _no_duty(found: Diagnosis, robot: RobotConfig, loop: SpeedLoop, *, sure: bool) -> Diagnosis:
    """What is said of commands that are followed as a loop follows them. Nothing that was named holds
    then."""
    left, right = (f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right))
    holds = "hold a speed, not a duty" if sure else "seem to hold a speed, not a duty"
    text = (
        f"the columns {left} and {right} {holds}: the wheels keep {loop.counts:.0f} counts of back-EMF for "
        f"a command of 1, and friction takes {abs(loop.taken):.2f} V of that, not the {loop.usual:.2f} V "
        "that it takes of a motor under a duty; so does a controller that keeps a speed (mav, "
        "move_at_velocity). Record the duty that it gives its motors, or drive by power (motor) for a "
        "diagnosis"
    )
    fault = SensorFault(left, NO_DUTY, text)
    if not sure:
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
