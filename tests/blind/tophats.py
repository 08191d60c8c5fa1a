"""Recordings of a tophat written apart from the package: its own law of height, floor and edges.

The sensor's own light falls with the square of its distance from a point behind the lens (the package's falls
with a power of the height), through the readings of the paper at 7 and at 23 mm. The floor is brighter here
and darker there, edges take the time that the spot needs, and the robot's speed wanders.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

READINGS: Mapping[str, Mapping[float, tuple[float, float, float, float]]] = {
    "new": {7.0: (1270, 3800, 140, 250), 23.0: (3440, 4030, 130, 220)},
    "old": {7.0: (180, 2930, 50, 170), 23.0: (1830, 3810, 50, 130)},
}
"""Of each make, by height in mm: white and black indoors, white and black in direct sun (paper, Tables II and
III)."""
NEAR, FAR = 7.0, 23.0
SPOT = 0.0025
"""m, radius of what the sensor sees."""
GRAIN = 0.002
"""m, how far from each other two places are whose brightness has nothing in common."""


def light(make: str, height: float, black: Array, sun: Array | float) -> Array:
    """Light in units of that which halves the reading. height in m. black: share of the spot. sun: share of
    direct sun."""
    near, far = (np.array([4095.0 / each - 1.0 for each in READINGS[make][at]]) for at in (NEAR, FAR))
    share = (near[1] - far[1]) / (near[0] - far[0])
    own_near, own_far = ((each[0] - each[1]) / (1.0 - share) for each in (near, far))
    leak = near[0] - own_near
    root = np.sqrt(own_near / own_far)
    behind = (FAR - NEAR * root) / (root - 1.0)
    own = own_near * ((NEAR + behind) / (1000.0 * height + behind)) ** 2
    part = (1000.0 * height - NEAR) / (FAR - NEAR)
    suns = [(1.0 - part) * (near[2 + k] - near[k]) + part * (far[2 + k] - far[k]) for k in (0, 1)]
    over_white, over_black = (
        own * of + leak + sun * each for of, each in zip((1.0, share), suns, strict=True)
    )
    return np.asarray((1.0 - black) * over_white + black * over_black)


def lines(rng: np.random.Generator, way: Array) -> Array:
    """Share of the spot on black along a way (m) over black lines of 2 to 6 cm."""
    black, place = np.zeros_like(way), rng.uniform(0.05, 0.2)
    while place < way[-1] + 0.1:
        end = place + rng.uniform(0.02, 0.06)
        black += np.clip((way - place) / (2.0 * SPOT) + 0.5, 0.0, 1.0)
        black -= np.clip((way - end) / (2.0 * SPOT) + 0.5, 0.0, 1.0)
        place = end + rng.uniform(0.1, 0.35)
    return black


def tophat(
    seed: int,
    *,
    make: str = "new",
    height: float = 0.007,
    offset: float = 0.0,
    factor: float = 1.0,
    sun: float = 0.0,
    noise: float = 3.0,
    seconds: float = 20.0,
    rate: float = 200.0,
    grain: float = 0.02,
    held: bool = False,
    changing: Callable[[Array], Array] | None = None,
) -> dict[str, Array]:
    """A recording of port 2. held: over white, black, white and black instead of a drive over lines, each on
    one place. changing: further share of direct sun over the time. grain: how uneven the floor is."""
    rng = np.random.default_rng(seed)
    count = int(seconds * rate)
    time = np.arange(count) / rate
    if held:
        black = (time // (0.25 * seconds)) % 2.0
        floor = np.exp(grain * rng.standard_normal(4))[np.asarray(time // (0.25 * seconds), int)]
    else:
        speed = np.clip(0.17 + 0.03 * np.cumsum(rng.standard_normal(count)) / np.sqrt(rate), 0.08, 0.24)
        way = np.cumsum(speed) / rate
        black = lines(rng, way)
        places = np.arange(0.0, way[-1] + 2.0 * GRAIN, GRAIN)
        floor = np.exp(grain * np.interp(way, places, rng.standard_normal(len(places))))
    shining = sun + (np.zeros(count) if changing is None else changing(time))
    clean = factor * 4095.0 / (1.0 + floor * light(make, height, black, shining)) + offset
    return {
        "t": time,
        "analog.2": np.clip(np.round(clean + noise * rng.standard_normal(count)), 0.0, 4095.0),
        "truth.surface.2": (black > 0.5).astype(float),
    }
