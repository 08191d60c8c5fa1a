"""Did the light change, or the surface? A bank of Kalman filters, one for each story that could be true.

A sensor is over white, over black, or on the way across an edge (`STAGES` steps each way); the light stands,
moves or jumps. That makes a Markov chain of stories. Each carries the light over white and over black
(u and v, see `levels`) with its covariance, and the probability of everything read so far; a step joins what
arrives at the same story from different ones (a second-order generalised pseudo-Bayes filter: Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 11.6).

What tells an edge from light is how far the robot went meanwhile: an edge is as long as the sensor's spot is
wide, and ends where black is known to be. Light takes its own time and ends anywhere. Where that leaves two
stories, they are kept until readings tell: one more edge does, since black has to be as much darker as the
ratio of the two allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat.calibration import FULL_SCALE
from raccoon.model.reflectance import edge_coverage

Array = NDArray[np.float64]
Index = NDArray[np.intp]

STAGES = 6  # of an edge
FASTEST = 4  # stages in one reading
PACE_SPREAD, LEAST_SPREAD = 0.3, 0.35  # of the stages in one reading: speed and spot are known roughly
STANDS = 0.003  # of u, sd of its change in one reading while the light stands
PACES = (0.06, 0.4)  # of u, sd of the change in one reading where the light begins to move
SUNLIGHT = 15.0  # sd of that change where the sun comes out at once, light
BEGINS, ENDS = (1.0 / 1500, 1.0 / 4000, 1.0 / 4000), 1.0 / 30  # chance in one reading that it does, or stops
UNEVEN = 0.15  # of the pace, sd by which it changes from one reading to the next
WITH_OTHERS = {None: 1.0, True: 8.0, False: 0.5}  # times likelier, by whether other sensors are at a loss
BETWEEN_LINES, LINE_WIDTH = 0.2, 0.05  # m, on the average
LEAST_WAY = 5e-5  # m a reading: a standing robot may still be pushed
MOST_PACE = 3.3
STRAY = 1e-6  # density of a reading that means nothing, in units of 1 / the least u
MISTAKEN = 0.02  # probability that the surface was taken for the other one before
ON_EDGE, PUT_DOWN = 1e-4, 0.02  # probability of each stage of an edge at the start, and of a robot put down
LEAK = 0.03  # light that a sensor gets whatever is below it
LIGHTS = 2  # standing, moving
PHASES = 2 + 2 * STAGES
STORIES = PHASES * LIGHTS

_coverage = edge_coverage(1.0 - 2.0 * (np.arange(STAGES) + 0.5) / STAGES, 1.0)
DARKNESS: Array = np.concatenate([[0.0, 1.0], _coverage, _coverage[::-1]])
"""Share of the spot on black by phase: white, black, entering, leaving."""
_MORE_BLACK: Array = (DARKNESS[2:] > 0.5).astype(float)
_GROUP: Index = np.repeat(np.minimum(np.arange(PHASES), 2), LIGHTS)


class Belief(NamedTuple):
    """u and v with their covariance, and the surface they were last read on (None: not known)."""

    light: float
    dark: float
    light_var: float
    cross: float
    dark_var: float
    on_black: bool | None


class Sensor(NamedTuple):
    """What does not change: share q of ambient light that black sends back and its sd, the least u and v, the
    spot (m), the noise: a share of the light, and counts."""

    share: float
    share_sd: float
    floor: float
    least_dark: float
    spot: float
    pattern: float
    noise: float


class _Moves(NamedTuple):
    """Every step from story to story: where from, where to, by how many stages (-1: none), how light went."""

    source: Index
    target: Index
    stages: Index
    change: Index
    from_white: NDArray[np.bool_]
    on_edge: NDArray[np.bool_]
    moves_on: Array
    part: Array
    uneven: Array
    wander: Array
    pace: Array
    sun: Array
    white_part: Array
    black_part: Array
    blur: Array


# What light does from one reading to the next: from, to, sd of its change and of its pace in shares of u and
# of its pace in light, and the part of the pace by which it changes with the variance of that. It stops
# anywhere between two readings.
_CHANGES = (
    (0, 0, STANDS, 0.0, 0.0, 0.0, 0.0),
    (0, 1, 0.0, PACES[0], 0.0, 1.0, 0.0),
    (0, 1, 0.0, PACES[1], 0.0, 1.0, 0.0),
    (0, 1, 0.0, 0.0, SUNLIGHT, 1.0, 0.0),
    (1, 1, 0.0, 0.0, 0.0, 1.0, UNEVEN**2),
    (1, 0, STANDS, 0.0, 0.0, 0.5, 1.0 / 12.0),
)


@lru_cache(maxsize=1)
def _moves() -> _Moves:
    steps = [(phase, phase, -1) for phase in (0, 1)]
    for surface, first, end in ((0, 2, 1), (1, 2 + STAGES, 0)):
        steps += [(surface, first + k - 1, k) for k in range(1, FASTEST + 1)]
        for stage in range(STAGES):
            for k in range(FASTEST + 1):
                steps.append((first + stage, first + stage + k if stage + k < STAGES else end, k))
    ways = np.array([(*step, change) for step in steps for change in range(len(_CHANGES))], dtype=np.intp)
    source, target, stages, change = ways.T
    before, after, wander, pace, sun, part, uneven = np.array(_CHANGES).T
    dark = DARKNESS[target]
    return _Moves(
        source=source * LIGHTS + before[change].astype(np.intp),
        target=target * LIGHTS + after[change].astype(np.intp),
        stages=stages,
        change=change,
        from_white=source == 0,
        on_edge=source > 1,
        moves_on=after[change],
        part=part[change],
        uneven=uneven[change],
        wander=wander[change] ** 2,
        pace=pace[change] ** 2,
        sun=sun[change] ** 2,
        white_part=1.0 - dark,
        black_part=dark,
        blur=np.where((dark > 0.0) & (dark < 1.0), 0.3 / STAGES, 0.0),
    )


@lru_cache(maxsize=128)
def _chances(pace_tenths: int, spot_microns: int, others_lost: bool | None) -> Array:
    """Probability of every move at a pace (stages a reading)."""
    moves = _moves()
    pace = 0.1 * pace_tenths
    way = pace * 1e-6 * spot_microns / STAGES
    number = np.arange(FASTEST + 1)
    advance = np.exp(-0.5 * ((number - pace) / (PACE_SPREAD * pace + LEAST_SPREAD)) ** 2)
    advance /= advance.sum()
    rate = np.where(moves.from_white, min(way / BETWEEN_LINES, 0.1), min(way / LINE_WIDTH, 0.2))
    along = advance[moves.stages]
    entering = rate * along / (1.0 - advance[0])
    chance = np.where(moves.stages < 0, 1.0 - rate, np.where(moves.on_edge, along, entering))
    begins = WITH_OTHERS[others_lost] * np.array(BEGINS)
    changes = np.array([1.0 - begins.sum(), *begins, 1.0 - ENDS, ENDS])
    return np.asarray(chance * changes[moves.change])


class Hypotheses:
    """The bank. Begin it where all was clear and feed it every reading since.

    black: P(more of the spot is on black). sure: P(the likeliest of white, black and edge).
    steady: P(the light stands and no edge is being crossed). on_edge: an edge is likelier than the surfaces.
    """

    def __init__(self, sensor: Sensor, start: Belief) -> None:
        self._sensor = sensor
        self._start = start.light
        story = (
            1e-30,
            start.light,
            start.dark,
            0.0,
            start.light_var,
            start.cross,
            start.dark_var,
            0.0,
            0.0,
            0.0,
        )
        self._stories = np.repeat(np.array(story)[:, np.newaxis], STORIES, axis=1)
        self._stories[0, 2 * LIGHTS :: LIGHTS] = PUT_DOWN if start.on_black is None else ON_EDGE
        if start.on_black is None:
            self._stories[0, ::LIGHTS] = 1.0
        else:
            self._stories[0, LIGHTS * start.on_black] = 1.0
            self._doubt(start)
        self.black = 0.5 if start.on_black is None else float(start.on_black)
        self.steady = self.sure = 0.0
        self.on_edge = False

    def _doubt(self, start: Belief) -> None:
        """The other story from the start on: that the surface had been taken for the other one."""
        sensor = self._sensor
        if start.on_black:
            light, other = start.dark, 0
            dark = max(start.dark + sensor.share * (light - start.light), sensor.least_dark)
            if light < sensor.floor:
                return
        else:
            dark, other = start.light, LIGHTS
            light = start.light + (dark - start.dark) / sensor.share
        own = (0.02 * (light if start.on_black else dark)) ** 2
        unsure = (2.0 * sensor.share_sd * (light - start.light)) ** 2
        if start.on_black:
            moments = own, sensor.share * own, sensor.share**2 * own + unsure
        else:
            moments = (own + unsure) / sensor.share**2, own / sensor.share, own
        self._stories[:7, other] = MISTAKEN, light, dark, 0.0, *moments

    def update(self, counts: float, way: float, others_lost: bool | None = None) -> None:
        """Take a reading; way: m driven over the floor since the one before."""
        sensor, moves = self._sensor, _moves()
        steps = min(max(way, LEAST_WAY) * STAGES / sensor.spot, MOST_PACE)
        chance = _chances(round(10.0 * steps), round(1e6 * sensor.spot), others_lost)
        seen = FULL_SCALE / max(counts, 1.0) - 1.0
        share = sensor.share
        weight, light, dark, pace, uu, uv, vv, up, vp, pp = self._stories[:, moves.source]
        # Predict: light moves u by its pace and v by the share of that, which is known to its sd alone.
        part = moves.part
        scale = light * light
        pp = part * part * pp + moves.sun + moves.pace * scale + moves.uneven * pace * pace
        up, vp, pace = part * up, part * vp, part * pace
        wander = moves.wander * scale
        uu = uu + 2.0 * up + pp + wander
        uv = uv + share * (up + pp + wander) + vp
        vv = vv + share * (2.0 * vp + share * (pp + wander))
        gone = light - self._start
        vv += np.maximum(sensor.share_sd**2 * pace * (2.0 * gone + pace), 0.0)
        light, dark = light + pace, dark + share * pace
        on = moves.moves_on
        pace, pp, up, vp = on * pace, on * pp, on * (up + pp), on * (vp + share * pp)
        # Update: the reading is what white and black send back, each of its part of the spot.
        a, b = moves.white_part, moves.black_part
        expected = a * light + b * dark
        to_u, to_v, to_p = a * uu + b * uv, a * uv + b * vv, a * up + b * vp
        variance = a * to_u + b * to_v
        noise = (sensor.pattern * seen) ** 2 + (sensor.noise / FULL_SCALE * (1.0 + seen) ** 2) ** 2
        variance += noise + (moves.blur * (light - dark)) ** 2
        miss = (seen - expected) / variance
        density = np.exp(-0.5 * miss * miss * variance) / np.sqrt(variance) + STRAY / sensor.floor
        light += to_u * miss
        dark += to_v * miss
        pace += to_p * miss
        inverse = 1.0 / variance
        uu -= to_u * to_u * inverse
        uv -= to_u * to_v * inverse
        vv -= to_v * to_v * inverse
        rest = up - to_u * to_p * inverse, vp - to_v * to_p * inverse, pp - to_p * to_p * inverse
        # No less light than the sensor's own. Black sends back its share of any light, or less: where a story
        # says more, it is as likely as it can be wrong by so much, and goes on from where it is not.
        short = np.minimum(light / sensor.floor - 1.0, 0.0)
        most = share + 2.0 * sensor.share_sd
        over = np.maximum(dark - most * light - LEAK, 0.0)
        to_light, to_dark = uv - most * uu, vv - most * uv
        over_var = to_dark - most * to_light + 1e-4 * light * light
        by = over / over_var
        weight = weight * chance * density * np.exp(-50.0 * short * short - 0.5 * over * by)
        light = np.maximum(light - to_light * by, 0.5 * sensor.floor)
        dark = np.clip(dark - to_dark * by, sensor.least_dark, 0.97 * light)
        self._join(weight, (light, dark, pace), (uu, uv, vv, *rest))

    def _join(self, weight: Array, means: Sequence[Array], covariance: Sequence[Array]) -> None:
        """One Gaussian a story, with the moments of all that arrive at it."""
        at = _moves().target
        weight /= weight.sum()
        weight += 1e-30  # a story that nothing speaks for still has a place
        total = np.bincount(at, weight, STORIES)
        joined = [np.bincount(at, weight * each, STORIES) / total for each in means]
        u, v, p = (each - mean[at] for each, mean in zip(means, joined, strict=True))
        spread = (u * u, u * v, v * v, u * p, v * p, p * p)
        joined += [
            np.bincount(at, weight * (each + apart), STORIES) / total
            for each, apart in zip(covariance, spread, strict=True)
        ]
        self._stories = np.stack([total, *joined])
        by_phase = total.reshape(PHASES, LIGHTS)
        phases = by_phase.sum(axis=1)
        white, black = float(phases[0]), float(phases[1])
        self.black = black + float(phases[2:] @ _MORE_BLACK)
        self.sure = max(white, black, 1.0 - white - black)
        self.on_edge = white + black < 0.5
        self.steady = float(by_phase[:2, 0].sum())

    def best(self) -> Belief:
        """The mean of the stories of the likeliest of white, black and edge."""
        weight = self._stories[0].copy()
        likely = weight[:LIGHTS].sum(), weight[LIGHTS : 2 * LIGHTS].sum(), weight[2 * LIGHTS :].sum()
        group = int(np.argmax(likely))
        weight[group != _GROUP] = 0.0
        weight /= weight.sum()
        on_black = self.black > 0.5
        _, u, v, _, uu, uv, vv, _, _, _ = self._stories
        light, dark = float(weight @ u), float(weight @ v)
        off_u, off_v = u - light, v - dark
        return Belief(
            light,
            dark,
            float(weight @ (uu + off_u * off_u)),
            float(weight @ (uv + off_u * off_v)),
            float(weight @ (vv + off_v * off_v)),
            on_black,
        )


def usual_spot(height: float) -> float:
    """m: width of what a sensor sees at a height (see raccoon.model.reflectance.spot_radius)."""
    from raccoon.model.reflectance import spot_radius

    return 2.0 * spot_radius(height)


def pattern_of(variance: float, light: float, converter: float) -> float:
    """The floor's pattern as a share of its light, from the variance (counts^2) of readings over white."""
    slope = (1.0 + light) ** 2 / FULL_SCALE
    return min(max(math.sqrt(max(variance - converter, 0.0)) * slope / light, 0.01), 0.08)
