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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat.modes import (
    BETWEEN_LINES,
    GROUP,
    LIGHTS,
    LINE_WIDTH,
    MORE_BLACK,
    OTHER,
    PHASES,
    STAGES,
    STEPS,
    STORIES,
    SUNLIGHT,
    chances,
    moves_of_stories,
)
from raccoon.model.reflectance import FULL_SCALE, light_of, spot_radius

Array = NDArray[np.float64]

STEPPING = 3  # the group of the stories on the way to another floor
LEAST_WAY = 5e-5  # m a reading: a standing robot may still be pushed
MOST_PACE = 3.3
STRAY = 1e-6  # density of a reading that means nothing, in units of 1 / the least u
OTHER_LIGHT = 0.1  # odds that a robot is put down in another light than the one that is known
MISTAKEN = 1e-4  # probability that the surface was taken for the other one before
ON_EDGE = 1e-4  # probability of each stage of an edge at the start
OTHER_FLOOR = 1.2, 0.6  # of u, mean and sd of that of another floor: boards are darker, glare is brighter
LEAST_FLOOR = 0.5  # of u, that another floor sends back; boards have 0.65 and more
UNEVEN_FLOOR = 0.03  # of its light, sd by which the floor that comes back differs from what it was
LEAK = 0.03  # light that a sensor gets whatever is below it


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

    def higher(self, least: float) -> Sensor:
        """The same where white may send back as little as `least` of its own light, and black its share."""
        share = min(least / self.floor, 1.0)
        return self._replace(floor=share * self.floor, least_dark=share * self.least_dark)


class Hypotheses:
    """The bank. Begin it where all was clear and feed it every reading since.

    black: P(more of the spot is on black). sure: P(the likeliest of white, black and edge).
    steady: P(the light stands and no edge is being crossed). on_edge: an edge is likelier than the surfaces.
    home: the levels to which the floor may come back (None: those of the start).
    """

    def __init__(self, sensor: Sensor, start: Belief, home: Belief | None = None) -> None:
        self._sensor = sensor
        self._start, self._start_dark, self._start_var = start.light, start.dark, start.dark_var
        self._home = home or start
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
        if start.on_black is None:
            self._put_down(start)
        else:
            self._stories[0, 2 * LIGHTS : STEPS * LIGHTS : LIGHTS] = ON_EDGE
            self._stories[0, LIGHTS * start.on_black] = 1.0
            if home is not None and not start.on_black:
                self._stories[0, LIGHTS * OTHER] = 1.0
            self._doubt(start)
        self.black = 0.5 if start.on_black is None else float(start.on_black)
        self.steady = self.sure = 0.0
        self.on_edge = False

    def _put_down(self, start: Belief) -> None:
        """Nobody knows where, nor whether the light is still that of the calibration."""
        share = self._sensor.share
        self._stories[0, 2 * LIGHTS : STEPS * LIGHTS : LIGHTS] = self._sensor.spot / STAGES
        sd = math.hypot(start.light, SUNLIGHT)
        spread = sd * sd, share * sd * sd, (share**2 + self._sensor.share_sd**2) * sd * sd
        for surface, chance in enumerate((BETWEEN_LINES, LINE_WIDTH)):
            story = LIGHTS * surface
            # The known light is the story of one that moves at no pace yet: it soon is the likelier, or out.
            self._stories[0, story : story + LIGHTS] = OTHER_LIGHT * chance, chance
            self._stories[4:7, story] += spread

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

    def update(self, counts: float, way: float, others_lost: bool | None = None, known: bool = True) -> None:
        """Take a reading; way: m driven over the floor since the one before, and whether it is known."""
        sensor, moves = self._sensor, moves_of_stories()
        steps = min(max(way, LEAST_WAY) * STAGES / sensor.spot, MOST_PACE)
        chance = chances(round(10.0 * steps), round(1e6 * sensor.spot), others_lost, known)
        seen = light_of(counts)
        share = sensor.share
        stories = self._with_floors().take(moves.source, axis=1)
        weight, before, dark, pace, uu, uv, vv, up, vp, pp = stories
        # Predict: light moves u by its pace and v by the share of that, which is known to its sd alone.
        part = moves.part
        scale = before * before
        pp = part * part * pp + moves.sun + moves.pace * scale + moves.uneven * pace * pace
        up, vp, pace = part * up, part * vp, part * pace
        wander = moves.wander * scale
        uu = uu + 2.0 * up + pp + wander
        uv = uv + share * (up + pp + wander) + vp
        vv = vv + share * (2.0 * vp + share * (pp + wander))
        gone = before - self._start
        vv += np.maximum(sensor.share_sd**2 * pace * (2.0 * gone + pace), 0.0)
        means, covariance = np.empty((3, len(pace))), np.empty((6, len(pace)))
        light = np.add(before, pace, out=means[0])
        dark = np.add(dark, share * pace, out=means[1])
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
        np.add(pace, to_p * miss, out=means[2])
        inverse = 1.0 / variance
        gains = (to_u, to_u), (to_u, to_v), (to_v, to_v), (to_u, to_p), (to_v, to_p), (to_p, to_p)
        for row, was, (one, other) in zip(covariance, (uu, uv, vv, up, vp, pp), gains, strict=True):
            np.subtract(was, one * other * inverse, out=row)
        possible = self._possible(before, means, covariance)
        self._join(weight * chance * density * possible, means, covariance)

    def _with_floors(self) -> Array:
        """The stories, and behind them those that reach another floor or leave for it (`stories.Moves`): the
        light of the floor ahead is in the place of black's, and of white's where it is reached.

        What looks like another floor may be the sharp edge of a shadow: black knows half of it.
        """
        home, stories = self._home, self._stories
        arriving = stories[:, STEPS * LIGHTS : OTHER * LIGHTS : LIGHTS].copy()
        weight, light, dark, _, uu, uv, vv, up, vp, _ = arriving
        short = np.minimum(dark[:STAGES] / (LEAST_FLOOR * light[:STAGES]) - 1.0, 0.0)
        weight[:STAGES] *= np.exp(-50.0 * short * short)
        change = 0.5 * self._sensor.share * (dark - light)
        light[:], uu[:] = dark, vv
        dark[:] = np.maximum(self._start_dark + change, self._sensor.least_dark)
        vv[:] = self._start_var + change * change
        dark[STAGES:], vv[STAGES:] = home.dark, home.dark_var
        uv[:] = up[:] = vp[:] = 0.0
        leaving = stories[:, (0, OTHER * LIGHTS, OTHER * LIGHTS)]
        _, light, dark, _, _, uv, vv, _, vp, _ = leaving
        mean, sd = OTHER_FLOOR
        dark[:2], vv[:2] = mean * light[:2], (sd * light[:2]) ** 2
        dark[2], vv[2] = home.light, home.light_var + (UNEVEN_FLOOR * home.light) ** 2
        uv[:] = vp[:] = 0.0
        return np.concatenate([stories, arriving, leaving], axis=1)

    def _possible(self, before: Array, means: Array, covariance: Array) -> Array:
        """Put u and v within what is possible, and say how likely it is that they were.

        No less light than the sensor's own. Black sends back its share of any light, or less: where a story
        says more, it is as likely as it can be wrong by so much, and goes on from where it is not.
        """
        sensor, moves = self._sensor, moves_of_stories()
        (light, dark, _), (uu, uv, vv, *_) = means, covariance
        most = sensor.share + 2.0 * sensor.share_sd
        over = moves.not_stepping * np.maximum(dark - most * light - LEAK, 0.0)
        to_light, to_dark = uv - most * uu, vv - most * uv
        by = over / (to_dark - most * to_light + 1e-4 * light * light)
        unlikely = 0.5 * over * by
        if light.min() < sensor.floor:
            short, was = (np.minimum(each / sensor.floor - 1.0, 0.0) for each in (light, before))
            unlikely += 50.0 * np.maximum(short * short - was * was, 0.0)
        np.maximum(light - to_light * by, 0.5 * sensor.floor, out=light)
        darkest = 0.97 * light + moves.brighter
        np.minimum(np.maximum(dark - to_dark * by, sensor.least_dark), darkest, out=dark)
        return np.asarray(np.exp(-unlikely))

    def _join(self, weight: Array, means: Array, covariance: Array) -> None:
        """One Gaussian a story, with the moments of all that arrive at it."""
        moves = moves_of_stories()
        weight /= weight.sum()
        weight += 1e-30  # a story that nothing speaks for still has a place
        total = np.add.reduceat(weight, moves.starts)
        joined = np.zeros((10, STORIES))  # light that moves comes to no other floor
        joined[0, moves.reached] = total
        mean = np.add.reduceat(weight * means, moves.starts, axis=1) / total
        joined[1:4, moves.reached] = mean
        u, v, p = means - mean.take(moves.place, axis=1)
        for row, spread in zip(covariance, (u * u, u * v, v * v, u * p, v * p, p * p), strict=True):
            row += spread
        covariance *= weight
        joined[4:, moves.reached] = np.add.reduceat(covariance, moves.starts, axis=1) / total
        self._stories = joined
        by_phase = joined[0].reshape(PHASES, LIGHTS)
        phases = by_phase.sum(axis=1)
        white, black = float(phases[0] + phases[OTHER]), float(phases[1])
        self.black = black + float(phases[2:STEPS] @ MORE_BLACK)
        stepping = float(phases[STEPS:OTHER].sum())
        self.sure = max(white + stepping, black, 1.0 - white - black - stepping)
        self.on_edge = white + black < 0.5
        self.steady = float(by_phase[[0, 1, OTHER], 0].sum())

    def best(self) -> Belief:
        """The mean of the stories of the likeliest of white, black and edge."""
        weight = self._stories[0].copy()
        group = int(np.argmax(np.bincount(GROUP, weight)))
        weight[group != GROUP] = 0.0
        weight /= weight.sum()
        on_black = self.black > 0.5
        _, u, v, _, uu, uv, vv, _, _, _ = self._stories
        light, dark = float(weight @ u), float(weight @ v)
        if group == STEPPING:  # black has not changed by that
            return Belief(light, self._start_dark, float(weight @ uu), 0.0, self._start_var, False)
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
    return 2.0 * spot_radius(height)


def pattern_of(variance: float, light: float, converter: float) -> float:
    """The floor's pattern as a share of its light, from the variance (counts^2) of readings over white."""
    slope = (1.0 + light) ** 2 / FULL_SCALE
    return min(max(math.sqrt(max(variance - converter, 0.0)) * slope / light, 0.01), 0.08)
