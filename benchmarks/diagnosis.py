"""How well hidden causes are found: `python benchmarks/diagnosis.py --trials 2`.

Recordings come from the independent plant in tests/blind. Seeds are fresh in every run, and printed, unless
one is given. With `--results FILE` every trial is kept in it as a line; the same command goes on where it was
stopped, with the seed of the file. Prints a row a case (asked and measured), the confusion of causes, and
times; with `--pool FILE ...` those of several such files together.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from itertools import islice
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from diagnosis_cases import ROWS, Case, cases, make_recording
from diagnosis_table import print_table
from diagnosis_trial import diagnosed_columns, run
from options import comma_separated
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.reports.pictures import error_figure


def main() -> None:
    """Run what is missing and print everything."""
    args = _arguments()
    if args.pool is not None:
        _print_together(args.pool)
        return
    known = list(_kept(args.results))
    seed = _seed(args.seed, known)
    done = {each["key"]: each for each in known if "key" in each}
    if args.results is not None and not known:
        _keep(args.results, {"seed": seed})
    wanted = [each for each in cases(args.cases, args.trials) if each.key not in done]
    if args.picture is not None:
        folder = Path(args.picture[1]).parent
        if not folder.is_dir():
            sys.exit(f"--picture {args.picture[1]}: there is no folder {folder}")
        _draw(args.picture[0], seed, Path(args.picture[1]))
        return
    print(
        f"seed {seed}, {args.trials} trials for each cause, {len(done)} done, {len(wanted)} to do", flush=True
    )
    if not args.report:
        for result in _run(wanted, seed, args.processes, time.monotonic() + 60.0 * args.minutes):
            done[result["key"]] = result
            if args.results is not None:
                _keep(args.results, result)
            if args.verbose:
                _tell(result)
    print_table(list(done.values()))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--trials", type=int, default=2, help="recordings for each cause (10 times that clean)"
    )
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument(
        "--cases", type=comma_separated(ROWS), default=list(ROWS), help="rows of the table, comma separated"
    )
    parser.add_argument("--results", type=Path, default=None, help="file to append to and to go on from")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no trial after this time")
    parser.add_argument("--report", action="store_true", help="run nothing, print what the file holds")
    parser.add_argument(
        "--pool",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="run nothing, print what these results hold together",
    )
    parser.add_argument(
        "--picture",
        nargs=2,
        metavar=("KEY", "FILE"),
        help="draw the error of one recording before and after, such as single/imu.latency/0",
    )
    parser.add_argument("--verbose", action="store_true", help="a line for each trial")
    return parser.parse_args()


def _print_together(paths: list[Path]) -> None:
    results: list[dict[str, Any]] = []
    for path in paths:
        kept = list(_kept(path))
        if not kept:
            sys.exit(f"--pool {path}: there are no results in it")
        done = [each for each in kept if "key" in each]
        print(f"seed {_seed(None, kept)}: {len(done)} recordings")
        results += done
    print_table(results)


def _seed(asked: int | None, known: list[dict[str, Any]]) -> int:
    kept = next((each["seed"] for each in known if "key" not in each), None)
    if kept is not None and asked not in (None, kept):
        sys.exit(f"the results were made with seed {kept}")
    fresh = kept if kept is not None else asked
    return int(np.random.default_rng().integers(2**31)) if fresh is None else int(fresh)


def _kept(path: Path | None) -> Iterator[dict[str, Any]]:
    if path is not None and path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            yield json.loads(line)


def _keep(path: Path, what: dict[str, Any]) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(what) + "\n")


def _run(wanted: list[Case], seed: int, processes: int, until: float) -> Iterable[dict[str, Any]]:
    if processes == 1:
        for case in wanted:
            if time.monotonic() > until:
                return
            yield run(case, seed)
        return
    spawn = multiprocessing.get_context("spawn")
    waiting = iter(wanted)
    with ProcessPoolExecutor(processes, mp_context=spawn) as pool:
        running = {pool.submit(run, case, seed) for case in islice(waiting, processes)}
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            if time.monotonic() < until:
                running |= {pool.submit(run, case, seed) for case in islice(waiting, len(done))}
            yield from (each.result() for each in done)


def _draw(key: str, seed: int, path: Path) -> None:
    case = Case.of(key)
    blind = make_recording(case, seed)
    said = diagnose(diagnosed_columns(case, blind), RobotConfig())
    error_figure(said).savefig(path, dpi=110)
    print("hidden", {each.name: each.values for each in blind.hidden})
    for each in said.causes:
        print("said", each.name, {name: (value.value, value.std) for name, value in each.parameters.items()})


def _tell(result: dict[str, Any]) -> None:
    said = ", ".join(each["name"] for each in result["causes"]) or "-"
    unknown = "; ".join(result["depends_on"])
    hidden = result.get("alone") or result["hidden"]
    true = ", ".join(sorted(hidden, key=lambda name: -hidden[name] if "alone" in result else 0)[:6])
    sizes = result["hidden"].get(true, {})
    print(f"{result['key']:42s} {true} {({k: round(v, 4) for k, v in sizes.items()})} -> {said}"
          f"{' ?' + unknown if unknown else ''}  {result['seconds']:.1f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
