"""What several short drives of a robot tell together: `python benchmarks/diagnosis_together.py`.

The independent plant as one robot that drives a few times, its battery with another charge and its gyro with
another bias each time. Each cause of the catalogue is hidden once, and some robots are sound. Said is what
the drives tell together, and what each tells alone. Seeds are fresh in every run, and printed, unless one is
given. Exit status 1 where a sound robot has a name, a wrong cause is named first, or fewer are named than
alone.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import zlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

from blind.generator import make
from blind.hidden import CAUSES, Hidden, draw
from diagnosis_table import is_exactly_right, is_first_right, percent
from diagnosis_trial import diagnosis_summary
from options import comma_separated
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.findings.path_dependence import PATH_DEPENDENT, PER_RECORDING

HIDDEN = tuple(each for each in CAUSES if each not in (*PATH_DEPENDENT, *PER_RECORDING))
CLEAN = "none"
VOLTS, BIAS = 0.3, 0.002
"""By how much the battery's charge (V) and the gyro's bias (rad/s) differ from day to day, one deviation."""


def main() -> int:
    """A line for each robot that was not told rightly, then what all were worth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--drives", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--size", type=float, default=1.0, help="of the hidden causes")
    parser.add_argument("--drive", default="exciting", help="exciting or contest")
    parser.add_argument("--clean", type=int, default=12, help="robots without a cause")
    parser.add_argument("--causes", type=comma_separated(HIDDEN), default=list(HIDDEN))
    parser.add_argument("--alone", action="store_true", help="also each drive alone")
    parser.add_argument("--processes", type=int, default=1)
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}", flush=True)
    wanted = [(each, 0) for each in args.causes]
    wanted += [(CLEAN, number) for number in range(args.clean)]
    said = []
    with ProcessPoolExecutor(args.processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        for each in pool.map(_said, *zip(*((*it, seed, args) for it in wanted), strict=True)):
            said.append(each)
            if not is_exactly_right(each["together"]):
                print(
                    f"{each['cause']}: {_names(each['together'])} (hidden {each['together']['hidden']})",
                    flush=True,
                )
    return _tell(said)


def _names(said: dict[str, Any]) -> str:
    return ", ".join(each["name"] for each in said["causes"]) or said["verdict"]


def _said(cause: str, number: int, seed: int, args: argparse.Namespace) -> dict[str, Any]:
    """What is said of one robot's drives together, and alone."""
    rng = np.random.default_rng([seed, zlib.crc32(cause.encode()), number])
    hidden = [] if cause == CLEAN else [draw(cause, rng, args.size)]
    robot = int(rng.integers(2**31))
    drives = [
        make(
            int(rng.integers(2**31)), [*hidden, *_of_the_day(rng)], args.drive, args.seconds, robot=robot
        ).columns
        for _ in range(args.drives)
    ]
    names = {each.name: dict(each.values) for each in hidden}
    found = diagnose(drives[0], RobotConfig(), more=drives[1:])
    together = {"hidden": names, "seconds": found.seconds, **diagnosis_summary(found)}
    alone = [
        {"hidden": names, **diagnosis_summary(diagnose(each, RobotConfig()))} for each in drives if args.alone
    ]
    return {"cause": cause, "together": together, "alone": alone}


def _of_the_day(rng: np.random.Generator) -> list[Hidden]:
    """What differs from day to day, and is no cause."""
    volts, bias = 6.8 + VOLTS * float(rng.standard_normal()), BIAS * float(rng.standard_normal())
    return [Hidden("day", None, {}, {"voc": volts}), Hidden("day", None, {}, {"gyro_bias": bias})]


def _tell(said: list[dict[str, Any]]) -> int:
    hidden, clean = ([each for each in said if (each["cause"] != CLEAN) is has] for has in (True, False))
    first = [is_first_right(each["together"]) for each in hidden]
    wrong = [
        bool(each["together"]["causes"]) and not right for each, right in zip(hidden, first, strict=True)
    ]
    named = [bool(each["together"]["causes"]) for each in clean]
    alone = [is_first_right(it) for each in hidden for it in each["alone"]]
    seconds = [each["together"]["seconds"] for each in said]
    exact = percent(is_exactly_right(it["together"]) for it in hidden)
    print(f"together: first {percent(first)}, exactly {exact}")
    print(
        f"wrong first: {percent(wrong)}; sound ones with a name {percent(named)}; s: {np.median(seconds):.1f}"
    )
    if alone:
        print(f"each drive alone: first {percent(alone)}")
    fewer = bool(alone) and bool(first) and float(np.mean(first)) < float(np.mean(alone))
    return int(any(named) or any(wrong) or fewer)


if __name__ == "__main__":
    sys.exit(main())
