"""Why recordings went wrong: `python benchmarks/diagnosis_misses.py diagnosis.jsonl`.

Takes a results file of benchmarks/diagnosis.py. Each recording of up to five causes that was not named
exactly is made and searched once more, and the causes that are really in it are fitted from their true
values, under the same noise and by the same measure that the search goes by:

* search: they are ahead of what was said, so the search should have found them;
* evidence: one of them adds less to the others than it needs to be named, so no search could name it;
* form: each of them is worth its gate, and yet what was said is ahead. The robot is not what this package's
  equations say, or chance made something else fit better.

Where fifteen causes or all are off at once, the question is how many of them could be named: all that act are
fitted from their true values, under the noise that a last fit has there, and those that are not worth their
gate beside the others are dropped, least worth first. Of the practically relevant ones, those that are left
could be named by whoever found the way there.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from diagnosis_cases import Case, make_recording
from diagnosis_table import found_causes, is_exactly_right, relevant_causes
from diagnosis_trial import diagnosed_columns, true_coordinate, true_settings
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point, fit_starts
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause, Coordinate, Settings
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.rivals import MIN_NET_LEAD, net_lead
from raccoon.diagnose.select.search import run_search
from raccoon.diagnose.select.state import Search, linearise_search, refit_with_final_noise, start_search
from raccoon.diagnose.unknown.probes import make_probe_function

if TYPE_CHECKING:
    from blind.generator import Blind

Array = NDArray[np.float64]
ROBOT = RobotConfig()
ASKED = ("single", "two", "several", "small", "contest", "loop", "short")
MANY = ("fifteen", "everything")
ACTING = 0.03
"""Change of the recording, in units of the noise, from which a cause takes part in the fit of all."""
STARTS = 24
ITERATIONS = 10
PRUNING = 5


def main() -> None:
    """A line for each recording, then how many of each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("--processes", type=int, default=1)
    args = parser.parse_args()
    lines = [json.loads(each) for each in args.results.read_text(encoding="utf-8").splitlines()]
    seed = next(each["seed"] for each in lines if "key" not in each)
    asked = [each for each in lines if each.get("row") in ASKED]
    keys = [each["key"] for each in asked if not is_exactly_right(each)]
    print(f"seed {seed}, {len(keys)} of {len(asked)} not named exactly", flush=True)
    counts: Counter[tuple[str, str]] = Counter()
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.processes, mp_context=spawn) as pool:
        for key, (why, told) in zip(keys, pool.map(_why, keys, [seed] * len(keys)), strict=True):
            counts[(key.partition("/")[0], why)] += 1
            print(f"{key:42s} {why:9s} {told}", flush=True)
        _print(counts, Counter(each["row"] for each in asked))
        for row in MANY:
            many = [each for each in lines if each.get("row") == row]
            found = list(pool.map(_worth_naming, many, [seed] * len(many)))
            relevant, could, named = (sum(each) for each in zip(*found, strict=True)) if found else (0, 0, 0)
            if relevant:
                share = f"{could} ({100 * could / relevant:.1f} %) could be named, {named} were"
                print(f"{row}: of {relevant} relevant causes {share}", flush=True)


def _why(key: str, seed: int) -> tuple[str, str]:
    """Which of the three, and the numbers behind it."""
    blind, search = _searched(key, seed)
    problem = search.problem
    said = fit_point(problem, search.whitener, search.fit.point, ITERATIONS)
    starts = _true_points(
        problem, [each.name for each in blind.hidden], true_settings(blind.robot), said.point
    )
    true = min(fit_starts(problem, search.whitener, starts, ITERATIONS), key=lambda fit: fit.cost)
    ahead = net_lead(search, true, said)
    weakest, spare, _ = _weakest(search, true, ITERATIONS)
    why = "search" if ahead > MIN_NET_LEAD else "evidence" if spare < 0.0 else "form"
    names = ", ".join(said.point.active) or "nothing"
    causes = ", ".join(true.point.active)
    told = f"{causes} against {names}: {ahead:+.1f}; {weakest} {spare:+.1f} from its gate"
    return why, told


def _searched(key: str, seed: int) -> tuple[Blind, Search]:
    """A recording, and what the search makes of it."""
    blind, search = _started(key, seed)
    return blind, run_search(search)


def _started(key: str, seed: int) -> tuple[Blind, Search]:
    case = Case.of(key)
    blind = make_recording(case, seed)
    problem = make_problem(log_from_columns(diagnosed_columns(case, blind), ROBOT), ROBOT, drive_causes())
    return blind, start_search(problem, make_probe_function(problem))


def _weakest(search: Search, fit: Fit, iterations: int) -> tuple[str, float, Fit]:
    """The cause that is least worth its gate, by how much it is, and the fit without it."""
    problem = search.problem
    found = []
    for name in fit.point.active:
        less = fit_point(problem, search.whitener, fit.point.without_cause(name), iterations)
        found.append((name, log_evidence_lead(problem, fit, less) - gate(name), less))
    return min(found, key=lambda each: each[1])


def _worth_naming(result: dict[str, Any], seed: int) -> tuple[int, int, int]:
    """How many causes of a recording are relevant, how many of them are worth their gate at the truth, and
    how many were named."""
    blind, search = _started(result["key"], seed)
    problem = search.problem
    acting = [
        name
        for name, size in result["alone"].items()
        if max(size, result["beside"][name]) > ACTING and name in problem.causes
    ]
    bare = Point(search.fit.point.base)
    starts = _true_points(problem, acting, true_settings(blind.robot), bare)[:2]
    near = min(fit_starts(problem, search.whitener, starts, ITERATIONS), key=lambda fit: fit.cost)
    search = refit_with_final_noise(linearise_search(problem, search.probes, near.point, search.whitener))
    fit = search.fit
    while fit.point.active:
        _, spare, less = _weakest(search, fit, PRUNING)
        if spare >= 0.0:
            break
        fit = less
    relevant = set(relevant_causes(result))
    return len(relevant), len(relevant & set(fit.point.active)), len(relevant & found_causes(result))


def _true_points(problem: Problem, names: Sequence[str], truth: Settings, said: Point) -> list[Point]:
    """Where the truth is, and where it was said to be. A cause whose coordinates are no plain numbers starts
    from its guesses instead."""
    causes = [problem.causes[each] for each in names]
    truth = _as_factor(truth) if "drive.inertia" in names else truth
    taken = {key for cause in causes for each in cause.coordinates for key in each.settings}
    base = [
        0.0
        if taken & set(each.settings)
        else float(np.clip(true_coordinate(each, truth, problem.neutral), -3.4, 3.4))
        for each in problem.base
    ]
    each_from = [_starts(each, truth, problem.neutral) for each in causes]
    for name, starts_of in zip(names, each_from, strict=True):
        if name in said.active:
            starts_of.append(said.active[name])
    starts = islice(product(*each_from), STARTS)
    return [Point(np.array(base), dict(zip(names, each, strict=True))) for each in starts]


def _as_factor(truth: Settings) -> Settings:
    """Both inertias, which are base numbers, as the one factor of the cause."""
    both = [("inertia", None, kind) for kind in ("straight", "turn")]
    factor = math.sqrt(math.prod(truth[each] for each in both))
    return {**truth, ("drive.inertia", None, "factor"): factor} | {
        each: truth[each] / factor for each in both
    }


def _starts(cause: Cause, truth: Settings, neutral: Settings) -> list[Array]:
    if cause.joint is None and all(each.settings for each in cause.coordinates):
        return [np.array([true_coordinate(each, truth, neutral) for each in cause.coordinates])]
    shaped = [_of_shape(cause, each, truth) for each in cause.coordinates]
    if all(each is not None for each in shaped):
        return [np.array(shaped, float)]
    guesses = [np.array(u) for variant in cause.variants for u in variant]
    return guesses if cause.one_sided else [*guesses, *(-each for each in guesses)]


def _of_shape(cause: Cause, coordinate: Coordinate, truth: Settings) -> float | None:
    """The coordinate of a strength, or of a shape, which is counted in its logarithm; None for others."""
    if coordinate.settings or coordinate.value(1.0) == 1.0:
        return None
    name = coordinate.name.rpartition(".")[2]
    value = next(
        truth[key] for key in truth if key[0] == cause.id and key[2] == name and cause.where in (None, key[1])
    )
    zero = coordinate.value(0.0)
    if zero == 0.0:
        return value / coordinate.value(1.0)
    return math.log(max(value, 1e-9) / zero) / math.log(coordinate.value(1.0) / zero)


def _print(counts: Counter[tuple[str, str]], asked: dict[Any, int]) -> None:
    kinds = ("search", "evidence", "form")
    print("\n| row | recordings | not exactly | " + " | ".join(kinds) + " |\n|---|---|---|---|---|---|")
    for row in (each for each in ASKED if each in asked):
        found = [counts[(row, kind)] for kind in kinds]
        print(f"| {row} | {asked[row]} | {sum(found)} | " + " | ".join(map(str, found)) + " |")


if __name__ == "__main__":
    main()
