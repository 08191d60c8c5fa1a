"""How honest the diagnosis is about noise: `python benchmarks/diagnosis_noise.py --robots 20`.

Robots of the independent plant in tests/blind that are as robot.toml says, within its standard deviations.
Prints by how many of its calculated deviations each fitted number is off (root mean square; 1 is honest), the
largest log evidence that any cause and any probe gets on them, and the error on unseen data over what was
expected. Seeds are fresh in every run, and printed, unless one is given.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

import diagnosis_cases  # noqa: F401  puts tests/blind on the path
from blind.generator import make
from diagnosis_trial import true_coordinate, true_settings
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.findings.held_out import evaluate_held_out
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import FLOOR_GATE, gate
from raccoon.diagnose.select.probe_scores import find_best_probe
from raccoon.diagnose.select.refits import refit_candidates
from raccoon.diagnose.select.state import Search, refit_with_final_noise, start_search
from raccoon.diagnose.unknown.probes import make_probe_function

Array = NDArray[np.float64]
ROBOT = RobotConfig()


def main() -> None:
    """Every robot, then the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}, {args.robots} robots", flush=True)
    rng = np.random.default_rng(seed)
    off: list[dict[str, tuple[float, float]]] = []
    leads: dict[str, list[float]] = {"any cause": [], "what a floor imitates": [], "probe": [], "error": []}
    for _ in range(args.robots):
        blind = make(int(rng.integers(2**31)), seconds=40.0)
        problem = make_problem(log_from_columns(blind.columns, ROBOT), ROBOT, drive_causes())
        search = start_search(problem, make_probe_function(problem))
        for name, value in _leads(search).items():
            leads[name].append(value)
        last = refit_with_final_noise(search)
        off.append(_deviations(last, true_settings(blind.robot)))
        leads["error"].append(evaluate_held_out(last, None).error_ratio)
    _print(off, leads)


def _leads(search: Search) -> dict[str, float]:
    """The largest lead of causes with the usual gate, of those with the floor's, and of probes."""
    found = {"any cause": 0.0, "what a floor imitates": 0.0, "probe": find_best_probe(search).lead}
    for name, fit in refit_candidates(search):
        kind = "what a floor imitates" if gate(name) >= FLOOR_GATE else "any cause"
        found[kind] = max(found[kind], log_evidence_lead(search.problem, fit, search.fit))
    return found


def _deviations(search: Search, truth: Settings) -> dict[str, tuple[float, float]]:
    """How far each number is off: in its calculated deviations, and in robot.toml's."""
    fit, problem = search.fit, search.problem
    deviation = np.sqrt(np.diag(np.linalg.inv(np.eye(len(fit.jacobian)) + fit.jacobian @ fit.jacobian.T)))
    found = {}
    for index, coordinate in enumerate(problem.base):
        wrong = float(fit.point.base[index]) - true_coordinate(coordinate, truth, problem.neutral)
        side = (
            f" {coordinate.settings[0][1]}"
            if len(coordinate.settings) == 1 and coordinate.settings[0][1]
            else ""
        )
        found[f"{coordinate.name}{side}"] = (wrong / float(deviation[index]), wrong)
    return found


def _print(off: list[dict[str, tuple[float, float]]], leads: dict[str, list[float]]) -> None:
    print("| number | off, in its calculated deviations | in robot.toml's |\n|---|---|---|")
    for name in off[0]:
        both = np.sqrt(np.mean(np.square([each[name] for each in off]), axis=0))
        print(f"| {name} | {both[0]:.2f} | {both[1]:.2f} |")
    print("\n| largest on a robot | median | 90 % | most |\n|---|---|---|---|")
    for name, values in leads.items():
        row = " | ".join(f"{each:.2f}" for each in np.quantile(values, [0.5, 0.9, 1.0]))
        print(f"| {name} | {row} |")


if __name__ == "__main__":
    main()
