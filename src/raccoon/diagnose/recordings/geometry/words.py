"""What is said of a wheel's radius or the track width."""

from __future__ import annotations

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.hypotheses.coordinates import cause_name
from raccoon.diagnose.recordings.geometry.fit import Candidate, Errors
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult
from raccoon.sim.effects.parameters import SIDES

RULER = (
    "measure the wheels with a ruler: where they are as in robot.toml, it is the K_E that their counters go "
    "by, which raccoon calibrate drive takes into account and a recording with commands (motor.N.duty) shows"
)


def geometry_cause(
    without: Errors, part: Candidate, errors: tuple[Errors, Errors, Errors], rank: int, robot: RobotConfig
) -> CauseResult:
    """The cause with its sentence. without: errors where it alone is left out. errors: before, after and the
    floor.

    A counter of back-EMF whose ticks were not calibrated is worth what K_E says, so a wheel is not told from
    its motor.
    """
    before, after, floor = errors
    rivals = () if _is_known(part, robot) else (cause_name("motor.back_emf_constant", part.where),)
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
        0.5 if rivals else 0.99,
        rivals,
        _sentence(part, robot),
    )


def _is_known(part: Candidate, robot: RobotConfig) -> bool:
    """Whether the counters that tell of it were calibrated, or it is nothing of one wheel."""
    sides = SIDES if part.where is None else (part.where,)
    calibrated = all(robot.wheel_motor(side).radians_per_tick is not None for side in sides)
    return part.id != "drive.wheel_radius" or calibrated


def _sentence(part: Candidate, robot: RobotConfig) -> str:
    drive, percent = robot.model.drive, abs(part.factor - 1.0) * 100.0
    if part.id == "drive.track_width":
        more = "further apart" if part.factor > 1.0 else "closer together"
        value = f"track_width = {drive.track_width.value * part.factor:.5f} (m)"
        return (
            f"The wheels touch the floor {percent:.2f} % {more} than configured: put {value} into "
            "[model.drive] of robot.toml."
        )
    more = "larger" if part.factor > 1.0 else "smaller"
    wheels = "both wheels" if part.where is None else f"the {part.where} wheel"
    return f"The radius of {wheels} is {percent:.2f} % {more} than configured: {_todo(part, robot)}."


def _todo(part: Candidate, robot: RobotConfig) -> str:
    """robot.toml has one radius for both, and a scale for each: what goes by them needs their product."""
    if part.where is None:
        radius = robot.model.drive.wheel_radius.value * part.factor
        return f"put wheel_radius = {radius:.5f} (m) into [model.drive] of robot.toml"
    ticks, port = robot.wheel_motor(part.where).radians_per_tick, getattr(robot.drive, part.where)
    if ticks is None:
        return "calibrate its radians a tick (raccoon calibrate drive)"
    return f"put radians_per_tick = {ticks.value * part.factor:.6g} into [motor.{port}] of robot.toml"
