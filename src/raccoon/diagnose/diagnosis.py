"""From a recording to a diagnosis: the whole way in one place."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.features import Features
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.gain import HeldOut, held_out
from raccoon.diagnose.hypotheses import Cause, Settings, base_coordinates, neutral_settings
from raccoon.diagnose.log import WHEELS, Log, log_from_columns
from raccoon.diagnose.naming import named_causes, rejections, suggestions
from raccoon.diagnose.noise import white_noise, whiteness
from raccoon.diagnose.problem import Point, Problem, Whitener
from raccoon.diagnose.quality import brakes, check_units, moves
from raccoon.diagnose.result import ChannelResult, Curve, Diagnosis, Unexplained, Verdict
from raccoon.diagnose.rollout import Habits, PlantRollout, parameters_of
from raccoon.diagnose.select.outlook import Search, estimated
from raccoon.diagnose.select.search import pruned, search_causes
from raccoon.diagnose.unknown import PREFIX, probes_for
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

CHAINS = (Chain.firmware(), Chain())
LARGE_REST = 0.3
FAR_FROM_NOISE = 1.2
"""Error on unseen data, over what is expected of it, at which a model that nothing improves is wrong."""
FAR = 60.0
USUAL = 0.06
"""How much log misfit another filter than the firmware's must save."""
CLEAR = 25.0
"""Log evidence from which a cause stands whatever its error on unseen data, which one event can spoil."""
HARM = 0.9
"""Error on unseen data without a cause, over that with it, at which the cause is dropped."""
CLEARLY = 0.2
"""The same for motors that brake at duty 0, where both are possible."""
LATE = "actuation.latency"
LATENESS = (0.02, 0.5, 1.0, 1.7, 2.5, 3.5)


def diagnose(
    columns: Columns,
    robot: RobotConfig,
    *,
    holdout: Columns | None = None,
    causes: Sequence[Cause] | None = None,
    model: Parameters | None = None,
) -> Diagnosis:
    """Say what the simulation of `robot` gets wrong in a recording, and why.

    columns: the recording by names of the CSV format, NaN where a sensor had nothing new. robot: ports and
    nominal model; its standard deviations are how far each number may be off without being a cause. holdout:
    another recording of the same robot to judge on. causes: hypotheses to consider, by default the whole
    catalogue of drives; add your own with `hypotheses.Cause`. model: a simulation to start from, with effects
    that are already known, instead of the nominal one.

    Raises TraceError for a recording that cannot be used: empty, too short, time that does not advance,
    columns in wrong units, no commands, another robot's ports.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    begin = time.perf_counter()
    log = log_from_columns(columns, robot)
    check_units(log, robot)
    with threadpool_limits(
        1
    ):  # the matrices are small: threads that wait for each other cost more than they do
        if not moves(log):
            return _nothing_to_see(begin)
        problem, habits = problem_of(log, robot, tuple(drive_causes() if causes is None else causes), model)
        search = search_causes(problem, probes_for(problem))
        other = None
        if holdout is not None:
            other_log = log_from_columns(holdout, robot)
            check_units(other_log, robot)
            other = _problem(other_log, robot, tuple(problem.causes.values()), habits, model)
        search, judged = _proven(search, other)
        return _diagnosis(log, search, judged, habits, begin)


def _proven(search: Search, other: Problem | None) -> tuple[Search, HeldOut]:
    """The causes that stand on unseen data, and how they do there."""
    search = estimated(search)
    judged = held_out(search, other)
    while len(search.fit.point.active) > 1:
        weak = [name for name in search.fit.point.active if search.gains.get(name, CLEAR) < CLEAR]
        weak.sort(key=lambda name: judged.overall(judged.without[name]))
        if not weak or judged.overall(judged.without[weak[0]]) > HARM * judged.overall(judged.after):
            break
        search = estimated(pruned(search, weak[0]))
        judged = held_out(search, other)
    return search, judged


def _problem(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], habits: Habits, model: Parameters | None
) -> Problem:
    return Problem(
        Features.of(log),
        PlantRollout(log, robot, habits),
        robot,
        starting_settings(robot, model),
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

    Whether the controller filters with a median and brakes at duty 0 is not in a recording, and nothing a
    team could change: it is found out, not diagnosed. The firmware's filter is left only for a clearly
    better one. Wheels that stop at once may also be slow ones that rub: both are tried then.
    """
    habits = _habits(log, robot, causes, model)
    return _problem(log, robot, causes, habits, model), habits


def _habits(log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None) -> Habits:
    """Judged by the wheels: what the gyro does says nothing of the filter of back-EMF, and the battery only
    what the wheels were driven with."""
    wheels = replace(log, channels=tuple(each for each in log.channels if each.role != "gyro"))
    firmware, other = CHAINS
    choices = [Habits(firmware, False), *([Habits(firmware, True)] if brakes(log) else [])]
    if not any(each.role in WHEELS for each in log.channels):
        return choices[0]
    scores = [_habit_score(_problem(wheels, robot, causes, each, model)) for each in choices]
    best = 1 if len(scores) > 1 and scores[1] < scores[0] - CLEARLY else 0
    another = Habits(other, choices[best].brake)
    score = _habit_score(_problem(wheels, robot, causes, another, model))
    return another if score < scores[best] - USUAL else choices[best]


def _habit_score(problem: Problem) -> float:
    """Log misfit of the wheels with a latency, which resembles a slower filter, and all base numbers free.

    The filter's time constant is among them: kept near robot.toml, a robot with a shorter filter would seem
    to have another one.
    """
    loose = replace(problem, base=base_coordinates(problem.robot, inside=FAR))
    start = problem.nominal()
    if LATE in problem.causes:
        starts = [start.with_cause(LATE, np.array([u])) for u in LATENESS]
        errors = np.abs(problem.features.measured - problem.predict(starts)).mean(axis=1)
        start = starts[int(np.argmin((errors / errors.min(axis=0)).mean(axis=1)))]
    return _log_misfit(loose, start)


def _log_misfit(problem: Problem, start: Point) -> float:
    features = problem.features
    residual = features.measured - problem.predict([start])[0]
    scale = np.maximum(np.median(np.abs(np.diff(residual, axis=0)), axis=0), features.floors)
    noise = white_noise(scale, np.zeros(len(residual), np.intp))
    whitener = Whitener(noise, np.zeros((0, 0)), np.zeros(0), residual, np.zeros_like(residual))
    fit = fit_point(problem, whitener, start, 5)
    final = features.measured - problem.predict([fit.point])[0]
    size = np.maximum(np.std(features.measured, axis=0), features.floors)
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    return float(np.log(np.abs(final).mean(axis=0) / size)[wheels].mean())


def _nothing_to_see(begin: float) -> Diagnosis:
    note = "the commands never change, or no wheel answers them: drive, turn and stop while recording"
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        (),
        (),
        (),
        Unexplained(0.0),
        (note,),
        time.perf_counter() - begin,
        None,
        (note,),
    )


def _diagnosis(log: Log, search: Search, judged: HeldOut, habits: Habits, begin: float) -> Diagnosis:
    problem = search.problem
    causes = named_causes(search, judged)
    depends_on = tuple(each.removeprefix(PREFIX) for each in search.unknown)
    settings = problem.settings(search.fit.point)
    model = parameters_of(settings, neutral_settings(problem.robot), problem.robot, habits.chain)
    left = judged.left
    verdict = _verdict(bool(causes), bool(depends_on), left, judged.surprise)
    white = search.whitener(search.linear.residual[None])[0].reshape(search.linear.residual.shape)
    return Diagnosis(
        verdict,
        _channels(log, judged, whiteness(white)),
        causes,
        rejections(search, log),
        Unexplained(0.0 if verdict is Verdict.ADEQUATE else left, depends_on),
        suggestions(search, causes, log),
        time.perf_counter() - begin,
        replace(model, robot=replace(model.robot, motors=problem.robot.motors)),
        log.notes,
        curves=_curves(log, judged),
    )


def _curves(log: Log, judged: HeldOut) -> tuple[Curve, ...]:
    """Every channel on data that was not fitted, for pictures."""
    measured, (before, after) = judged.measured, judged.residual
    return tuple(
        Curve(
            each.name,
            each.unit,
            judged.time,
            measured[:, index],
            (measured - before)[:, index],
            (measured - after)[:, index],
        )
        for index, each in enumerate(log.channels)
    )


def _verdict(causes: bool, unknown: bool, left: float, surprise: float) -> Verdict:
    if unknown:
        return Verdict.PARTLY if causes else Verdict.UNKNOWN
    if not causes:
        return Verdict.ADEQUATE if surprise < FAR_FROM_NOISE else Verdict.UNKNOWN
    return Verdict.EXPLAINED if left < LARGE_REST else Verdict.PARTLY


def _channels(log: Log, judged: HeldOut, p_values: Array) -> tuple[ChannelResult, ...]:
    return tuple(
        ChannelResult(
            each.name,
            each.unit,
            float(judged.before[index]),
            float(judged.after[index]),
            float(judged.floor[index]),
            float(p_values[index]),
        )
        for index, each in enumerate(log.channels)
    )
