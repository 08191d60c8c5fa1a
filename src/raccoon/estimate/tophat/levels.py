"""The light over white and over black: a Kalman filter of two levels that one ambient light moves together.

State: the light that the sensor gets over white, u, and over black, v, in units of the light that halves its
reading (counts = 4095 / (1 + light), raccoon.model.reflectance). More ambient light adds da to u and q da to
v, so the process noise of the two is one number, and a reading over one surface moves both. What q is not
known by grows with the light that changed since the other surface was seen.
"""

from __future__ import annotations

import math

from raccoon.core.readings import Status
from raccoon.estimate.tophat.calibration import CLEAR, LEAST_SD, Surface
from raccoon.estimate.tophat.modes import SLOWER
from raccoon.estimate.tophat.sensor import explanations
from raccoon.model.reflectance import FULL_SCALE, light_of

GATE = 4.5  # standard deviations within which a reading belongs to a surface
SHORT, LONG = 0.4, 1.6  # of an edge's way, from which and up to which a passage is one
WANDER = 0.004  # of the light, a reading: a cloud takes seconds
DRIFT = 0.0002  # of the light, a reading, by which a surface moves alone
FLOOR, TAPE = 0.06, 0.15  # of their light, by which one place of a floor or of a line differs from another
PULL = 1.5  # standard deviations from which the filter trusts its levels less
FORGET = 0.01  # of the noise estimate, a reading
PATTERN = 0.03  # of its light, by which readings of a surface differ at least
SURE_APART = 2.5  # separation of the levels, their own uncertainty included
NEAR_BOTTOM = 5.0  # standard deviations of a reading, up to which its light is linearised at the level
LEAST_DARK = 0.0125  # of the least light over white, that black sends back
CONVERTER_NOISE = 9.0  # counts^2, of a standing sensor
SEEN_CONTRAST = 0.5  # of what is expected in other light, from which two readings are two surfaces
LEAST_CONTRAST = 12.0  # counts; below it nobody could tell
OTHER = 0.25  # of the light between the surfaces, by which another one is: half an edge reads 0.33 then


class Levels:
    """Levels of one sensor: `white`, `black`, `threshold`, `low`, `high` in counts; `light`, `dark`: u and v.

    sd_white, sd_black: counts, of a reading, with what is not known of the level. status: `uncertain` where
    the levels are not known well enough to tell apart.
    """

    __slots__ = (
        "_cross",
        "_dark_anchor",
        "_dark_noise",
        "_dark_var",
        "_farthest",
        "_floor",
        "_light_anchor",
        "_light_noise",
        "_light_var",
        "_own_dark",
        "_share",
        "_share_sd",
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
        self._split(white.mean, black.mean)
        self.status = Status.OK
        # A floor in the sun may read 0: there is no more light than that of a count.
        self.white, self.black = max(white.mean, 1.0), max(black.mean, 1.0)
        self._refresh()

    def _split(self, white: float, black: float) -> None:
        """Own and ambient light of the sensor, as far as its two levels tell: q, and what darkness leaves."""
        known = explanations(white, black)
        shares = [each.sun_by_black for each in known] or [0.38, 0.58]
        self._share = sum(shares) / len(shares)
        self._share_sd = 0.03 if len(shares) == 1 else 0.10
        self._floor = min((each.least_reflected for each in known), default=0.04 * self.light)
        self._farthest = min((each.farthest for each in known), default=self._floor)
        self._own_dark = LEAST_DARK * self._floor

    def _learn(self, counts: float, on_black: bool, miss: float, noise: float) -> None:
        """One predict and update of the filter, with the noise of the surface learnt beside it."""
        level = self.black if on_black else self.white
        if level * level > NEAR_BOTTOM * NEAR_BOTTOM * noise:
            slope = FULL_SCALE / (counts * counts) if counts > 1.0 else FULL_SCALE
            wrong = light_of(counts) - (self.dark if on_black else self.light)
        else:  # even noise of the counts is uneven there in the light, and its mean another level
            slope = FULL_SCALE / (level * level)
            wrong = -slope * miss
        share = self._share
        wander = WANDER * (self.light + 0.1)
        wander *= wander
        if miss * miss > PULL * PULL * noise:
            pull = slope * miss
            wander += 0.1 * pull * pull / (share * share if on_black else 1.0)
        light_var = self._light_var + wander
        cross = self._cross + share * wander
        drift = DRIFT * self.dark
        dark_var = self._dark_var + share * share * wander + drift * drift
        if on_black:
            dark_var += self._unseen_dark() ** 2
            gain = 1.0 / (dark_var + slope * slope * noise)
            to_light, to_dark = cross * gain, dark_var * gain
            self._light_var = light_var - to_light * cross
            self._dark_var = dark_var * (1.0 - to_dark)
            self._cross = cross * (1.0 - to_dark)
        else:
            light_var += self._unseen_light() ** 2
            gain = 1.0 / (light_var + slope * slope * noise)
            to_light, to_dark = light_var * gain, cross * gain
            self._light_var = light_var * (1.0 - to_light)
            self._dark_var = dark_var - to_dark * cross
            self._cross = cross * (1.0 - to_light)
        self.light += to_light * wrong
        self.dark += to_dark * wrong
        learnt = FORGET * (miss * miss - noise) if miss * miss < 9.0 * noise else 0.0
        if on_black:
            self._light_anchor = self.light
            self._dark_noise = noise + learnt
        else:
            self._dark_anchor = self.dark
            self._light_noise = noise + learnt

    def is_beyond(self, counts: float, light: float) -> bool:
        """Whether no noise and no part of an edge reads this, but a surface in a light that is another one by
        `OTHER`. light: that of `counts`. Less would move an edge by less than what it costs to learn it.
        """
        least = OTHER * (self.light - self.dark)
        if light > self.light:
            return light - self.light > least and counts < self.white - GATE * self.sd_white
        return self.dark - light > least * self._share and counts > self.black + GATE * self.sd_black

    def relearn(self, white: float, black: float) -> bool:
        """Begin anew at these counts; False where black is not as much darker as such light leaves it."""
        light, dark = light_of(white), light_of(black)
        expected = max(self.dark + self._share * (light - self.light), self._own_dark)
        noise = math.sqrt(self._light_noise) * white / self.white + math.sqrt(CONVERTER_NOISE)
        if light - dark < SEEN_CONTRAST * (light - expected) or black - white < max(
            LEAST_CONTRAST, 4.0 * noise
        ):
            return False
        self.light, self.dark = self._light_anchor, self._dark_anchor = light, dark
        self._refresh()
        return True

    def _unseen_dark(self) -> float:
        """Sd of v since black was last read: by what is not known of q, and as a floor that is brighter here
        than there looks like more light, and black knows nothing of it."""
        gone = self.light - self._light_anchor
        floor = min(abs(gone), FLOOR * self.light)
        return math.sqrt((self._share_sd * gone) ** 2 + (self._share * floor) ** 2)

    def _unseen_light(self) -> float:
        """Sd of u since white was last read: by what is not known of q, as u = v / q, and as one black is
        not like another."""
        gone = self.dark - self._dark_anchor
        tape = min(abs(gone), TAPE * self.dark)
        return math.sqrt((self._share_sd / self._share * gone) ** 2 + tape**2) / self._share

    def _is_edge(self, spot: float, least: float, most: float, known: bool) -> bool:
        """Whether the sensor went as far between the two surfaces as its spot is wide, m.

        What is seen of it is the part in which neither surface explains the readings: it begins and ends
        anywhere on the way to the first of them and to the one after the last, so it was `least` to `most`
        m. Where there is no such part, because the levels are not known, it is not an edge for sure. known:
        whether the ways are, and no guess.
        """
        begins = light_of(self.white + GATE * self.sd_white)
        ends = light_of(self.black - GATE * self.sd_black)
        if begins <= ends:
            apart = self.black - self.white
            return apart < GATE * (math.sqrt(self._light_noise) + math.sqrt(self._dark_noise))
        edge = (begins - ends) / (self.light - self.dark) * spot
        return least <= longest(known) * edge and (not known or most >= SHORT * edge)

    def _refresh(self) -> None:
        """Levels in counts, their spreads, threshold, band and status from the state."""
        dark = self.dark
        if dark < self._own_dark:
            dark = self._own_dark
        if dark > 0.97 * self.light:
            dark = 0.97 * self.light
        self.dark = dark
        white, black = FULL_SCALE / (1.0 + self.light), FULL_SCALE / (1.0 + dark)
        self._light_noise = _scaled(self._light_noise, self.white, white)
        self._dark_noise = _scaled(self._dark_noise, self.black, black)
        self.white, self.black = white, black
        white_noise, black_noise = LEAST_SD + self._light_noise, LEAST_SD + self._dark_noise
        scale = white * white / FULL_SCALE
        scale *= scale
        unseen = self._unseen_light()
        sd_white = self.sd_white = math.sqrt(white_noise + scale * (self._light_var + unseen * unseen))
        scale = black * black / FULL_SCALE
        scale *= scale
        unseen = self._unseen_dark()
        sd_black = self.sd_black = math.sqrt(black_noise + scale * (self._dark_var + unseen * unseen))
        self._cut(white, black, math.sqrt(white_noise), math.sqrt(black_noise))
        gap = black - white
        if gap > SURE_APART * (sd_white + sd_black) and gap > LEAST_CONTRAST:
            self.status = Status.OK
        else:
            self.status = Status.UNCERTAIN if gap > LEAST_CONTRAST else Status.INVALID

    def _cut(self, white: float, black: float, white_noise: float, black_noise: float) -> None:
        """Threshold and band between two levels, as a calibration puts them (`calibration.believed`)."""
        gap = black - white
        middle = white + gap * white_noise / (white_noise + black_noise)
        least, most = white + CLEAR * white_noise, black - CLEAR * black_noise
        if least < most:
            half = 2.0 * white * black / (white + black)
            middle = least if half < least else most if half > most else half
        self.threshold = middle
        below, above = 0.4 * (middle - white), 0.4 * (black - middle)
        self.low = middle - (1.5 * white_noise if 1.5 * white_noise < below else below)
        self.high = middle + (1.5 * black_noise if 1.5 * black_noise < above else above)


def longest(known: bool) -> float:
    """Of an edge's way, up to which a passage is one; known: whether the way is, and no guess."""
    return LONG if known else SLOWER * LONG


def _scaled(noise: float, was: float, now: float) -> float:
    """The noise (counts^2) of a surface whose level changed: its pattern is a share of its light, of which
    counts near the top tell little."""
    tells, told = now - now * now / FULL_SCALE, was - was * was / FULL_SCALE
    by = (tells if tells > 1.0 else 1.0) / (told if told > 1.0 else 1.0)
    scaled = noise * by * by
    if by > 1.0:  # not all that a reading at the top has of it is pattern
        level, pattern = now / was, PATTERN * tells
        most = noise * level * level if level > 1.0 else noise
        most = most if most > pattern * pattern else pattern * pattern
        scaled = scaled if scaled < most else most
    return scaled if scaled > CONVERTER_NOISE else CONVERTER_NOISE


def light_per_count(counts: float) -> float:
    """Change of the light that changes the reading by one count."""
    return FULL_SCALE / max(counts, 1.0) ** 2
