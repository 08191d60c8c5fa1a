"""Whether rehearsals are understood: `python benchmarks/diagnosis_rehearsals.py [--seed N] [EFFECT ...]`.

As a team would: each effect of the catalogue is given to the simulated robot, `raccoon excite --simulate`
drives the checkup, and `raccoon diagnose` must name that effect and nothing else. Simulator and diagnosis
share their equations here, but nearly no noise hides what they do not share: other steps, another filter of
the controller than the usual one. Sizes are drawn as in tests/blind, from a seed that is fresh in every run,
and printed, unless it is given.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import diagnosis_cases  # noqa: F401  puts tests/blind on the path
from blind.hidden import CAUSES, Hidden, draw
from raccoon.cli import main as raccoon
from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters


def main() -> None:
    """A line an effect, then how many were named alone."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("effects", nargs="*", help="ids of the catalogue; all of them where none is given")
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    unknown = sorted(set(args.effects) - set(CAUSES))
    if unknown:
        parser.error(f"{', '.join(unknown)}: allowed are {', '.join(CAUSES)}")
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}", flush=True)
    alone = []
    for effect in args.effects or CAUSES:
        hidden = draw(effect, np.random.default_rng(seed))
        begin = time.process_time()
        said = _rehearsed(hidden)
        named = [cause["id"] for cause in said["causes"]]
        alone.append(named == [effect] and said["verdict"] == "explained")
        print(f"{_told(hidden, said)} ({time.process_time() - begin:.0f} s)", flush=True)
    print(f"named, and nothing else: {sum(alone)} of {len(alone)}")


def _rehearsed(hidden: Hidden) -> dict[str, Any]:
    """What `raccoon diagnose --json` says of a checkup of the simulated robot with this effect."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        robot = Parameters.from_robot(RobotConfig())
        robot.with_effect(hidden.id, hidden.where, **hidden.values).save(Path("model.toml"))
        _quietly("init")
        _quietly("excite", "--simulate", "--model", "model.toml", "--record", "run.jsonl.gz")
        _quietly("diagnose", "run.jsonl.gz", "--json", "found.json")
        said: dict[str, Any] = json.loads(Path("found.json").read_text())
    return said


def _quietly(*words: str) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        status = raccoon(list(words))
    if status:
        raise SystemExit(f"raccoon {' '.join(words)}: exit status {status}")


def _told(hidden: Hidden, said: dict[str, Any]) -> str:
    """What was hidden, and what was said, each number with its standard deviation."""
    true = ", ".join(f"{name} {value:.4g}" for name, value in hidden.values.items())
    causes = "; ".join(
        f"{cause['id']}{'@' + cause['where'] if cause.get('where') else ''} "
        + ", ".join(
            f"{name} {each['value']:.4g} +- {each['std']:.2g}" for name, each in cause["parameters"].items()
        )
        for cause in said["causes"]
    )
    return f"{hidden.name} {true}: {said['verdict']}, {causes or 'nothing'}"


if __name__ == "__main__":
    main()
