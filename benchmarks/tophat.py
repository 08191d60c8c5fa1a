"""Tophats: every method to a threshold side by side, in the lights of the paper and in lights that change.

    python benchmarks/tophat.py [--draws 200] [--seed N] [--only PART] [--pictures FOLDER]

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
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import CalibrationError
from raccoon.estimate.start_light import StartLight, calibrate_start_light
from raccoon.estimate.tophat import Tophat, TophatGroup, calibrate
from raccoon.estimate.tophat.methods import METHODS, RunningMidpoint
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS, TophatReading

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


LIGHTS: dict[str, tuple[list[float], list[float], list[float]]] = {
    # name: knots of time, ambient level there (1 sun, -1 shade), times after which 0.3 s are forgiven
    "cloud": ([0, 2, 5, 8, 12, 14], [1, 1, -1, -1, 1, 1], []),
    "shadow edge": ([0, 6, 6.1, 14], [1, 1, -1, -1], [6.0]),
    "sun patch": ([0, 5, 5.1, 8, 8.1, 14], [-1, -1, 1, 1, -1, -1], [5.0, 8.0]),
}


def changing_light(rng: np.random.Generator, draws: int) -> None:
    """14 s of driving over lines, two sensors; wrong clear readings after 0.3 s, mean % (runs above 1 %)."""
    print("\nLight that changes while driving, two sensors, wrong clear readings % (runs above 1 %):")
    for light in LIGHTS:
        for shade in (0.3, 0.1, 0.02):
            scores: dict[str, list[float]] = {}
            for draw in range(draws):
                condition = TOPHAT_READINGS[2 * (draw % 4)]  # each sensor and height in turn
                for method, wrong in _changing_drive(rng, condition, light, shade).items():
                    scores.setdefault(method, []).extend(wrong)
            cells = [
                f"{name} {100 * statistics.fmean(each):.2f} ({np.mean(np.array(each) > 0.01):.0%})"
                for name, each in scores.items()
            ]
            print(f"  {light:12} sun <-> {shade:4.2f}   " + "   ".join(cells))


def _changing_drive(
    rng: np.random.Generator, condition: TophatReading, light: str, shade: float
) -> dict[str, list[float]]:
    knots, levels, events = LIGHTS[light]
    at = np.arange(0.0, 14.0, 1.0 / RATE)
    ambient = np.interp(at, knots, [shade if each < 0 else each for each in levels])
    counted = np.ones(len(at), dtype=bool)
    for event in events:
        counted &= ~((at > event) & (at < event + 0.4))  # the edge itself takes 0.1 s
    radius = reflectance.spot_radius(condition.height)
    sensors, calibrations = [], []
    lines = np.cumsum(rng.uniform(0.15, 0.5, 30))
    for _ in range(2):
        optics = reflectance.fit(condition.generation).at(
            condition.height, math.exp(0.15 * rng.standard_normal())
        )
        covered = [reflectance.line_coverage(0.24 * at, place, 0.015, radius) for place in lines]
        darkness = np.sum(covered, axis=0)
        sensors.append((reflectance.read(rng, darkness, optics, ambient=ambient), darkness))
        path = reflectance.line_coverage(np.arange(0.0, 0.6, 0.0012), 0.3, 0.015, radius)
        calibrations.append(reflectance.read(rng, path, optics, ambient=float(ambient[0])))
    found = [calibrate(samples) for samples in calibrations]
    scores: dict[str, list[float]] = {}
    black = _classified([Tophat(each) for each in found], at, [counts for counts, _ in sensors])
    for index, (counts, darkness) in enumerate(sensors):
        clear = counted & ((darkness <= 0.05) | (darkness >= 0.9 * darkness.max()))
        truth = darkness > 0.5
        for method in ("fixed", "midpoint", "k_means"):
            try:
                cut = METHODS[method](calibrations[index])
            except CalibrationError:
                scores.setdefault(f"{method} (refuses)", []).append(1.0)
                continue
            scores.setdefault(method, []).append(float(((counts >= cut) != truth)[clear].mean()))
        midpoint = RunningMidpoint()
        running_black = np.array([bool(midpoint.update(float(each))) for each in counts])
        scores.setdefault("on the fly", []).append(float((running_black != truth)[clear].mean()))
        cut = found[index].threshold or 0.0
        scores.setdefault("ours, not adapting", []).append(float(((counts >= cut) != truth)[clear].mean()))
        scores.setdefault("ours", []).append(float((black[index] != truth)[clear].mean()))
    return scores


def _classified(tophats: list[Tophat], at: Array, counts: list[Array]) -> NDArray[np.bool_]:
    group = TophatGroup(tophats)
    rows = [
        [bool(each.black) for each in group.update(float(now), [float(one[index]) for one in counts])]
        for index, now in enumerate(at)
    ]
    return np.array(rows).T


def start_light(rng: np.random.Generator, draws: int) -> None:
    """Backgrounds of 6 s with people, flashes, sun and flicker; then the lamp."""
    calibration = calibrate_start_light([3000.0] * 20, [150.0] * 20)
    false = missed = 0
    late = []
    for _ in range(draws):
        light = _background(rng, 6.0)
        lamp = rng.uniform(15, 40) * np.clip(np.arange(20) / 2.0, 0, 1)
        light = np.concatenate([light, light[-1] + lamp])
        counts = np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(light))), 0, 4095)
        detector = StartLight(calibration)
        fired = next(
            (i for i, each in enumerate(counts) if detector.update(i / RATE, float(each)).fired), None
        )
        false += fired is not None and fired < 1200
        missed += fired is None
        if fired is not None and fired >= 1200:
            late.append((fired - 1200) / RATE)
    print(f"\nStart light, {draws} backgrounds: {false} false starts, {missed} misses, ", end="")
    print(f"latest {1000 * max(late):.0f} ms after the lamp")


def _background(rng: np.random.Generator, seconds: float) -> Array:
    at = np.arange(0.0, seconds, 1.0 / RATE)
    light: Array = rng.uniform(0.1, 0.8) * (
        1.0 + rng.uniform(0, 0.1) * np.sin(628.3 * at + rng.uniform(0, 6))
    )
    for _ in range(rng.integers(0, 5)):
        begin, edge, lasting = rng.uniform(0, seconds), rng.uniform(0.05, 0.5), rng.uniform(0.1, 3.0)
        inside = np.minimum(at - begin, begin + lasting - at)
        light *= 1.0 - rng.uniform(0.1, 0.8) * np.clip(inside / edge, 0, 1)
    if rng.random() < 0.3:
        light += rng.uniform(0.2, 4.0) * np.clip((at - rng.uniform(0, seconds)) / rng.uniform(0.5, 3.0), 0, 1)
    for _ in range(rng.integers(0, 8)):
        first = int(rng.integers(0, len(at) - 8))
        light[first : first + int(rng.integers(1, 5))] += rng.uniform(1.0, 40.0)
    return np.asarray(light)


def cost(rng: np.random.Generator) -> None:
    """Medians: one update of a sensor (wall time), one calibration of 5000 readings (time of its thread)."""
    samples, _ = reflectance.drive_over_line(rng, TOPHAT_READINGS[2])
    tophat = Tophat(calibrate(samples))
    readings = [float(each) for each in samples] * 20
    spans = []
    for index, reading in enumerate(readings):
        begin = time.perf_counter()
        tophat.update(index / RATE, reading)
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
    parser.add_argument("--seed", type=int, default=None, help="the same draws again; else fresh ones")
    parser.add_argument("--pictures", type=Path, help="also draw the clusters of the eight conditions there")
    parser.add_argument("--only", choices=("conditions", "quality", "bare", "rare", "light", "start", "cost"))
    args = parser.parse_args()
    seed = np.random.SeedSequence(args.seed).entropy
    print(f"seed {seed}, {args.draws} draws")
    rng = np.random.default_rng(args.seed if args.seed is not None else seed)
    parts: dict[str, Callable[[], None]] = {
        "conditions": lambda: conditions(rng, args.draws),
        "quality": lambda: quality(rng, args.draws),
        "bare": lambda: bare_floors(rng, args.draws),
        "rare": lambda: rare_line(rng, args.draws),
        "light": lambda: changing_light(rng, max(args.draws // 5, 4)),
        "start": lambda: start_light(rng, 5 * args.draws),
        "cost": lambda: cost(rng),
    }
    for name, part in parts.items():
        if args.only in (None, name):
            part()
    if args.pictures is not None:
        draw(np.random.default_rng(1), args.pictures)
    return 0


def draw(rng: np.random.Generator, folder: Path) -> None:
    """Histograms of the eight calibration drives with surfaces, threshold and band; and the fitted model."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(4, 2, figsize=(9, 10), constrained_layout=True)
    for axis, condition in zip(axes.ravel(), TOPHAT_READINGS, strict=True):
        samples, _ = reflectance.drive_over_line(rng, condition)
        found = calibrate(samples)
        axis.hist(samples, bins=80, color="0.75", log=True)
        for surface, colour in ((found.white, "tab:orange"), (found.black, "black")):
            if surface is not None:
                axis.axvline(surface.mean, color=colour, linewidth=1)
        axis.axvline(found.threshold, color="tab:blue")
        axis.axvspan(found.low, found.high, color="tab:blue", alpha=0.2)
        axis.set_title(
            f"{condition.generation}, {1000 * condition.height:.0f} mm, {condition.light}", fontsize=9
        )
        axis.set_xlabel("counts", fontsize=8)
    figure.savefig(folder / "tophat-clusters.png", dpi=90)
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    heights = np.linspace(0.004, 0.03, 60)
    for axis, generation in zip(axes, reflectance.GENERATIONS, strict=True):
        for ambient, style in ((0.0, "-"), (1.0, "--")):
            for darkness, colour in ((0.0, "tab:orange"), (1.0, "black")):
                curve = [reflectance.counts(darkness, generation, float(each), ambient) for each in heights]
                axis.plot(1000 * heights, curve, style, color=colour)
        for reading in TOPHAT_READINGS:
            if reading.generation == generation:
                axis.plot([1000 * reading.height] * 2, [reading.white, reading.black], "o", color="tab:red")
        axis.set_title(
            f"{generation} sensor: model (- normal light, -- direct sun) and the paper", fontsize=9
        )
        axis.set_xlabel("height in mm")
        axis.set_ylabel("counts")
    figure.savefig(folder / "tophat-model.png", dpi=90)


if __name__ == "__main__":
    sys.exit(main())
