"""A bank of Kalman filters, one for each mode, which decides whether the light or the surface changed.

A sensor is over white, over black, or crossing an edge (`STAGES` stages each way); the light stands, moves or
jumps. That makes a Markov chain of modes. Each mode carries the light over white and over black (u and v, see
`levels`) with its covariance, and its probability given all readings so far. A step merges the transitions
that arrive at the same mode (a second-order generalised pseudo-Bayes filter: Bar-Shalom, Li and Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, section 11.6).

The distance driven meanwhile distinguishes an edge from light: an edge is as long as the sensor's spot is
wide, and ends where black is known to be. Light takes its own time and ends anywhere. If two modes remain,
both are kept until readings decide: the next edge does, since the ratio of the two levels fixes how much
darker black is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat.modes import (
    BETWEEN_LINES_M,
    BORDER_MODES,
    EDGE_MODES,
    FIRST_BORDER_PHASE,
    IS_MOSTLY_BLACK,
    LIGHT_STATES,
    LINE_WIDTH_M,
    MODE_GROUPS,
    MODES,
    OTHER_FLOOR_MODE,
    OTHER_FLOOR_PHASE,
    PHASES,
    STAGES,
    SUNLIGHT_SD,
    mode_transitions,
    transition_probabilities,
)
from raccoon.model.reflectance import FULL_SCALE, light_of, spot_radius

Array = NDArray[np.float64]

BORDER_GROUP = 3  # group of the modes on the border to another floor
MIN_WAY_M = 5e-5  # m per reading; a standing robot may still be pushed
MAX_PACE = 3.3
OUTLIER_DENSITY = 1e-6  # density of an outlier, in units of 1 / the least u
OTHER_LIGHT_ODDS = 0.1  # odds that the robot is put down in another light than the known one
MISTAKEN_PROBABILITY = 1e-4  # prior probability that the two surfaces were confused
EDGE_STAGE_PROBABILITY = 1e-4  # of each stage of an edge, at the start
# light of another floor over u, mean and sd: boards are darker, glare is brighter
OTHER_FLOOR_RATIO = 1.2, 0.6
MIN_FLOOR_RATIO = 0.5  # least light of another floor, as a share of u; boards have 0.65 and more
FLOOR_RETURN_SD = 0.03  # sd of the light of a floor that returns, as a share of its former light
LEAKED_LIGHT = 0.03  # light that a sensor gets over any surface


class Belief(NamedTuple):
    """u and v with their covariance, and the surface of the last reading (None: unknown)."""

    light: float
    dark: float
    light_var: float
    cross: float
    dark_var: float
    on_black: bool | None


class Sensor(NamedTuple):
    """Constants of a sensor: share q of the ambient light that black reflects, and its sd; the least u and v;
    the width of its spot, m; and its noise: pattern, a share of the light, and noise, counts."""

    black_share: float
    black_share_sd: float
    least_light: float
    least_dark: float
    spot: float
    pattern: float
    noise: float

    def with_least_light(self, least: float) -> Sensor:
        """The same sensor if white may reflect as little as `least` of its own light, and black its share of
        it."""
        share = min(least / self.least_light, 1.0)
        return self._replace(least_light=share * self.least_light, least_dark=share * self.least_dark)


class HypothesisBank:
    """The bank. Start it at a time when the levels were known, and feed it every reading since then.

    black: P(most of the spot is on black). sure: P(the likeliest of white, black and edge). steady: P(the
    light stands and no edge is being crossed). on_edge: an edge is likelier than a surface. former: levels
    that may return with the floor (None: those of the start).
    """

    def __init__(self, sensor: Sensor, start: Belief, former: Belief | None = None) -> None:
        self._sensor = sensor
        self._start, self._start_dark, self._start_var = start.light, start.dark, start.dark_var
        self._former = former or start
        # Rows: probability; u, v, the light's pace (per reading); their covariance uu, uv, vv, up, vp, pp.
        moments = start.light, start.dark, 0.0, start.light_var, start.cross, start.dark_var, 0.0, 0.0, 0.0
        self._modes = np.repeat(np.array((1e-30, *moments))[:, np.newaxis], MODES, axis=1)
        if start.on_black is None:
            self._init_unknown_surface(start)
        else:
            self._modes[0, EDGE_MODES] = EDGE_STAGE_PROBABILITY
            self._modes[0, LIGHT_STATES * start.on_black] = 1.0
            if former is not None and not start.on_black:
                self._modes[0, OTHER_FLOOR_MODE] = 1.0
            self._add_mistaken_surface(start)
        self.black = 0.5 if start.on_black is None else float(start.on_black)
        self.steady = self.sure = 0.0
        self.on_edge = False

    def _init_unknown_surface(self, start: Belief) -> None:
        """Start on either surface, in the light of the calibration or in any other."""
        share = self._sensor.black_share
        self._modes[0, EDGE_MODES] = self._sensor.spot / STAGES
        sd = math.hypot(start.light, SUNLIGHT_SD)
        spread = sd * sd, share * sd * sd, (share**2 + self._sensor.black_share_sd**2) * sd * sd
        for surface, chance in enumerate((BETWEEN_LINES_M, LINE_WIDTH_M)):
            mode = LIGHT_STATES * surface
            # The moving mode at a pace of 0 holds the known light: soon it is the likelier one, or excluded.
            self._modes[0, mode : mode + LIGHT_STATES] = OTHER_LIGHT_ODDS * chance, chance
            self._modes[4:7, mode] += spread

    def _add_mistaken_surface(self, start: Belief) -> None:
        """Add a mode in which the two surfaces had been confused."""
        sensor = self._sensor
        if start.on_black:
            light, mode = start.dark, 0
            dark = max(start.dark + sensor.black_share * (light - start.light), sensor.least_dark)
            if light < sensor.least_light:
                return
        else:
            dark, mode = start.light, LIGHT_STATES
            light = start.light + (dark - start.dark) / sensor.black_share
        own = (0.02 * (light if start.on_black else dark)) ** 2
        unsure = (2.0 * sensor.black_share_sd * (light - start.light)) ** 2
        if start.on_black:
            moments = own, sensor.black_share * own, sensor.black_share**2 * own + unsure
        else:
            moments = (own + unsure) / sensor.black_share**2, own / sensor.black_share, own
        self._modes[:7, mode] = MISTAKEN_PROBABILITY, light, dark, 0.0, *moments

    def update(
        self, counts: float, way: float, others_lost: bool | None = None, way_known: bool = True
    ) -> None:
        """Take a reading. way: m driven over the floor since the last one. way_known: it is measured."""
        sensor, transitions = self._sensor, mode_transitions()
        steps, spot_microns = min(max(way, MIN_WAY_M) * STAGES / sensor.spot, MAX_PACE), 1e6 * sensor.spot
        probability = transition_probabilities(
            round(10.0 * steps), round(spot_microns), others_lost, way_known
        )
        light_read = light_of(counts)
        share, pace_share = sensor.black_share, transitions.pace_share
        modes = self._with_floor_modes().take(transitions.source, axis=1)
        weight, before, dark, pace, uu, uv, vv, up, vp, pp = modes
        # Predict: light changes u by its pace, and v by the share q of that, which is known up to its sd.
        scale = before * before
        pp = pace_share * pace_share * pp + transitions.sunlight_variance + transitions.pace_variance * scale
        pp += transitions.pace_change_variance * pace * pace
        up, vp, pace = pace_share * up, pace_share * vp, pace_share * pace
        wander = transitions.standing_variance * scale
        uu = uu + 2.0 * up + pp + wander
        uv = uv + share * (up + pp + wander) + vp
        vv = vv + share * (2.0 * vp + share * (pp + wander))
        light_change = before - self._start
        vv += np.maximum(sensor.black_share_sd**2 * pace * (2.0 * light_change + pace), 0.0)
        means, covariance = np.empty((3, len(pace))), np.empty((6, len(pace)))
        light = np.add(before, pace, out=means[0])
        dark = np.add(dark, share * pace, out=means[1])
        moves = transitions.keeps_pace
        pace, pp, up, vp = moves * pace, moves * pp, moves * (up + pp), moves * (vp + share * pp)
        # Update: the reading mixes white and black by their parts of the spot.
        a, b = transitions.white_part, transitions.black_part
        expected = a * light + b * dark
        to_u, to_v, to_p = a * uu + b * uv, a * uv + b * vv, a * up + b * vp
        variance = a * to_u + b * to_v
        converter_noise = sensor.noise / FULL_SCALE * (1.0 + light_read) ** 2
        noise = (sensor.pattern * light_read) ** 2 + converter_noise**2
        variance += noise + (transitions.blur * (light - dark)) ** 2
        scaled = (light_read - expected) / variance  # the innovation over its variance
        density = np.exp(-0.5 * scaled * scaled * variance) / np.sqrt(variance)
        density += OUTLIER_DENSITY / sensor.least_light
        light += to_u * scaled
        dark += to_v * scaled
        np.add(pace, to_p * scaled, out=means[2])
        inverse = 1.0 / variance
        gains = (to_u, to_u), (to_u, to_v), (to_v, to_v), (to_u, to_p), (to_v, to_p), (to_p, to_p)
        for row, was, (one, other) in zip(covariance, (uu, uv, vv, up, vp, pp), gains, strict=True):
            np.subtract(was, one * other * inverse, out=row)
        plausibility = self._constrain(before, means, covariance)
        self._merge_modes(weight * probability * density * plausibility, means, covariance)

    def _with_floor_modes(self) -> Array:
        """The modes, and behind them those that reach another floor or leave for it (`ModeTransitions`).
        There the light of the floor ahead is in black's place, and in white's once it is reached.

        What looks like another floor may be the sharp edge of a shadow: black changes by half of that.
        """
        former, modes = self._former, self._modes
        arriving = modes[:, BORDER_MODES].copy()
        weight, light, dark, _, uu, uv, vv, up, vp, _ = arriving
        short = np.minimum(dark[:STAGES] / (MIN_FLOOR_RATIO * light[:STAGES]) - 1.0, 0.0)
        weight[:STAGES] *= np.exp(-50.0 * short * short)
        change = 0.5 * self._sensor.black_share * (dark - light)
        light[:], uu[:] = dark, vv
        dark[:] = np.maximum(self._start_dark + change, self._sensor.least_dark)
        vv[:] = self._start_var + change * change
        dark[STAGES:], vv[STAGES:] = former.dark, former.dark_var
        uv[:] = up[:] = vp[:] = 0.0
        leaving = modes[:, (0, OTHER_FLOOR_MODE, OTHER_FLOOR_MODE)]
        _, light, dark, _, _, uv, vv, _, vp, _ = leaving
        mean, sd = OTHER_FLOOR_RATIO
        dark[:2], vv[:2] = mean * light[:2], (sd * light[:2]) ** 2
        dark[2], vv[2] = former.light, former.light_var + (FLOOR_RETURN_SD * former.light) ** 2
        uv[:] = vp[:] = 0.0
        return np.concatenate([modes, arriving, leaving], axis=1)

    def _constrain(self, before: Array, means: Array, covariance: Array) -> Array:
        """Move u and v within their bounds; returns the likelihood (modes,) that they were within.

        u is at least the sensor's own light. Black reflects at most its share of any light: a mode with more
        gets the likelihood of an error of that size, and continues at the bound.
        """
        sensor, transitions = self._sensor, mode_transitions()
        (light, dark, _), (uu, uv, vv, *_) = means, covariance
        max_share = sensor.black_share + 2.0 * sensor.black_share_sd
        excess = transitions.is_not_on_border * np.maximum(dark - max_share * light - LEAKED_LIGHT, 0.0)
        to_light, to_dark = uv - max_share * uu, vv - max_share * uv
        correction = excess / (to_dark - max_share * to_light + 1e-4 * light * light)
        unlikely = 0.5 * excess * correction
        if light.min() < sensor.least_light:
            short, was = (np.minimum(each / sensor.least_light - 1.0, 0.0) for each in (light, before))
            unlikely += 50.0 * np.maximum(short * short - was * was, 0.0)
        np.maximum(light - to_light * correction, 0.5 * sensor.least_light, out=light)
        darkest = 0.97 * light + transitions.max_excess_light
        np.minimum(np.maximum(dark - to_dark * correction, sensor.least_dark), darkest, out=dark)
        return np.asarray(np.exp(-unlikely))

    def _merge_modes(self, weight: Array, means: Array, covariance: Array) -> None:
        """Merge all transitions that arrive at a mode to one Gaussian with the same moments."""
        transitions = mode_transitions()
        reached, starts = transitions.reached_modes, transitions.reached_starts
        weight /= weight.sum()
        weight += 1e-30  # an improbable mode stays in the bank
        total = np.add.reduceat(weight, starts)
        merged = np.zeros((10, MODES))  # no other floor is reached while light moves
        merged[0, reached] = total
        mean = np.add.reduceat(weight * means, starts, axis=1) / total
        merged[1:4, reached] = mean
        u, v, p = means - mean.take(transitions.reached_index, axis=1)
        for row, spread in zip(covariance, (u * u, u * v, v * v, u * p, v * p, p * p), strict=True):
            row += spread
        covariance *= weight
        merged[4:, reached] = np.add.reduceat(covariance, starts, axis=1) / total
        self._modes = merged
        by_phase = merged[0].reshape(PHASES, LIGHT_STATES)
        phases = by_phase.sum(axis=1)
        white, black = float(phases[0] + phases[OTHER_FLOOR_PHASE]), float(phases[1])
        self.black = black + float(phases[2:FIRST_BORDER_PHASE] @ IS_MOSTLY_BLACK)
        on_border = float(phases[FIRST_BORDER_PHASE:OTHER_FLOOR_PHASE].sum())
        self.sure = max(white + on_border, black, 1.0 - white - black - on_border)
        self.on_edge = white + black < 0.5
        self.steady = float(by_phase[[0, 1, OTHER_FLOOR_PHASE], 0].sum())

    def best_belief(self) -> Belief:
        """Mean and covariance of the likeliest of white, black, edge and border."""
        weight = self._modes[0].copy()
        group = int(np.argmax(np.bincount(MODE_GROUPS, weight)))
        weight[group != MODE_GROUPS] = 0.0
        weight /= weight.sum()
        on_black = self.black > 0.5
        _, u, v, _, uu, uv, vv, _, _, _ = self._modes
        light, dark = float(weight @ u), float(weight @ v)
        if group == BORDER_GROUP:  # a border does not change black
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


def spot_width(height: float) -> float:
    """Width (m) of a sensor's spot at a height, m (see raccoon.model.reflectance.spot_radius)."""
    return 2.0 * spot_radius(height)


def pattern_share(variance: float, light: float, converter: float) -> float:
    """Noise of the floor's pattern as a share of its light, from the variance (counts^2) of readings over
    white and that of the converter."""
    slope = (1.0 + light) ** 2 / FULL_SCALE
    return min(max(math.sqrt(max(variance - converter, 0.0)) * slope / light, 0.01), 0.08)
