"""Tophats on tables that are not as they were calibrated: other light, other height, boards, glare, spikes
(see tophat.py). The law of light, the spot and the floor are this module's own and share nothing with the
package's but the paper's readings.

The sensor's own light falls exponentially with its height (the package's with a power of it), through the
readings of the paper at 7 and 23 mm; the spot fades to its rim; floors are brighter here and darker there.
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat import Tophat, calibrate

Array = NDArray[np.float64]

PAPER = {
    ("old", 7.0): (180, 2930, 50, 170),
    ("new", 7.0): (1270, 3800, 140, 250),
    ("old", 23.0): (1830, 3810, 50, 130),
    ("new", 23.0): (3440, 4030, 130, 220),
}
"""By make and height in mm: white and black indoors, white and black in direct sun (paper, tables II and
III)."""
SENSORS = tuple(PAPER)
RATE, LENGTH, CALIBRATED_OVER, GRID = 200.0, 2.5, 0.6, 0.0005  # 1/s, m
TAPES = (0.019, 0.025, 0.05)  # m
CLEAR = 0.05  # of the spot, that may be on the other surface


@dataclass(frozen=True, slots=True)
class Row:
    """Where a robot was calibrated and where it drives: suns as shares of direct sun.

    higher: mm after the calibration. spikes: share of readings that are anything at all. patches: how many
    pieces of floor send back how many times as much light, how long they are (m); whether lines are on them.
    sunny: a patch of the table in so much sun. speed: m/s; None: wanders. told: whether the way is.
    """

    calibrated: float = 0.0
    used: float = 0.0
    higher: float = 0.0
    spikes: float = 0.0
    patches: int = 0
    times: tuple[float, float] = (1.0, 1.0)
    long: tuple[float, float] = (0.0, 0.0)
    lined: bool = False
    sunny: float = 0.0
    speed: float | None = None
    told: bool = True


ROWS = {
    "calibrated in the sun, used indoors": Row(calibrated=1.0),
    "... in 0.3 of the sun": Row(calibrated=0.3),
    "calibrated indoors, used in 0.1 of the sun": Row(used=0.1),
    "put 8 mm higher after the calibration": Row(higher=8.0),
    "patch of 0.3 of the sun with a sharp edge": Row(sunny=0.3),
    "0.3 % of the readings anything at all": Row(spikes=0.003),
    "three boards of 5 to 20 cm, 15 to 35 % darker": Row(patches=3, times=(0.65, 0.85), long=(0.05, 0.2)),
    "two of 25 to 70 cm with lines on them": Row(patches=2, times=(0.65, 0.85), long=(0.25, 0.7), lined=True),
    "four spots of glare": Row(patches=4, times=(1.3, 3.0), long=(0.01, 0.05)),
    "five seams of 1 mm": Row(patches=5, times=(0.05, 0.4), long=(0.001, 0.001)),
    "nobody says the way, 0.12 m/s": Row(speed=0.12, told=False),
    "steady light": Row(),
}


@dataclass(frozen=True, slots=True)
class _Sensor:
    """What one specimen gets of the floor below it: its own light and the sun's, of white, the shares of both
    that black sends back, what it gets whatever is below, and the width of its spot (m)."""

    own: float
    sun: float
    own_by_black: float
    sun_by_black: float
    leak: float
    spot: float


def tables(rng: np.random.Generator, draws: int, workers: int) -> None:
    """Print every row: wrong readings over one surface, mean %, in the second half, and runs above 1 %."""
    print("\nTables that are not as calibrated, wrong clear readings % (second half; runs above 1 %):")
    with ProcessPoolExecutor(workers) as pool:
        for name, row in ROWS.items():
            seeds = np.random.SeedSequence(int(rng.integers(2**63))).spawn(draws)
            runs = pool.map(drive, [row] * draws, range(draws), seeds, chunksize=4)
            found = np.array([each for each in runs if each is not None]).reshape(-1, 2)
            whole, late = 100.0 * found.mean(axis=0)
            above = np.mean(found[:, 0] > 0.01)
            refused = f"  {draws - len(found)} refused" if len(found) < draws else ""
            print(f"  {name:48}{whole:6.2f} ({late:5.2f}; {above:.1%}){refused}", flush=True)


def drive(row: Row, draw: int, seed: np.random.SeedSequence) -> tuple[float, float] | None:
    """Shares of wrong clear readings, of all and of those in the second half; None: no calibration."""
    samples, counts, dark, ways = recording(row, draw, seed)
    found = calibrate(samples)
    if not found.usable:
        return None
    tophat = Tophat(found)
    said = np.array(
        [
            tophat.update(index / RATE, float(each), None, float(way) if row.told else None).black
            for index, (each, way) in enumerate(zip(counts, ways, strict=True))
        ],
        dtype=float,
    )
    clear = (dark <= CLEAR) | (dark >= 1.0 - CLEAR)
    wrong = ((said > 0.5) != (dark > 0.5))[clear]
    return float(wrong.mean()), float(wrong[len(wrong) // 2 :].mean())


def recording(row: Row, draw: int, seed: np.random.SeedSequence) -> tuple[Array, Array, Array, Array]:
    """Counts of the calibration; counts, share of the spot on black and way of each tick of the drive."""
    rng = np.random.default_rng(seed)
    make, height = SENSORS[draw % len(SENSORS)]
    gain, tape = math.exp(0.1 * rng.standard_normal()), math.exp(0.1 * rng.standard_normal())
    before, after = (_sensor(make, each, gain, tape) for each in (height, height + row.higher))
    width = rng.choice(TAPES)
    line = _strip(CALIBRATED_OVER, rng.uniform(0.2, 0.4), width)
    there = np.arange(0.0, CALIBRATED_OVER, 0.24 / RATE)
    samples = _spiked(
        rng, _read(rng, before, line, there, row.calibrated, _uneven(rng, CALIBRATED_OVER)), row
    )
    pace = np.cumsum(rng.standard_normal(int(LENGTH / 0.1 * RATE))) / math.sqrt(RATE)
    speed = row.speed or np.clip(rng.uniform(0.15, 0.3) + 0.05 * pace, 0.12, 0.35)
    ways = np.broadcast_to(np.asarray(speed) / RATE, pace.shape)
    places = np.cumsum(ways)
    places = places[places < LENGTH]
    floor, sun = _uneven(rng, LENGTH), np.full(int(LENGTH / GRID), row.used)
    lines, at = np.zeros(len(sun)), rng.uniform(0.15, 0.4)
    while at < LENGTH - 0.1:
        lines += _strip(LENGTH, at, width)
        at += rng.uniform(0.3, 0.5)
    for _ in range(row.patches):
        patch = _strip(LENGTH, rng.uniform(0.1, LENGTH - row.long[0]), rng.uniform(*row.long))
        if row.lined or not (np.roll(patch, 40) + patch + np.roll(patch, -40))[lines > 0.0].any():
            floor *= 1.0 + (rng.uniform(*row.times) - 1.0) * patch
    if row.sunny:
        sun += row.sunny * _strip(LENGTH, rng.uniform(0.5, 1.2), rng.uniform(0.3, 1.0))
    counts = _spiked(rng, _read(rng, after, lines, places, sun, floor), row)
    told = ways[: len(places)] * (1.0 + 0.03 * rng.standard_normal())
    return samples, counts, _seen(lines, places, after.spot), told


def _sensor(make: str, height: float, gain: float, tape: float) -> _Sensor:
    near, far = (np.array([4095.0 / each - 1.0 for each in PAPER[make, at]]) for at in (7.0, 23.0))
    share = (near[1] - far[1]) / (near[0] - far[0])
    own_near, own_far = ((each[0] - each[1]) / (1.0 - share) for each in (near, far))
    part = (height - 7.0) / 16.0
    suns = [(1.0 - part) * (near[2 + k] - near[k]) + part * (far[2 + k] - far[k]) for k in (0, 1)]
    return _Sensor(
        own=gain * own_near * (own_far / own_near) ** part,
        sun=gain * suns[0],
        own_by_black=tape * share,
        sun_by_black=tape**0.5 * suns[1] / suns[0],
        leak=gain * (near[0] - own_near),
        spot=0.002 + 0.3e-3 * height,
    )


def _strip(length: float, begin: float, width: float) -> Array:
    """1 on a strip across the way, 0 beside it."""
    grid = np.arange(int(length / GRID)) * GRID
    return ((grid >= begin) & (grid < begin + width)).astype(float)


def _uneven(rng: np.random.Generator, length: float) -> Array:
    """How many times the usual light a floor sends back, along a way: 3 % every 5 cm and 1.5 % every mm."""
    grid = np.arange(int(length / GRID)) * GRID
    made = np.zeros(len(grid))
    for apart, sd in ((0.05, 0.03), (0.001, 0.015)):
        knots = np.arange(0.0, length + 2.0 * apart, apart)
        made += sd * np.interp(grid, knots, rng.standard_normal(len(knots)))
    return np.asarray(np.exp(made))


def _seen(what: Array, places: Array, spot: float) -> Array:
    """Mean of something along the way over a spot that fades to its rim, at these places of its middle."""
    half = max(round(0.5 * spot / GRID), 1)
    across = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (half + 1)) ** 2
    mean = np.convolve(np.pad(what, half, mode="edge"), across / across.sum(), "valid")
    return np.asarray(np.interp(places, np.arange(len(what)) * GRID, mean))


def _read(
    rng: np.random.Generator, sensor: _Sensor, lines: Array, places: Array, sun: Array | float, floor: Array
) -> Array:
    own = sensor.own * (1.0 - lines * (1.0 - sensor.own_by_black))
    shining = sensor.sun * sun * (1.0 - lines * (1.0 - sensor.sun_by_black))
    light = sensor.leak + _seen(floor * (own + shining), places, sensor.spot)
    return np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(places))), 0.0, 4095.0)


def _spiked(rng: np.random.Generator, counts: Array, row: Row) -> Array:
    odd = rng.random(len(counts)) < row.spikes
    return np.asarray(np.where(odd, rng.integers(0, 4096, len(counts)), counts))
