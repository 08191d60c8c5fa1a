"""Tophats at the table: floors without a line that look like two surfaces, and calibration by hand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat import Tophat, TophatCalibration, calibrate, calibrate_two_phase
from raccoon.estimate.tophat.standing_calibration import calibrate_standing
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS, TophatReading
from raccoon.model.reflectance import AMBIENT, DISTANCE_PER_READING, TEXTURE

Array = NDArray[np.float64]
RATE, LENGTH, STOOD = 200.0, 0.6, 200
AMBIENTS = (0.0, 0.02, 0.1, 1.0)  # of direct sun


def white_only(rng: np.random.Generator, draws: int) -> None:
    """Calibration drives of 60 cm without a line, in each sensor, height and light in turn."""
    sensors = [(each, ambient) for each in TOPHAT_READINGS if each.light == "normal" for ambient in AMBIENTS]
    print("\nWhite alone, verdicts:")
    floors: dict[str, Callable[[Array, float], Array]] = {
        "one board": lambda way, _: np.ones_like(way),
        "another board from here on, 15 to 35 % darker": lambda way, radius: (
            1.0 - rng.uniform(0.15, 0.35) * _patch(rng, way, 2.0 * LENGTH, radius)
        ),
        "a board of 2 to 20 cm, 15 to 35 % darker": lambda way, radius: (
            1.0 - rng.uniform(0.15, 0.35) * _patch(rng, way, rng.uniform(0.02, 0.2), radius)
        ),
        "a seam of 1 to 3 mm, 60 to 95 % darker": lambda way, radius: (
            1.0 - rng.uniform(0.6, 0.95) * _patch(rng, way, rng.uniform(0.001, 0.003), radius)
        ),
        "glare on 1 to 5 cm, 1.3 to 3 times the light": lambda way, radius: (
            1.0 + rng.uniform(0.3, 2.0) * _patch(rng, way, rng.uniform(0.01, 0.05), radius)
        ),
    }
    for name, floor in floors.items():
        verdicts: Counter[str] = Counter()
        for draw in range(draws):
            condition, ambient = sensors[draw % len(sensors)]
            radius = reflectance.spot_radius(condition.height)
            times = floor(np.arange(0.0, LENGTH, DISTANCE_PER_READING), radius)
            counts = _readings(rng, condition, np.zeros_like(times), ambient, times)
            verdicts[calibrate(counts, np.full(len(counts), DISTANCE_PER_READING)).verdict] += 1
        print(f"  {name:48}" + ", ".join(f"{each} {count}" for each, count in verdicts.most_common()))


def _patch(rng: np.random.Generator, way: Array, width: float, radius: float) -> Array:
    """Share of the spot on a patch that begins somewhere in the middle of a way."""
    begin = rng.uniform(0.2, 0.8) * LENGTH
    return reflectance.line_coverage(way, begin + 0.5 * width, width, radius)


def _readings(
    rng: np.random.Generator, condition: TophatReading, darkness: Array, ambient: float, times: Array
) -> Array:
    """Counts over a floor that sends back so many times the light."""
    light = reflectance.fit(condition.generation).at(condition.height).light(darkness, ambient)
    light = light * times * np.exp(TEXTURE * rng.standard_normal(len(darkness)))
    counts = reflectance.FULL_SCALE / (1.0 + light) + 3.0 * rng.standard_normal(len(darkness))
    return np.clip(np.round(counts), 0.0, reflectance.FULL_SCALE)


def by_hand(rng: np.random.Generator, draws: int) -> None:
    """Calibrated on a drive, and on one place of white and one of black; judged on another drive."""
    kinds: dict[str, Callable[[TophatReading], TophatCalibration]] = {
        "a drive": lambda condition: calibrate(reflectance.drive_over_line(rng, condition)[0]),
        "by hand": lambda condition: calibrate_standing(*_stood(rng, condition)),
        "by hand, spreads as read": lambda condition: calibrate_two_phase(*_stood(rng, condition)),
    }
    print("\nCalibrated by hand: wrong over one surface %, the adaptive classifier on a later drive")
    print(f"{'sensor, height, light':24}" + "".join(f"{kind:>26}" for kind in kinds))
    for condition in TOPHAT_READINGS:
        cells = []
        for make in kinds.values():
            shares = [
                _wrong(rng, condition, found) for _ in range(draws) if (found := make(condition)).usable
            ]
            cells.append(f"{f'{len(shares) / draws:.0%} {100.0 * np.mean(shares):.2f}':>26}")
        name = f"{condition.generation} {1000 * condition.height:.0f} mm {condition.light}"
        print(f"{name:24}" + "".join(cells))


def _stood(rng: np.random.Generator, condition: TophatReading) -> tuple[Array, Array]:
    """Counts of a second on one place of white, and on one of black."""
    optics = reflectance.fit(condition.generation).at(condition.height)
    light = (
        optics.light(darkness, AMBIENT[condition.light]) * np.exp(TEXTURE * rng.standard_normal())
        for darkness in (0.0, 1.0)
    )
    white, black = (
        np.round(reflectance.FULL_SCALE / (1.0 + each) + 3.0 * rng.standard_normal(STOOD)) for each in light
    )
    return white, black


def _wrong(rng: np.random.Generator, condition: TophatReading, calibration: TophatCalibration) -> float:
    """Share of wrong readings over one surface, at most 5 % of the spot on the other."""
    samples, darkness = reflectance.drive_over_line(rng, condition)
    tophat = Tophat(calibration)
    black = np.array(
        [
            tophat.update(index / RATE, float(counts), None, DISTANCE_PER_READING).black
            for index, counts in enumerate(samples)
        ],
        dtype=float,
    )
    clear = (darkness <= 0.05) | (darkness >= 0.95)
    return float(((black > 0.5) != (darkness > 0.5))[clear].mean())
