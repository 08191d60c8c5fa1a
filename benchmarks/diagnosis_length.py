"""How time and memory of a diagnosis grow with its recording: `python benchmarks/diagnosis_length.py`.

Blind robots with one cause, and a sound one, driven for 20 to 240 s: CPU time and peak memory of a process of
its own, each after a short drive that loads what is needed. Asked is time that is linear in the length: exit
status 1 where a second of the longest drive takes more than 1.5 times as long as one of 40 s (of all robots
together). Seeds are fresh in every run, and printed, unless one is given.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

from blind.generator import make
from blind.hidden import CAUSES as HIDEABLE
from blind.hidden import draw
from options import comma_separated
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose

SOUND = "none"
CAUSES = (SOUND, "friction.stiction", "motor.back_emf_constant", "actuation.latency")
USUAL = 40.0
MOST = 1.5


def main() -> int:
    """A line for each length and robot, then how a second of the longest compares with one of 40 s."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", default="20,40,80,120,160,240")
    parser.add_argument("--causes", type=comma_separated((SOUND, *HIDEABLE)), default=list(CAUSES))
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    lengths = [float(each) for each in args.seconds.split(",")]
    print(f"seed {seed}", flush=True)
    took = dict.fromkeys(lengths, 0.0)
    context = multiprocessing.get_context("spawn")
    for seconds in lengths:
        for number, cause in enumerate(args.causes):
            with ProcessPoolExecutor(1, mp_context=context) as alone:
                cpu, megabytes, said = alone.submit(_measured, cause, seconds, [seed, number]).result()
            took[seconds] += cpu
            print(f"{seconds:5.0f} s  {cause:24s} {cpu:6.1f} s of CPU  {megabytes:5d} MB  {said}", flush=True)
    longest = max(lengths)
    if USUAL not in took or longest == USUAL:
        return 0
    ratio = (took[longest] / longest) / (took[USUAL] / USUAL)
    print(
        f"a second of {longest:g} s takes {ratio:.2f} times as long as one of {USUAL:g} s (asked: <= {MOST})"
    )
    return int(ratio > MOST)


def _measured(cause: str, seconds: float, seed: list[int]) -> tuple[float, int, str]:
    """CPU time in s, peak memory in MB, and what was said."""
    rng = np.random.default_rng(seed)
    hidden = [] if cause == SOUND else [draw(cause, rng)]
    columns = make(int(rng.integers(2**31)), hidden, seconds=seconds).columns
    diagnose(make(int(rng.integers(2**31)), hidden, seconds=8.0).columns, RobotConfig())
    start = time.process_time()
    found = diagnose(columns, RobotConfig())
    took = time.process_time() - start
    said = ", ".join(each.name for each in found.causes) or found.verdict.value
    return took, _peak(), said


def _peak() -> int:
    """MB at most of this process: what getrusage says may be that of the one it was started from."""
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) // 1024 for line in file if line.startswith("VmHWM"))


if __name__ == "__main__":
    sys.exit(main())
