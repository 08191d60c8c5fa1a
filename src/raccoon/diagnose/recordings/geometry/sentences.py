"""Causes and their sentences for wheel radius and track width."""

from __future__ import annotations

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.hypotheses.coordinates import cause_name
from raccoon.diagnose.recordings.geometry.fit import Candidate, PoseErrors
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult
from raccoon.sim.effects.parameters import SIDES

MEASURE_WITH_RULER = (
    "measure the wheels with a ruler: if they are as in robot.toml, the K_E that scales their counters is "
    "wrong, which raccoon calibrate drive takes into account and a recording with commands (motor.N.duty) "
    "shows"
)


def geometry_cause(
    without: PoseErrors,
    candidate: Candidate,
    errors: tuple[PoseErrors, PoseErrors, PoseErrors],
    rank: int,
    robot: RobotConfig,
) -> CauseResult:
    """The cause with its sentence. without: errors if it alone is left out. errors: before, after, and noise
    floor.

    If ticks of a back-EMF counter were not calibrated, their worth depends on K_E, so a wheel's radius is not
    distinguishable from its motor's K_E.
    """
    before, after, floor = errors
    rivals = (
        ()
        if _is_told_from_motor(candidate, robot)
        else (cause_name("motor.back_emf_constant", candidate.where),)
    )
    removable = max(before.position - after.position, 1e-300)
    floor_m = max(floor.position, 1e-12)
    return CauseResult(
        candidate.id,
        candidate.where,
        rank,
        {"factor": ParameterResult(candidate.factor, candidate.std, "", 1.0)},
        Gain(
            without.position / floor_m,
            after.position / floor_m,
            float(np.clip((without.position - after.position) / removable, 0.0, 1.0)),
        ),
        0.5 if rivals else 0.99,
        rivals,
        _sentence(candidate, robot),
    )


def _is_told_from_motor(candidate: Candidate, robot: RobotConfig) -> bool:
    """Whether the candidate is distinguishable from K_E: it is no radius, or its wheels' counters were
    calibrated."""
    sides = SIDES if candidate.where is None else (candidate.where,)
    calibrated = all(robot.wheel_motor(side).radians_per_tick is not None for side in sides)
    return candidate.id != "drive.wheel_radius" or calibrated


def _sentence(candidate: Candidate, robot: RobotConfig) -> str:
    drive, percent = robot.model.drive, abs(candidate.factor - 1.0) * 100.0
    if candidate.id == "drive.track_width":
        more = "further apart" if candidate.factor > 1.0 else "closer together"
        value = f"track_width = {drive.track_width.value * candidate.factor:.5f} (m)"
        return (
            f"The wheels touch the floor {percent:.2f} % {more} than configured: put {value} into "
            "[model.drive] of robot.toml."
        )
    more = "larger" if candidate.factor > 1.0 else "smaller"
    wheels = "both wheels" if candidate.where is None else f"the {candidate.where} wheel"
    return f"The radius of {wheels} is {percent:.2f} % {more} than configured: {_advice(candidate, robot)}."


def _advice(candidate: Candidate, robot: RobotConfig) -> str:
    """Advice. robot.toml has one radius for both wheels and a scale for each; odometry needs their
    product."""
    if candidate.where is None:
        radius = robot.model.drive.wheel_radius.value * candidate.factor
        return f"put wheel_radius = {radius:.5f} (m) into [model.drive] of robot.toml"
    ticks, port = robot.wheel_motor(candidate.where).radians_per_tick, getattr(robot.drive, candidate.where)
    if ticks is None:
        return "calibrate its radians per tick (raccoon calibrate drive)"
    return f"put radians_per_tick = {ticks.value * candidate.factor:.6g} into [motor.{port}] of robot.toml"
