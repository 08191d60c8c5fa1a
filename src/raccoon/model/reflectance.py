"""Reflectance sensor (tophat): its readings over white and black, near and far, indoors and in the sun.

A phototransistor pulls the converter's input down against a resistor, so light lowers the reading:

    counts = 4095 / (1 + x)

x is the light in units of the light that halves the reading. It is a sum of three parts,

    x = R(h) (1 - d (1 - r))  +  L  +  a S(h) (1 - d (1 - s))

    R(h) = R7 (7 mm / h)^n      the sensor's own light that white paper returns at height h
    d                           darkness: the share of the spot that lies on black, 0..1
    r                           what black tape returns of it, as a share of white
    L                           cross-talk inside the sensor and light that never reached the floor
    a S(h), S(h) = S7 (h / 7 mm)^m    the sun: a = 0 is the paper's normal light, a = 1 its direct sunlight
    s                           black tape's share of the sun's light: far above r, so contrast collapses

Each sensor generation has seven parameters and eight readings in the paper's Tables II and III (`fit`, closed
form). Light adds up (from the white and the black part of the spot, from LED and sun), so the four readings
indoors give R7, n, r and L exactly, and the four readings in the sun, minus those, give S7, m and s by least
squares in logarithms. One degree of freedom per generation is left; its residual is below 1 count. The paper
does not state the size of the spot that the sensor sees: the radius below is an assumption and a parameter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.readings import ANALOG_FULL_SCALE
from raccoon.model.paper import TophatReading, tophat_reading

FULL_SCALE = float(ANALOG_FULL_SCALE)
GENERATIONS = ("old", "new")
NEAR_HEIGHT, FAR_HEIGHT = 0.007, 0.023  # m, the heights of Tables II and III
MIN_HEIGHT, MAX_HEIGHT = 0.002, 0.06  # m; nearer, the light misses the receiver and the law of R(h) ends
AMBIENT = {"normal": 0.0, "sun": 1.0}
"""Ambient level of the paper's two lights."""
LINE_WIDTH, DISTANCE_PER_READING = 0.015, 0.24 / 200.0  # m, of a simulated calibration drive at 0.24 m/s
TEXTURE = 0.02  # relative standard deviation of the floor's brightness between readings

Number = TypeVar("Number", float, NDArray[np.float64])
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Optics:
    """A sensor at one height, as plain numbers for compiled code.

    reflected: R(h). reflected_by_black: r. leak: L. sun: S(h). sun_by_black: s (see the module).
    """

    reflected: float
    reflected_by_black: float
    leak: float
    sun: float
    sun_by_black: float

    def light(self, darkness: Number, ambient: Number | float = 0.0) -> Number:
        """x for darkness 0..1 and ambient level (0 normal light, 1 direct sun); floats or arrays."""
        own = self.reflected * (1.0 - darkness * (1.0 - self.reflected_by_black))
        return own + self.leak + ambient * self.sun * (1.0 - darkness * (1.0 - self.sun_by_black))

    def counts(self, darkness: Number, ambient: Number | float = 0.0) -> Number:
        """Reading without noise, 0..4095, not rounded; floats or arrays."""
        return FULL_SCALE / (1.0 + self.light(darkness, ambient))


@dataclass(frozen=True, slots=True)
class SensorModel:
    """A sensor generation: the seven fitted numbers. Light in units of x, exponents without unit."""

    generation: str
    reflected_near: float
    falloff: float
    reflected_by_black: float
    leak: float
    sun_near: float
    sun_exponent: float
    sun_by_black: float

    def at(self, height: float, gain: float = 1.0) -> Optics:
        """The sensor `height` m above the floor. gain: that of its LED and receiver over the measured
        sensor's.

        Raises ConfigError for a height outside 2..60 mm or a gain that is not above 0.
        """
        if not MIN_HEIGHT <= height <= MAX_HEIGHT:
            raise ConfigError(f"height = {height} m: allowed are numbers from {MIN_HEIGHT} to {MAX_HEIGHT}")
        if not (gain > 0.0 and math.isfinite(gain)):
            raise ConfigError(f"gain = {gain}: allowed are numbers above 0")
        return Optics(
            reflected=gain * self.reflected_near * (NEAR_HEIGHT / height) ** self.falloff,
            reflected_by_black=self.reflected_by_black,
            leak=gain * self.leak,
            sun=gain * self.sun_near * (height / NEAR_HEIGHT) ** self.sun_exponent,
            sun_by_black=self.sun_by_black,
        )


def light_of(counts: float) -> float:
    """x of a reading: the inverse of counts = 4095 / (1 + x), finite for any reading."""
    return FULL_SCALE / max(counts, 1.0) - 1.0


@cache
def fit(generation: str) -> SensorModel:
    """The model of a sensor generation ("old" or "new"), from the paper's tables (see the module).

    Raises ConfigError for another generation.
    """
    if generation not in GENERATIONS:
        raise ConfigError(f"generation = {generation!r}: allowed are {', '.join(GENERATIONS)}")
    near, far = (tophat_reading(generation, height, "normal") for height in (NEAR_HEIGHT, FAR_HEIGHT))
    white, black = light_of(near.white), light_of(near.black)
    white_far, black_far = light_of(far.white), light_of(far.black)
    # Differences over height drop L: r = (black - black_far) / (white - white_far).
    by_black = (black - black_far) / (white - white_far)
    reflected = (white - black) / (1.0 - by_black)
    reflected_far = (white_far - black_far) / (1.0 - by_black)
    sun_near, sun_exponent, sun_by_black = _fit_sun(generation)
    return SensorModel(
        generation=generation,
        reflected_near=reflected,
        falloff=math.log(reflected / reflected_far) / math.log(FAR_HEIGHT / NEAR_HEIGHT),
        reflected_by_black=by_black,
        leak=white - reflected,
        sun_near=sun_near,
        sun_exponent=sun_exponent,
        sun_by_black=sun_by_black,
    )


def _fit_sun(generation: str) -> tuple[float, float, float]:
    """(S7, m, s): log of the added light = log S7 + m log(h/7mm) + [black] log s, by least squares."""
    near, far = (tophat_reading(generation, height, "sun") for height in (NEAR_HEIGHT, FAR_HEIGHT))
    dim_near, dim_far = (tophat_reading(generation, height, "normal") for height in (NEAR_HEIGHT, FAR_HEIGHT))
    white, white_far, black, black_far = (
        math.log(light_of(bright) - light_of(dim))
        for bright, dim in (
            (near.white, dim_near.white),
            (far.white, dim_far.white),
            (near.black, dim_near.black),
            (far.black, dim_far.black),
        )
    )
    rise = 0.5 * (white_far - white + black_far - black)
    by_black = 0.5 * (black - white + black_far - white_far)
    level = 0.25 * (white + white_far + black + black_far) - 0.5 * rise - 0.5 * by_black
    return math.exp(level), rise / math.log(FAR_HEIGHT / NEAR_HEIGHT), math.exp(by_black)


def counts(darkness: Number, generation: str, height: float, ambient: Number | float = 0.0) -> Number:
    """Reading without noise for darkness 0..1, generation, height (m) and ambient level; floats or arrays.

    Raises ConfigError for an unknown generation or a height outside 2..60 mm.
    """
    return fit(generation).at(height).counts(darkness, ambient)


def height_doubt(height: float) -> float:
    """Standard deviation, m, of a height derived from two readings, since the law between and beyond the two
    measured heights is unknown.

    A power law and an exponential law both pass through the measured heights and differ by up to 340 counts.
    Of two equally likely laws, the standard deviation is their difference over the square root of 2.
    """
    exponential = NEAR_HEIGHT + (FAR_HEIGHT - NEAR_HEIGHT) * math.log(height / NEAR_HEIGHT) / math.log(
        FAR_HEIGHT / NEAR_HEIGHT
    )
    return abs(exponential - height) / math.sqrt(2.0)


def black_doubt(generation: str, height: float) -> float:
    """Uncertainty of black, counts, at a height (m) derived from white. That black's light (tape and
    cross-talk) follows white's is known only at the two measured heights; the uncertainty is the difference
    to a power law of the height fitted to black alone."""
    near, far, here = (fit(generation).at(each) for each in (NEAR_HEIGHT, FAR_HEIGHT, height))
    share = math.log(height / NEAR_HEIGHT) / math.log(FAR_HEIGHT / NEAR_HEIGHT)
    own = near.light(1.0) * (far.light(1.0) / near.light(1.0)) ** share
    return float(abs(FULL_SCALE / (1.0 + own) - here.counts(1.0)))


def spot_radius(height: float) -> float:
    """Radius of the floor disc that the sensor sees, m. An assumption: 1.5 mm plus 0.15 of the height."""
    return 0.0015 + 0.15 * height


def edge_coverage(distance: Array, radius: float) -> Array:
    """Share of a disc that lies beyond a straight edge whose distance from its centre is `distance` (m).

    distance is positive while the centre has not reached the edge: 0.5 on the edge, 0 from `radius` on.
    A segment of a unit circle at height t has the area acos(t) - t sqrt(1 - t^2).
    """
    t = np.clip(distance / radius, -1.0, 1.0)
    return np.asarray((np.arccos(t) - t * np.sqrt(1.0 - t * t)) / np.pi)


def line_coverage(position: Array, centre: float, width: float, radius: float) -> Array:
    """Share of the spot on a line across the path, for the positions of the spot's centre (all m)."""
    along = position - centre
    return edge_coverage(-0.5 * width - along, radius) - edge_coverage(0.5 * width - along, radius)


def read(
    rng: np.random.Generator,
    darkness: Array,
    optics: Optics,
    *,
    ambient: Array | float = 0.0,
    noise: float = 3.0,
) -> Array:
    """Readings of the converter: integer counts in 0..4095.

    darkness: share of the spot on black, shape (n,). noise: standard deviation of a sensor at rest, counts
    (2..5 measured).
    """
    patchy = optics.light(darkness, ambient) * np.exp(TEXTURE * rng.standard_normal(darkness.shape))
    exact = FULL_SCALE / (1.0 + patchy) + noise * rng.standard_normal(darkness.shape)
    return np.asarray(np.clip(np.round(exact), 0.0, FULL_SCALE))


def drive_over_line(
    rng: np.random.Generator,
    condition: TophatReading,
    *,
    distance: float = 0.6,
    noise: float = 3.0,
    gain: float = 1.0,
) -> tuple[Array, Array]:
    """A calibration drive across one black line on white, in one of the paper's conditions.

    Returns (samples, darkness), both of shape (n,): the counts in order of time, and the true share of the
    spot on black (0 white, 1 black, between at the edges). The position of the line is random, not near the
    ends. distance: m. noise: counts.
    """
    radius = spot_radius(condition.height)
    position = np.arange(0.0, distance, DISTANCE_PER_READING)
    darkness = line_coverage(position, rng.uniform(0.2, 0.8) * distance, LINE_WIDTH, radius)
    optics = fit(condition.generation).at(condition.height, gain)
    samples = read(rng, darkness, optics, ambient=AMBIENT[condition.light], noise=noise)
    return samples, darkness
