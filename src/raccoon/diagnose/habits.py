"""What the controller does with its samples and at duty 0: found out, not diagnosed.

Whether the controller filters with a median and brakes at duty 0 is not in a recording, and nothing a team
could change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.features import Features
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.hypotheses import (
    Cause,
    Settings,
    added,
    base_coordinates,
    multiplied,
    neutral_settings,
)
from raccoon.diagnose.log import WHEELS, Log
from raccoon.diagnose.lost import restored
from raccoon.diagnose.noise import white_noise
from raccoon.diagnose.problem import Point, Problem, Whitener
from raccoon.diagnose.quality import brakes
from raccoon.diagnose.rollout import Habits, PlantRollout
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters

CHAINS = (Chain.firmware(), Chain())
FAR = 60.0
USUAL = 0.06
"""How much log misfit another filter than the firmware's must save."""
CLEARLY = 0.2
"""The same for motors that brake at duty 0, where both are possible."""
STARTS = {"actuation.latency": (0.02, 0.5, 1.0, 1.7, 2.5, 3.5), "motor.current_limit": (0.1, 0.4, 0.6, 0.9)}
"""Coordinates of causes from which one of a fit for the habits starts; the first changes next to nothing."""
HIDING = (
    multiplied("bemf.scale", "left", 0.05),
    multiplied("bemf.scale", "right", 0.05),
    added("actuation.deadband", None, "duty", 0.03, low=0.0),
)
"""What no base number can stand in for. Without them deadbands made the simulator's filter look like the
firmware's in five of eight rehearsals, and a scale beside others the firmware's like the simulator's."""


def drive_problem(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], habits: Habits, model: Parameters | None
) -> Problem:
    """The problem of a drive under a controller's habits."""
    own = [each.own for each in causes if each.own is not None]
    settings = starting_settings(robot, model)
    for each in own:
        settings |= {(each.id, None, name): value for name, value in each.neutral().items()}
    return Problem(
        Features.of(log),
        PlantRollout(log, robot, habits, own=own),
        robot,
        settings,
        base_coordinates(robot),
        {each.name: each for each in causes},
    )


def starting_settings(robot: RobotConfig, model: Parameters | None) -> Settings:
    """The simulation's settings before any diagnosis; a model's inertias count from robot.toml's."""
    settings = neutral_settings(robot)
    if model is None:
        return settings
    for id_, place, name in settings:
        if id_ != "inertia":
            settings[(id_, place, name)] = model.value(id_, name, place)
    own, given = robot.model.drive, model.robot.model.drive
    straight = given.inertia_straight.value / own.inertia_straight.value
    settings[("inertia", None, "straight")] = straight
    settings[("inertia", None, "turn")] = given.inertia_turn.value / own.inertia_turn.value
    return settings


def problem_of(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None = None
) -> tuple[Problem, Habits]:
    """The problem under the controller's habits that fit the recording best after a base fit.

    The firmware's filter is left only for a clearly better one. Wheels that stop at once may also be slow
    ones that rub: both are tried then.
    """
    restored_log, habits = controller_of(log, robot, causes, model)
    return drive_problem(restored_log, robot, causes, habits, model), habits


def controller_of(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Log, Habits]:
    """The log with changes of commands whose rows it lost, and the controller's habits.

    Judged by the wheels: what the gyro does says nothing of the filter of back-EMF, and the battery only
    what the wheels were driven with.
    """
    wheels = replace(log, channels=tuple(each for each in log.channels if each.role != "gyro"))
    firmware, other = CHAINS
    choices = [Habits(firmware, False), *([Habits(firmware, True)] if brakes(log) else [])]
    if not any(each.role in WHEELS for each in log.channels):
        return log, choices[0]
    problems = [_loosened(drive_problem(wheels, robot, causes, each, model)) for each in choices]
    found = [_fitted(each, _start(each)) for each in problems]
    best = 1 if len(found) > 1 and found[1][0] < found[0][0] - CLEARLY else 0
    misfit, point = found[best]
    another = Habits(other, choices[best].brake)
    anothers, its = _fitted(_loosened(drive_problem(wheels, robot, causes, another, model)), point)
    habits, point = (another, its) if anothers < misfit - USUAL else (choices[best], point)

    def loose(each: Log) -> Problem:
        return _loosened(drive_problem(each, robot, causes, habits, model))

    return restored(log, loose, point), habits


def with_lost_changes(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    habits: Habits,
    model: Parameters | None,
    point: Point,
) -> Log:
    """The log with changes of commands in rows that it lost, when they suit the simulation of `point`."""
    return restored(log, lambda each: drive_problem(each, robot, causes, habits, model), point)


def another_chain(chain: Chain) -> Chain:
    """The one that a controller has if not this one."""
    return next(each for each in CHAINS if each != chain)


def _loosened(problem: Problem) -> Problem:
    """With all base numbers free, the filter's time constant among them: kept near robot.toml, a robot with a
    shorter filter would seem to have another one. And with what they cannot stand in for, whose error would
    hide what a filter does."""
    base = base_coordinates(problem.robot, inside=FAR)
    return replace(problem, base=(*base, *HIDING))


def _start(problem: Problem) -> Point:
    """Where to start a fit: with a latency, which resembles a slower filter, and a limit of the current."""
    start = problem.nominal()
    for name, sizes in STARTS.items():
        if name in problem.causes:
            starts = [start.with_cause(name, np.array([u])) for u in sizes]
            errors = np.abs(problem.features.measured - problem.predict(starts)).mean(axis=1)
            start = starts[int(np.argmin((errors / errors.min(axis=0)).mean(axis=1)))]
    return start


def _fitted(problem: Problem, start: Point) -> tuple[float, Point]:
    """Log misfit of the wheels where a fit arrives, and where that is."""
    features = problem.features
    residual = features.measured - problem.predict([start])[0]
    scale = np.maximum(np.median(np.abs(np.diff(residual, axis=0)), axis=0), features.floors)
    noise = white_noise(scale, np.zeros(len(residual), np.intp))
    whitener = Whitener(noise, np.zeros((0, 0)), np.zeros(0), residual, np.zeros_like(residual))
    fit = fit_point(problem, whitener, start, 5)
    final = features.measured - problem.predict([fit.point])[0]
    size = np.maximum(np.std(features.measured, axis=0), features.floors)
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    return float(np.log(np.abs(final).mean(axis=0) / size)[wheels].mean()), fit.point
