"""Searches that stand somewhere, for tests of what comes next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point
from raccoon.diagnose.fit.linear_model import gram_tables, linearise
from raccoon.diagnose.fit.noise_model import white_noise
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.habits.trials import HabitTrials, start_afresh
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.state import Search, linearise_search, start_search
from raccoon.diagnose.unknown.probes import make_probe_function


def searched(problem: Problem, truth: Point, named: Point, seed: int = 2) -> Search:
    """A search that has named something in a recording of the truth, with the noise of a seed."""
    features = problem.features
    noise = features.floors * np.random.default_rng(seed).normal(size=features.measured.shape)
    measured = problem.predict([truth])[0] + noise
    real = replace(problem, features=replace(features, measured=measured))
    start = start_search(real, make_probe_function(real))
    return linearise_search(real, start.probes, named, start.whitener)


def standing(
    columns: Mapping[str, np.ndarray],
    habits: Habits,
    named: Mapping[str, float | Sequence[float]],
    among: Sequence[str] = (),
) -> tuple[Search, HabitTrials]:
    """A search of a recording that has named these causes under these habits, fitted from these
    coordinates, and what asks for the recording under others. among: beginnings of the ids that are
    considered, by default all: a third of them take half of the time."""
    robot = RobotConfig()
    causes = [each for each in drive_causes() if not among or each.id.startswith((*among,))]
    log = log_from_columns(columns, robot)
    trials = HabitTrials(lambda each: drive_problem(log, robot, causes, each, None))
    start = start_afresh(trials.problem_of(habits))
    point = start.fit.point
    for name, size in named.items():
        point = point.with_cause(name, np.atleast_1d(size))
    fit = fit_point(start.problem, start.whitener, point)
    return linearise_search(start.problem, start.probes, fit.point, start.whitener), trials


def plain_whitener(problem: Problem) -> Whitener:
    """Noise without memory, of the readings' floors."""
    noise = white_noise(problem.features.floors, np.zeros(len(problem.features.time), np.intp))
    return Whitener.plain(noise, np.zeros_like(problem.features.measured))


def search_at(problem: Problem, point: Point) -> Search:
    whitener = plain_whitener(problem)
    linear = linearise(problem, point, [])
    table, plain = gram_tables(linear, [], whitener)
    return Search(
        problem, make_probe_function(problem), evaluate_fit(problem, whitener, point), whitener, linear,
        table,
        plain,
    )  # fmt: skip
