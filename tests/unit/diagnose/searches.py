"""Searches that stand somewhere, for tests of what comes next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from raccoon.diagnose.fit import fit_at
from raccoon.diagnose.linear import linearise, tabulate
from raccoon.diagnose.noise import white_noise
from raccoon.diagnose.problem import Point, Problem, Whitener
from raccoon.diagnose.select.outlook import Search, look_around, start_search
from raccoon.diagnose.unknown import probes_for


def searched(problem: Problem, truth: Point, named: Point, seed: int = 2) -> Search:
    """A search that has named something in a recording of the truth, with the noise of a seed."""
    features = problem.features
    noise = features.floors * np.random.default_rng(seed).normal(size=features.measured.shape)
    measured = problem.predict([truth])[0] + noise
    real = replace(problem, features=replace(features, measured=measured))
    start = start_search(real, probes_for(real))
    return look_around(real, start.probes, named, start.whitener)


def plain_whitener(problem: Problem) -> Whitener:
    """Noise without memory, of the readings' floors."""
    noise = white_noise(problem.features.floors, np.zeros(len(problem.features.time), np.intp))
    still = np.zeros_like(problem.features.measured)
    return Whitener(noise, np.zeros((0, 0)), np.zeros(0), still, still)


def search_at(problem: Problem, point: Point) -> Search:
    whitener = plain_whitener(problem)
    linear = linearise(problem, point, [])
    table, plain = tabulate(linear, [], whitener, len(problem.base))
    return Search(
        problem, probes_for(problem), fit_at(problem, whitener, point), whitener, linear, table, plain
    )  # fmt: skip
