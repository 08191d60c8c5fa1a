"""The light over white and over black: a Kalman filter of two levels that one ambient light moves together.

State: the light that the sensor gets over white, u, and over black, v, in units of the light that halves its
reading (counts = 4095 / (1 + light), raccoon.model.reflectance). An ambient light da adds da to u and q da to
v, so both share one process noise, and a reading over one surface updates both. The error of q makes a
variance that grows with the change of light since the other surface was seen.
"""

from __future__ import annotations

import math

from raccoon.core.readings import Status
from raccoon.estimate.tophat.calibration import CLEAR_SDS, MIN_SD, Surface
from raccoon.estimate.tophat.modes import UNKNOWN_WAY_FACTOR
from raccoon.estimate.tophat.sensor import explain_levels
from raccoon.model.reflectance import FULL_SCALE, light_of

GATE_SDS = 4.5  # standard deviations within which a reading belongs to a surface
# bounds on the distance of a passage that counts as an edge, as shares of the edge's width
MIN_EDGE_SHARE, MAX_EDGE_SHARE = 0.4, 1.6
LIGHT_WANDER = 0.004  # share of the light, per reading; a cloud takes seconds
SURFACE_DRIFT = 0.0002  # share of the light, per reading, by which a surface changes alone
FLOOR_SPREAD, TAPE_SPREAD = 0.06, 0.15
"""Standard deviations of a floor's and a line's light from place to place, as shares of it."""
PULL_SDS = 1.5  # standard deviations of a residual above which the process noise grows
NOISE_FORGETTING = 0.01  # share of the noise estimate, per reading
PATTERN_SHARE = 0.03  # least standard deviation of a surface's readings, as a share of its light
SURE_SEPARATION = 2.5  # least separation of reliable levels, in sums of both standard deviations
NEAR_BOTTOM_SDS = 5.0  # level in standard deviations up to which light is linearised at the level
MIN_DARK_SHARE = 0.0125  # share of the least light over white that black reflects
CONVERTER_VARIANCE = 9.0  # counts^2, of a standing sensor
MIN_RELEARN_CONTRAST = 0.5  # share of the expected contrast above which two readings are two surfaces
MIN_CONTRAST_COUNTS = 12.0  # counts; below it the surfaces are indistinguishable
OTHER_LIGHT_SHARE = 0.25
"""Difference that makes another light, as a share of the light between the surfaces: half an edge reads 0.33
then."""


class Levels:
    """Levels of one sensor: `white`, `black`, `threshold`, `low`, `high` in counts; `light`, `dark`: u and v.

    sd_white, sd_black: counts, of a reading, including the uncertainty of the level. status: `uncertain` if
    the levels are not known well enough to distinguish the surfaces.
    """

    __slots__ = (
        "_black_share",
        "_black_share_sd",
        "_cross",
        "_dark_anchor",
        "_dark_noise",
        "_dark_var",
        "_least_dark",
        "_least_light",
        "_least_light_far",
        "_light_anchor",
        "_light_noise",
        "_light_var",
        "black",
        "dark",
        "high",
        "light",
        "low",
        "sd_black",
        "sd_white",
        "status",
        "threshold",
        "white",
    )

    def __init__(self, white: Surface, black: Surface) -> None:
        self.light, self.dark = light_of(white.mean), light_of(black.mean)
        self._light_noise, self._dark_noise = white.sd**2, black.sd**2  # counts^2, of one reading
        self._light_var = (light_per_count(white.mean) * white.sd) ** 2 / max(white.count, 1)
        self._dark_var = (light_per_count(black.mean) * black.sd) ** 2 / max(black.count, 1)
        self._cross = 0.0
        self._light_anchor = self.light  # u when black was read last
        self._dark_anchor = self.dark  # v when white was read last
        self._split_own_and_ambient_light(white.mean, black.mean)
        self.status = Status.OK
        # A floor in the sun may read 0; its light is limited to that of one count.
        self.white, self.black = max(white.mean, 1.0), max(black.mean, 1.0)
        self._refresh()

    def _split_own_and_ambient_light(self, white: float, black: float) -> None:
        """Estimate q and the least light in darkness from the two levels: own and ambient light of the
        sensor."""
        known = explain_levels(white, black)
        shares = [each.sun_by_black for each in known] or [0.38, 0.58]
        self._black_share = sum(shares) / len(shares)
        self._black_share_sd = 0.03 if len(shares) == 1 else 0.10
        self._least_light = min((each.least_reflected for each in known), default=0.04 * self.light)
        self._least_light_far = min((each.farthest for each in known), default=self._least_light)
        self._least_dark = MIN_DARK_SHARE * self._least_light

    def _learn(self, counts: float, on_black: bool, residual: float, noise: float) -> None:
        """One prediction and update of the filter, and of the surface's noise."""
        level = self.black if on_black else self.white
        if level * level > NEAR_BOTTOM_SDS * NEAR_BOTTOM_SDS * noise:
            slope = FULL_SCALE / (counts * counts) if counts > 1.0 else FULL_SCALE
            light_residual = light_of(counts) - (self.dark if on_black else self.light)
        else:  # there symmetric noise in counts is asymmetric in light, with a biased mean
            slope = FULL_SCALE / (level * level)
            light_residual = -slope * residual
        share = self._black_share
        wander = LIGHT_WANDER * (self.light + 0.1)
        wander *= wander
        if residual * residual > PULL_SDS * PULL_SDS * noise:
            pull = slope * residual
            wander += 0.1 * pull * pull / (share * share if on_black else 1.0)
        light_var = self._light_var + wander
        cross = self._cross + share * wander
        drift = SURFACE_DRIFT * self.dark
        dark_var = self._dark_var + share * share * wander + drift * drift
        if on_black:
            dark_var += self._unseen_dark_sd() ** 2
            gain = 1.0 / (dark_var + slope * slope * noise)
            to_light, to_dark = cross * gain, dark_var * gain
            self._light_var = light_var - to_light * cross
            self._dark_var = dark_var * (1.0 - to_dark)
            self._cross = cross * (1.0 - to_dark)
        else:
            light_var += self._unseen_light_sd() ** 2
            gain = 1.0 / (light_var + slope * slope * noise)
            to_light, to_dark = light_var * gain, cross * gain
            self._light_var = light_var * (1.0 - to_light)
            self._dark_var = dark_var - to_dark * cross
            self._cross = cross * (1.0 - to_light)
        self.light += to_light * light_residual
        self.dark += to_dark * light_residual
        learnt = (
            NOISE_FORGETTING * (residual * residual - noise) if residual * residual < 9.0 * noise else 0.0
        )
        if on_black:
            self._light_anchor = self.light
            self._dark_noise = noise + learnt
        else:
            self._dark_anchor = self.dark
            self._light_noise = noise + learnt

    @property
    def difference_variance(self) -> float:
        """Counts^2, by noise, of the difference of a reading of white and one of black."""
        return self._light_noise + self._dark_noise

    def is_beyond(self, counts: float, light: float) -> bool:
        """Whether a reading is explained neither by noise nor by a part of an edge, but by a surface in a
        light that differs by `OTHER_LIGHT_SHARE`. light: that of `counts`. A smaller difference moves an edge
        by less than learning costs."""
        least = OTHER_LIGHT_SHARE * (self.light - self.dark)
        if light > self.light:
            return light - self.light > least and counts < self.white - GATE_SDS * self.sd_white
        return (
            self.dark - light > least * self._black_share and counts > self.black + GATE_SDS * self.sd_black
        )

    def relearn(self, white: float, black: float) -> bool:
        """Restart at these counts; False if black is not as much darker as such light would make it."""
        light, dark = light_of(white), light_of(black)
        expected = max(self.dark + self._black_share * (light - self.light), self._least_dark)
        noise = math.sqrt(self._light_noise) * white / self.white + math.sqrt(CONVERTER_VARIANCE)
        if light - dark < MIN_RELEARN_CONTRAST * (light - expected) or black - white < max(
            MIN_CONTRAST_COUNTS, 4.0 * noise
        ):
            return False
        self.light, self.dark = self._light_anchor, self._dark_anchor = light, dark
        self._refresh()
        return True

    def _unseen_dark_sd(self) -> float:
        """Sd of v since black was last read: from the uncertainty of q, and because a floor that is brighter
        here than there looks like more light, which does not reach black."""
        light_change = self.light - self._light_anchor
        floor = min(abs(light_change), FLOOR_SPREAD * self.light)
        return math.sqrt((self._black_share_sd * light_change) ** 2 + (self._black_share * floor) ** 2)

    def _unseen_light_sd(self) -> float:
        """Sd of u since white was last read: from the uncertainty of q, as u = v / q, and because black
        differs from place to place."""
        dark_change = self.dark - self._dark_anchor
        tape = min(abs(dark_change), TAPE_SPREAD * self.dark)
        return (
            math.sqrt((self._black_share_sd / self._black_share * dark_change) ** 2 + tape**2)
            / self._black_share
        )

    def _is_edge(self, spot: float, shortest: float, longest: float, way_known: bool) -> bool:
        """Whether the distance of the sensor between the two surfaces fits the width of its spot, m.

        Only the part in which neither surface explains the readings is seen. It begins between two readings
        and ends between two, so its length was `shortest` to `longest` m. Without such a part, because the
        levels are uncertain, it is not certain to be an edge. way_known: whether the distances are measured.
        """
        begins = light_of(self.white + GATE_SDS * self.sd_white)
        ends = light_of(self.black - GATE_SDS * self.sd_black)
        if begins <= ends:
            apart = self.black - self.white
            return apart < GATE_SDS * (math.sqrt(self._light_noise) + math.sqrt(self._dark_noise))
        edge = (begins - ends) / (self.light - self.dark) * spot
        return shortest <= max_edge_share(way_known) * edge and (
            not way_known or longest >= MIN_EDGE_SHARE * edge
        )

    def _refresh(self) -> None:
        """Set the levels in counts, their standard deviations, threshold, band and status from the state."""
        dark = self.dark
        if dark < self._least_dark:
            dark = self._least_dark
        if dark > 0.97 * self.light:
            dark = 0.97 * self.light
        self.dark = dark
        white, black = FULL_SCALE / (1.0 + self.light), FULL_SCALE / (1.0 + dark)
        self._light_noise = _rescaled_noise(self._light_noise, self.white, white)
        self._dark_noise = _rescaled_noise(self._dark_noise, self.black, black)
        self.white, self.black = white, black
        white_noise, black_noise = MIN_SD + self._light_noise, MIN_SD + self._dark_noise
        scale = white * white / FULL_SCALE
        scale *= scale
        unseen = self._unseen_light_sd()
        sd_white = self.sd_white = math.sqrt(white_noise + scale * (self._light_var + unseen * unseen))
        scale = black * black / FULL_SCALE
        scale *= scale
        unseen = self._unseen_dark_sd()
        sd_black = self.sd_black = math.sqrt(black_noise + scale * (self._dark_var + unseen * unseen))
        self._place_threshold(white, black, math.sqrt(white_noise), math.sqrt(black_noise))
        gap = black - white
        if gap > SURE_SEPARATION * (sd_white + sd_black) and gap > MIN_CONTRAST_COUNTS:
            self.status = Status.OK
        else:
            self.status = Status.UNCERTAIN if gap > MIN_CONTRAST_COUNTS else Status.INVALID

    def _place_threshold(self, white: float, black: float, white_noise: float, black_noise: float) -> None:
        """Set threshold and band between the levels, as in `TophatCalibration.of_surfaces`."""
        gap = black - white
        middle = white + gap * white_noise / (white_noise + black_noise)
        least, most = white + CLEAR_SDS * white_noise, black - CLEAR_SDS * black_noise
        if least < most:
            half = 2.0 * white * black / (white + black)
            middle = least if half < least else most if half > most else half
        self.threshold = middle
        below, above = 0.4 * (middle - white), 0.4 * (black - middle)
        self.low = middle - (1.5 * white_noise if 1.5 * white_noise < below else below)
        self.high = middle + (1.5 * black_noise if 1.5 * black_noise < above else above)


def max_edge_share(way_known: bool) -> float:
    """Upper bound on the distance of a passage that counts as an edge, as a share of the edge's width.
    way_known: whether the distance is measured."""
    return MAX_EDGE_SHARE if way_known else UNKNOWN_WAY_FACTOR * MAX_EDGE_SHARE


def _rescaled_noise(noise: float, was: float, now: float) -> float:
    """The noise (counts^2) of a surface whose level changed: its pattern is a share of its light, to which
    counts near the top are insensitive."""
    tells, told = now - now * now / FULL_SCALE, was - was * was / FULL_SCALE
    by = (tells if tells > 1.0 else 1.0) / (told if told > 1.0 else 1.0)
    scaled = noise * by * by
    if by > 1.0:  # a reading at the top has other noise besides pattern
        level, pattern = now / was, PATTERN_SHARE * tells
        most = noise * level * level if level > 1.0 else noise
        most = most if most > pattern * pattern else pattern * pattern
        scaled = scaled if scaled < most else most
    return scaled if scaled > CONVERTER_VARIANCE else CONVERTER_VARIANCE


def light_per_count(counts: float) -> float:
    """Change of light that changes the reading by one count."""
    return FULL_SCALE / max(counts, 1.0) ** 2
