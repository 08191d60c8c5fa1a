"""Tophats: every method to a threshold side by side, in the lights of the paper and in lights that change.

    python benchmarks/tophat.py [--draws 200] [--workers 2] [--seed N] [--only PART] [--pictures FOLDER]

Readings come from the reflectance model fitted to the paper (raccoon.model.reflectance), with fresh seeds
each time unless --seed is given. An error is a reading on the wrong side of the threshold; "clear" readings
have the spot on one surface (at most 5 % of it on the other), "all" counts the edges too: black from half on.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tophat_lights
import tophat_plots
from raccoon.core.errors import CalibrationError
from raccoon.estimate.tophat import Tophat, calibrate
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS
from tophat_methods import METHODS, RunningMidpoint
from tophat_places import by_hand, white_only
from tophat_start import start_light
from tophat_tables import tables

Array = NDArray[np.float64]
RATE = 200.0


def ours(samples: Array) -> float:
    """The cluster calibrator as one more threshold method."""
    found = calibrate(samples)
    if found.threshold is None:
        raise CalibrationError(found.reason)
    return found.threshold


ALL: dict[str, Callable[[Array], float]] = {**METHODS, "ours": ours}


def errors(threshold: float, samples: Array, darkness: Array) -> tuple[float, float]:
    """(share of wrong readings among the clear ones, among all)."""
    wrong = (samples >= threshold) != (darkness > 0.5)
    clear = (darkness <= 0.05) | (darkness >= 0.95)
    return float(wrong[clear].mean()), float(wrong.mean())


def conditions(rng: np.random.Generator, draws: int) -> None:
    """The paper's eight conditions: calibrate on one drive, judge on another of the same sensor and light."""
    print("\nThe paper's eight conditions: accepted; wrong clear readings %; wrong of all %")
    print(f"{'sensor, height, light':24}" + "".join(f"{name:>24}" for name in (*ALL, "on the fly")))
    for condition in TOPHAT_READINGS:
        name = f"{condition.generation} {1000 * condition.height:.0f} mm {condition.light}"
        cells = []
        results: dict[str, list[tuple[float, float]]] = {method: [] for method in (*ALL, "on the fly")}
        for _ in range(draws):
            noise, gain = rng.uniform(2.0, 5.0), math.exp(0.1 * rng.standard_normal())
            first, _ = reflectance.drive_over_line(rng, condition, noise=noise, gain=gain)
            later, darkness = reflectance.drive_over_line(rng, condition, noise=noise, gain=gain)
            for method, threshold in ALL.items():
                try:
                    results[method].append(errors(threshold(first), later, darkness))
                except CalibrationError:
                    continue
            results["on the fly"].append(running(first, later, darkness))
        for scores in results.values():
            if not scores:
                cells.append(f"{'0 %':>24}")
                continue
            clear, whole = (100.0 * statistics.fmean(column) for column in zip(*scores, strict=True))
            cells.append(f"{f'{len(scores) / draws:.1%} {clear:.3f} {whole:.3f}':>24}")
        print(f"{name:24}" + "".join(cells))


def running(first: Array, later: Array, darkness: Array) -> tuple[float, float]:
    """The on-the-fly midpoint on the second drive, having seen the first."""
    method = RunningMidpoint()
    for counts in first:
        method.update(float(counts))
    black = np.array([bool(method.update(float(counts))) for counts in later])
    clear = (darkness <= 0.05) | (darkness >= 0.95)
    wrong = black != (darkness > 0.5)
    return float(wrong[clear].mean()), float(wrong.mean())


def tail(z: float) -> float:
    """P(N(0, 1) > z)."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def quality(rng: np.random.Generator, draws: int) -> None:
    """Low contrast (1200 / 1700, Bayes error 0.26 % at equal priors): expected error over Bayes error."""
    sd = 250.0 / 2.795
    print("\nThreshold quality, 500 readings of 1200 and 1700 counts: mean error / Bayes error (worst)")
    for share in (0.5, 0.2, 0.05, 0.02, 0.01):
        ratios: dict[str, list[float]] = {method: [] for method in ALL}
        verdicts: Counter[str] = Counter()
        for _ in range(draws):
            dark = rng.random(500) < share
            dark[:3] = True
            samples = np.where(rng.permutation(dark), 1700.0, 1200.0) + sd * rng.standard_normal(500)
            verdicts[calibrate(samples).verdict] += 1
            for method, threshold in ALL.items():
                try:
                    cut = threshold(samples)
                except CalibrationError:
                    continue
                error = 0.5 * (tail((cut - 1200.0) / sd) + tail((1700.0 - cut) / sd))
                ratios[method].append(error / tail(250.0 / sd))
        cells = [
            f"{name} {statistics.fmean(each):.2f} ({max(each):.1f})" if each else f"{name} refused"
            for name, each in ratios.items()
        ]
        print(
            f"{share:5.0%} black  "
            + "   ".join(cells)
            + f"   { {str(key): count for key, count in verdicts.items()} }"
        )


def bare_floors(rng: np.random.Generator, draws: int) -> None:
    """No line at all: a threshold is a mistake."""
    time_ = np.linspace(-1.0, 1.0, 500)
    floors: dict[str, Callable[[], Array]] = {
        "gaussian": lambda: rng.normal(1000.0, rng.uniform(5, 100), 500),
        "uniform": lambda: rng.uniform(800.0, 1200.0, 500),
        "skewed": lambda: 800.0 + rng.gamma(rng.uniform(1.0, 4.0), 40.0, 500),
        "heavy-tailed": lambda: 1500.0 + 40.0 * rng.standard_t(3, 500),
        "slow drift": lambda: 1000.0 + rng.uniform(-300, 300) * time_ + rng.normal(0.0, 5.0, 500),
        "slow wave": lambda: (
            1000.0
            + rng.uniform(20, 200) * np.sin(rng.uniform(0.5, 3.0) * time_ + rng.uniform(0, 6))
            + rng.normal(0.0, 5.0, 500)
        ),
    }
    print("\nBare floor, refused:")
    for name, floor in floors.items():
        refused = sum(not calibrate(np.clip(np.round(floor()), 0, 4095)).usable for _ in range(draws))
        print(f"  {name:14} {refused / draws:.1%}")


def rare_line(rng: np.random.Generator, draws: int) -> None:
    """2 % of the readings at 1000 counts on a floor of 300 +- 150."""
    print(
        "\nLine in 2 % of the readings on an uneven floor: accepted and right (error <= 1 % on both surfaces)"
    )
    for name, threshold in ALL.items():
        right = 0
        for _ in range(draws):
            samples = np.concatenate([rng.normal(300.0, 150.0, 490), rng.normal(1000.0, 20.0, 10)])
            if rng.random() < 0.5:
                rng.shuffle(samples)
            try:
                cut = threshold(np.clip(samples, 0, 4095))
            except CalibrationError:
                continue
            right += tail((cut - 300.0) / 150.0) <= 0.01 and tail((1000.0 - cut) / 20.0) <= 0.01
        print(f"  {name:12} {right / draws:.1%}")


def changing_light(rng: np.random.Generator, draws: int, workers: int, speed: float) -> None:
    """14 s of driving over lines, two sensors; wrong clear readings after 0.3 s, mean % (runs above 1 %)."""
    print("\nLight that changes while driving, two sensors, wrong clear readings % (runs above 1 %):")
    jobs = [
        (seed, draw, light, shade, speed)
        for light, shade in tophat_lights.ROWS
        for draw, seed in enumerate(np.random.SeedSequence(int(rng.integers(2**63))).spawn(draws))
    ]
    with ProcessPoolExecutor(workers) as pool:
        results = pool.map(tophat_lights.drive, *zip(*jobs, strict=True), chunksize=8)
        for light, shade in tophat_lights.ROWS:
            scores: dict[str, list[float]] = {}
            for _ in range(draws):
                for method, wrong in next(results).items():
                    scores.setdefault(method, []).extend(wrong)
            cells = [
                f"{name} {100 * statistics.fmean(each):.2f} ({np.mean(np.array(each) > 0.01):.1%})"
                + (f" refuses {1 - len(each) / (2 * draws):.0%}" if len(each) < 2 * draws else "")
                for name, each in scores.items()
            ]
            print(f"  {tophat_lights.row(light, shade)}   " + "   ".join(cells), flush=True)


def cost(rng: np.random.Generator) -> None:
    """Medians: one update of a sensor (wall time), one calibration of 5000 readings (time of its thread)."""
    samples, _ = reflectance.drive_over_line(rng, TOPHAT_READINGS[2])
    tophat = Tophat(calibrate(samples))
    readings = [float(each) for each in samples] * 20
    spans = []
    for index, reading in enumerate(readings):
        begin = time.perf_counter()
        tophat.update(index / RATE, reading, None, 0.0012)
        spans.append(time.perf_counter() - begin)
    print(f"\nAdaptive update: median {1e6 * statistics.median(spans):.1f} us")
    drive, _ = reflectance.drive_over_line(rng, TOPHAT_READINGS[3], distance=6.0)
    shuffled = rng.permutation(np.concatenate([rng.normal(1200, 89, 4500), rng.normal(1700, 89, 500)]))
    for name, counts in (
        ("a drive", drive),
        ("shuffled", shuffled),
        ("bare floor", rng.normal(1000, 50, 5000)),
    ):
        spans = []
        for _ in range(7):
            begin = time.thread_time()
            calibrate(counts)
            spans.append(time.thread_time() - begin)
        print(f"Calibration of 5000 readings, {name}: median {1e3 * statistics.median(spans):.0f} ms")


def main() -> int:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument(
        "--workers", type=int, default=1, help="processes for the changing light and the tables"
    )
    parser.add_argument("--speed", type=float, default=0.24, help="m/s, in the changing light")
    parser.add_argument("--seed", type=int, default=None, help="the same draws again; else fresh ones")
    parser.add_argument("--pictures", type=Path, help="also draw the clusters of the eight conditions there")
    names = ("conditions", "quality", "bare", "rare", "light", "start", "cost", "white", "hand", "tables")
    parser.add_argument("--only", choices=names)
    args = parser.parse_args()
    seed = np.random.SeedSequence(args.seed).entropy
    print(f"seed {seed}, {args.draws} draws")
    rng = np.random.default_rng(args.seed if args.seed is not None else seed)
    parts: dict[str, Callable[[], None]] = {
        "conditions": lambda: conditions(rng, args.draws),
        "quality": lambda: quality(rng, args.draws),
        "bare": lambda: bare_floors(rng, args.draws),
        "rare": lambda: rare_line(rng, args.draws),
        "light": lambda: changing_light(rng, args.draws, args.workers, args.speed),
        "start": lambda: start_light(rng, 5 * args.draws),
        "cost": lambda: cost(rng),
        "white": lambda: white_only(rng, args.draws),
        "hand": lambda: by_hand(rng, args.draws),
        "tables": lambda: tables(rng, args.draws, args.workers),
    }
    for name, part in parts.items():
        if args.only in (None, name):
            part()
            sys.stdout.flush()
    if args.pictures is not None:
        tophat_plots.draw(np.random.default_rng(1), args.pictures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
