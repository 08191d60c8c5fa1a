"""How often the start light is wrong in rooms made to mislead it: `python benchmarks/start_light_rooms.py`.

Eight seconds without the lamp, in which the sun comes and goes, people pass, sleeves, flashes, mains flicker
and a neighbour's lamp disturb; then the lamp, on at once, as a bulb, or as a slow bulb. Four kinds of rooms,
`--draws` of each, uncalibrated and calibrated. A false start is one before the lamp.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.start_light import StartLight, StartLightCalibration

Array = NDArray[np.float64]

LAMP = 8.0
"""s, when the lamp comes on."""
WAIT = 3.0
"""s within which it must be seen."""
KINDS = ("drift", "flicker", "sun", "leave", "people", "sleeve", "flash", "neighbour")
ROOMS: dict[str, tuple[str, ...] | None] = {
    "sun": ("sun",),
    "sun, shade goes": ("sun", "leave"),
    "sun, shade goes, people": ("sun", "leave", "people"),
    "half of everything": None,
}
LAMPS = ("at once", "bulb", "slow bulb")


def main() -> None:
    """A row for each kind of room, without and with a calibration."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--draws", type=int, default=200, help="rooms of each kind")
    parser.add_argument("--seed", type=int, help="fresh unless given")
    parser.add_argument("--rate", type=float, default=200.0, help="readings a second")
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}")
    for calibrated in (False, True):
        false, missed = 0, Counter[str]()
        for room, kinds in ROOMS.items():
            for draw in range(args.draws):
                rng = np.random.default_rng([seed, len(room), draw])
                lamp, delay = _started(rng, kinds, args.rate, calibrated)
                false += delay is not None and delay < 0.0
                missed[lamp] += delay is None
        said = ", ".join(f"{missed[each]} {each}" for each in LAMPS)
        title = "calibrated" if calibrated else "without calibration"
        print(f"{title}, {args.draws * len(ROOMS)} rooms: {false} false starts; missed: {said}", flush=True)


def _started(
    rng: np.random.Generator, kinds: tuple[str, ...] | None, rate: float, calibrated: bool
) -> tuple[str, float | None]:
    """The kind of lamp, and s after it came on that the start was told; None: never."""
    if kinds is None:
        kinds = tuple(each for each in KINDS if rng.random() < 0.5)
    at = np.arange(0.0, LAMP + WAIT, 1.0 / rate)
    light = _ambient(rng, at, kinds)
    kind = str(rng.choice(LAMPS))
    constants = {"at once": 1e-4, "bulb": rng.uniform(0.02, 0.1), "slow bulb": rng.uniform(0.25, 0.7)}
    lamp = rng.uniform(8.0, 40.0)
    warm = 1.0 - np.exp(-np.maximum(at - LAMP, 0.0) / constants[kind])
    light = light + lamp * np.where(at >= LAMP, warm, 0.0)
    counts = np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(at))), 0.0, 4095.0)
    calibration = StartLightCalibration(3000.0, 4095.0 / (1.365 + lamp)) if calibrated else None
    detector = StartLight(calibration)
    fired = (t for t, each in zip(at, counts, strict=True) if detector.update(float(t), float(each)).fired)
    time = next(fired, None)
    return kind, None if time is None else float(time) - LAMP


def _edge(rng: np.random.Generator, at: Array, begin: float, seconds: float) -> Array:
    """From 0 to 1 within `seconds`, in one of several ways."""
    share = np.clip((at - begin) / seconds, 0.0, 1.0)
    ways = (
        share,
        share * share * (3.0 - 2.0 * share),
        np.sin(0.5 * math.pi * share),
        share**3 * (share * (6.0 * share - 15.0) + 10.0),
        share ** rng.uniform(1.0, 3.0),
    )
    return np.asarray(ways[int(rng.integers(len(ways)))], float)


def _passing(rng: np.random.Generator, at: Array, longest_edge: float) -> Array:
    """Somebody comes, stays for up to 3 s and goes: 0 to 1 to 0."""
    begin, stays, edge = rng.uniform(0.0, 8.0), rng.uniform(0.1, 3.0), rng.uniform(0.03, longest_edge)
    return _edge(rng, at, begin, edge) * (1.0 - _edge(rng, at, begin + stays, edge))


def _ambient(rng: np.random.Generator, at: Array, kinds: tuple[str, ...]) -> Array:
    """The light without the lamp, in units in which a reading is 4095 / (1 + light)."""
    room = rng.uniform(0.1, 0.6) * np.ones(len(at))
    if "drift" in kinds:
        room *= np.exp(rng.uniform(-0.1, 0.1) * at)
    if "flicker" in kinds:
        rate = rng.choice([49.9, 99.9, 100.0, 100.1, 119.9, 120.0, 120.2, 199.5, 200.2])
        room *= 1.0 + rng.uniform(0.1, 0.5) * np.sin(2.0 * math.pi * rate * at + rng.uniform(0.0, 6.0))
    light = room + (_sun(rng, at) if "sun" in kinds else 0.0)
    if "leave" in kinds:
        shade = rng.uniform(0.3, 0.9)
        light = light * (1.0 - shade * (1.0 - _edge(rng, at, rng.uniform(0.5, 7.0), rng.uniform(0.05, 1.6))))
    if "people" in kinds:
        for _ in range(int(rng.integers(1, 5))):
            light = light * (1.0 - rng.uniform(0.2, 0.9) * _passing(rng, at, 0.8))
    if "sleeve" in kinds:
        light = light * (1.0 + 0.4 * _passing(rng, at, 0.5))
    if "flash" in kinds:
        for _ in range(int(rng.integers(1, 12))):
            begin, bright = rng.uniform(0.05, 7.6), rng.uniform(1.0, 40.0)
            for pulse in range(int(rng.integers(1, 4))):
                on = begin + pulse * rng.uniform(0.02, 0.12)
                light = light + bright * ((at >= on) & (at < on + rng.uniform(0.002, 0.025)))
    if "neighbour" in kinds:
        light = light + room * rng.uniform(0.1, 0.7) * (at > rng.uniform(0.6, 7.0))
    return np.asarray(light, float)


def _sun(rng: np.random.Generator, at: Array) -> Array:
    """The sun, which comes out of clouds and may go behind others."""
    begin = rng.uniform(0.3, 7.5)
    clear = _edge(rng, at, begin, rng.uniform(0.5, 4.0))
    if rng.random() < 0.5:
        cloud = _edge(rng, at, begin + rng.uniform(1.0, 4.0), rng.uniform(0.5, 3.0))
        clear = clear * (1.0 - rng.uniform(0.2, 1.0) * cloud)
    return np.asarray(np.exp(rng.uniform(math.log(0.5), math.log(20.0))) * clear, float)


if __name__ == "__main__":
    main()
