"""The start light: backgrounds with people, flashes, sun and flicker, then the lamp (see tophat.py)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.start_light import StartLight, calibrate_start_light

Array = NDArray[np.float64]
RATE = 200.0
RATES = (10.0, 25.0, 50.0, 100.0, 200.0, 1000.0)
LAMP_ON = 6.0


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
    print("... with bulbs (time constant 0 to 0.2 s) and up to 0.1 s without readings as the lamp comes on:")
    for rate in RATES:
        bulbs = [_bulb(rng, rate) for _ in range(max(draws // 5, 1))]
        delays = [each for each in bulbs if each is not None]
        early, missed = sum(each < 0.0 for each in delays), len(bulbs) - len(delays)
        text = f"median {1000 * np.median(delays):.0f} ms, latest {1000 * max(delays):.0f} ms"
        print(f"  {rate:4.0f} Hz, {len(bulbs)}: {early} false starts, {missed} misses, {text}", flush=True)


def _bulb(rng: np.random.Generator, rate: float) -> float | None:
    """Time from the lamp to the fire, s; None where it was missed."""
    at = np.arange(0.0, LAMP_ON + 2.0, 1.0 / rate)
    light, warm_up = _background(rng, LAMP_ON + 2.0, rate, quiet=2.0), rng.uniform(1e-3, 0.2)
    light += rng.uniform(15, 40) * (1.0 - np.exp(-np.maximum(at - LAMP_ON, 0.0) / warm_up))
    counts = np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(light))), 0, 4095)
    begin = LAMP_ON - rng.uniform(0.0, 0.1)
    silent = (at >= begin) & (at < begin + rng.uniform(0.0, 0.1))
    detector = StartLight(calibrate_start_light([3000.0] * 20, [150.0] * 20))
    for time, reading in zip(at[~silent], counts[~silent], strict=True):
        if detector.update(float(time), float(reading)).fired:
            return float(time) - LAMP_ON
    return None


def _background(rng: np.random.Generator, seconds: float, rate: float = RATE, quiet: float = 0.0) -> Array:
    """Light over `seconds` s; no flashes in the last `quiet` s."""
    at = np.arange(0.0, seconds, 1.0 / rate)
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
        first = rng.integers(0, int((seconds - quiet) * RATE) - 8)
        inside = at * RATE - first + 1e-6
        light[(inside >= 0.0) & (inside < rng.integers(1, 5))] += rng.uniform(1.0, 40.0)
    return np.asarray(light)
