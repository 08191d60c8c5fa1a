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
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.tophat.bank_step import BankConstants, advance_modes
from raccoon.estimate.tophat.modes import (
    BETWEEN_LINES_M,
    EDGE_MODES,
    LIGHT_STATES,
    LINE_WIDTH_M,
    MODE_GROUPS,
    MODE_SUMS,
    MODES,
    OTHER_FLOOR_MODE,
    STAGES,
    SUNLIGHT_SD,
    transition_probabilities,
)
from raccoon.model.reflectance import FULL_SCALE, light_of, spot_radius

Array = NDArray[np.float64]

BORDER_GROUP = 3  # group of the modes on the border to another floor
MIN_WAY_M = 5e-5  # m per reading; a standing robot may still be pushed
MAX_PACE = 3.3
OTHER_LIGHT_ODDS = 0.1  # odds that the robot is put down in another light than the known one
MISTAKEN_PROBABILITY = 1e-4  # prior probability that the two surfaces were confused
EDGE_STAGE_PROBABILITY = 1e-4  # of each stage of an edge, at the start


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


class Reading(NamedTuple):
    """A reading for a bank.

    counts: ADC. way: m driven over the floor since the last one. others_lost: whether other sensors are lost;
    None: there are none. way_known: whether the way is measured.
    """

    counts: float
    way: float
    others_lost: bool | None = None
    way_known: bool = True


class HypothesisBank:
    """The bank. Start it at a time when the levels were known, and feed it every reading since then.

    black: P(most of the spot is on black). sure: P(the likeliest of white, black and edge). steady: P(the
    light stands and no edge is being crossed). on_edge: an edge is likelier than a surface. former_levels:
    those that may return with the floor (None: those of the start).
    """

    def __init__(self, sensor: Sensor, start: Belief, former_levels: Belief | None = None) -> None:
        self._sensor = sensor
        self._start_dark, self._start_var = start.dark, start.dark_var
        former = start if former_levels is None else former_levels
        self.constants = (
            *(sensor.black_share, sensor.black_share_sd, sensor.least_light, sensor.least_dark),
            *(sensor.pattern, sensor.noise, start.light, start.dark, start.dark_var),
            *(former.light, former.light_var, former.dark, former.dark_var),
        )
        """As `BankConstants` has them, without the reading."""
        # Rows: probability; u, v, the light's pace (per reading); their covariance uu, uv, vv, up, vp, pp.
        moments = start.light, start.dark, 0.0, start.light_var, start.cross, start.dark_var, 0.0, 0.0, 0.0
        self._modes = np.repeat(np.array((1e-30, *moments))[:, np.newaxis], MODES, axis=1)
        if start.on_black is None:
            self._init_unknown_surface(start)
        else:
            self._modes[0, EDGE_MODES] = EDGE_STAGE_PROBABILITY
            self._modes[0, LIGHT_STATES * start.on_black] = 1.0
            if former_levels is not None and not start.on_black:
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
        update_banks([self], [Reading(counts, way, others_lost, way_known)])

    def _probabilities(self, reading: Reading) -> Array:
        """Probability of every transition in a reading."""
        spot = self._sensor.spot
        steps = min(max(reading.way, MIN_WAY_M) * STAGES / spot, MAX_PACE)
        return transition_probabilities(
            round(10.0 * steps), round(1e6 * spot), reading.others_lost, reading.way_known
        )

    def _take_modes(self, modes: Array) -> None:
        """Continue with these modes: a row for each moment."""
        self._modes = modes
        white, black, mostly_black, on_border, self.steady = (modes[0] @ MODE_SUMS).tolist()
        self.black = black + mostly_black
        self.sure = max(white + on_border, black, 1.0 - white - black - on_border)
        self.on_edge = white + black < 0.5

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


def update_banks(banks: Sequence[HypothesisBank], readings: Sequence[Reading]) -> None:
    """Give banks of different sensors a reading each.

    All of them at once cost little more than one: NumPy takes most of its time for a call, not for numbers.
    """
    each = list(zip(banks, readings, strict=True))
    constants = np.array([(*bank.constants, light_of(reading.counts)) for bank, reading in each])
    modes = np.array([bank._modes for bank in banks]).swapaxes(0, 1)
    probabilities = np.array([bank._probabilities(reading) for bank, reading in each])
    after = advance_modes(modes, BankConstants(*constants.T[:, :, np.newaxis]), probabilities)
    for number, bank in enumerate(banks):
        bank._take_modes(after[:, number])


def spot_width(height: float) -> float:
    """Width (m) of a sensor's spot at a height, m (see raccoon.model.reflectance.spot_radius)."""
    return 2.0 * spot_radius(height)


def pattern_share(variance: float, light: float, converter: float) -> float:
    """Noise of the floor's pattern as a share of its light, from the variance (counts^2) of readings over
    white and that of the converter."""
    slope = (1.0 + light) ** 2 / FULL_SCALE
    return min(max(math.sqrt(max(variance - converter, 0.0)) * slope / light, 0.01), 0.08)
