"""How well hidden causes are found on other robots: `python benchmarks/diagnosis_robots.py`.

The independent plant as robots with wheels of 21 to 50 mm, of 4 to 60 g m2 and 0.04 to 0.3 N m of friction.
Each cause of the catalogue is hidden once in each, and ten of each are sound. Seeds are fresh in every run,
and printed, unless one is given. Exit status 1 where fewer than 99 % of the hidden causes are named first, or
more than 1 % of the sound robots have a name.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import diagnosis_cases  # puts tests/blind on the path
from blind.generator import make
from blind.robots import ROBOTS, fitting, noise_of, other_robot
from diagnosis_cases import Case
from diagnosis_table import is_exactly_right, is_first_right, percent
from diagnosis_trial import diagnosis_summary
from options import comma_separated
from raccoon.diagnose.diagnosis import diagnose

FIRST, CLEAN = 0.99, 0.01


def main() -> int:
    """A line for what went wrong, then one for each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument(
        "--rows",
        type=comma_separated(diagnosis_cases.ROWS),
        default="single,clean",
        help="rows of the table, of one cause or none",
    )
    parser.add_argument("--robots", type=comma_separated(ROBOTS), default=list(ROBOTS))
    parser.add_argument("--processes", type=int, default=1)
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}", flush=True)
    asked = list(diagnosis_cases.cases(args.rows, 1))
    wanted = [(name, case, seed) for name in args.robots for case in asked]
    said = []
    with ProcessPoolExecutor(args.processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        for each in pool.map(_said, *zip(*wanted, strict=True)):
            said.append(each)
            if not is_exactly_right(each):
                names = [cause["name"] for cause in each["causes"]] or [each["verdict"]]
                print(f"{each['robot']} {each['key']}: {', '.join(names)}", flush=True)
    for name in dict.fromkeys(each["robot"] for each in said):
        _tell(name, [each for each in said if each["robot"] == name])
    return _tell("all", said)


def _said(name: str, case: Case, seed: int) -> dict[str, Any]:
    """What is hidden in a robot, and what was said of it."""
    with other_robot(name) as robot:
        number, row = list(ROBOTS).index(name), diagnosis_cases.ROWS[case.row]
        rng = np.random.default_rng([number, *case.rng(seed).integers(2**31, size=2)])
        hidden = [fitting(each) for each in diagnosis_cases.hidden_causes(case, rng)]
        noise = noise_of().times(row.noise)
        blind = make(int(rng.integers(2**31)), hidden, row.drive, row.seconds, noise)
        found = diagnose(blind.columns, robot)
    names = {each.name: dict(each.values) for each in hidden}
    return {"robot": name, "key": case.key, "hidden": names, **diagnosis_summary(found)}


def _tell(name: str, said: list[dict[str, Any]]) -> int:
    """A line; returned is 1 where a figure is missed."""
    hidden, clean = ([each for each in said if bool(each["hidden"]) is has] for has in (True, False))
    first, named = [is_first_right(each) for each in hidden], [not is_exactly_right(each) for each in clean]
    whole = percent(map(is_exactly_right, hidden))
    print(f"{name:8s} first {percent(first)}, exactly {whole}; sound ones with a name {percent(named)}")
    missed = bool(hidden) and float(np.mean(first)) < FIRST
    return int(missed or (bool(clean) and float(np.mean(named)) > CLEAN))


if __name__ == "__main__":
    sys.exit(main())
