"""Searches that stand somewhere, for tests of what comes next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from raccoon.diagnose.problem import Point, Problem
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
