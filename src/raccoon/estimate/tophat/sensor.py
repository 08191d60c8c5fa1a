"""Sensor generation, height and light that explain two levels (raccoon.model.reflectance)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from raccoon.model.reflectance import GENERATIONS, NEAR_HEIGHT, SensorModel, fit, light_of

MIN_HEIGHT, MAX_HEIGHT = 0.003, 0.035  # m; where people mount them
BLACK_MISFIT, WHITE_MISFIT = 0.10, 0.015  # allowed misfit as shares of v and u: tapes and sensors differ
SUN_BY_BLACK_SD = 0.03  # sd of black's share of the sun's light
DARKEST_WHITE_SHARE = 0.8  # share of the own light from white that the darkest white reflects
MOSTLY_DARK_SHARE = 0.6  # share of a drive; more of it is seldom black
DIM_LIGHT_SHARE = 0.3  # share of white's light; in lamps' light black seldom reflects more
FARTHEST_LIGHT_SHARE = 0.4  # least share of the light at the greatest height: sensors differ by so much


@dataclass(frozen=True, slots=True)
class Explanation:
    """One sensor that would read these two levels.

    height: m. ambient: 0 is the paper's normal light, 1 its direct sun. reflected: the sensor's own light
    from white; least_reflected: its lower bound, as in the sun it is a small difference of two large ones.
    farthest: the same from the greatest height. sun_by_black: black's share of the ambient light from white.
    """

    generation: str
    height: float
    ambient: float
    reflected: float
    sun_by_black: float
    least_reflected: float
    farthest: float


def explain_levels(white: float, black: float) -> list[Explanation]:
    """The sensor generations that can read `white` and `black` (counts), the most likely first: none, one or
    two.

    Own and ambient light follow from the two readings, since black absorbs them differently: u = R + L + A, v
    = r R + L + s A. In the sun R is a small difference with a large error, so it is moved to the nearest
    possible height; a generation is excluded if v does not fit then. Two remaining ones are common indoors:
    an old sensor at 23 mm and a new one at 9 mm read alike.
    """
    u, v = light_of(max(white, 1.0)), light_of(max(black, 1.0))
    found = [_explain(fit(generation), u, v) for generation in GENERATIONS]
    return sorted((each for each in found if each is not None), key=_implausibility)


@cache
def max_black_share() -> float:
    """The most that black reflects as a share of white's light: its share in nothing but sunlight. Its shares
    of the light of lamps and of the sensor itself are smaller."""
    return (1.0 + BLACK_MISFIT) * max(fit(generation).sun_by_black for generation in GENERATIONS)


def why_not_black(white: float, black: float, share: float) -> tuple[str, bool]:
    """Reason why the darker of two levels (counts) is another white ("" if it may be black), and whether that
    is certain. share: of the readings, on the darker one."""
    sent = light_of(max(black, 1.0)) / light_of(max(white, 1.0))
    told = (
        f"the darker surface ({black:.0f} counts) returns {sent:.0%} of the light of the other ({white:.0f})"
    )
    if sent > max_black_share():
        return f"{told}, and black at most {max_black_share():.0%}: it is a board or a seam, not a line", True
    if share > MOSTLY_DARK_SHARE and sent > DIM_LIGHT_SHARE:
        return f"{told}, and covers most of the way: it may be white, and the other glare", False
    return "", False


def _explain(model: SensorModel, u: float, v: float) -> Explanation | None:
    r, s = model.reflected_by_black, model.sun_by_black
    reflected = u - model.leak - (v - model.leak - r * (u - model.leak)) / (s - r)
    most, least = (model.at(height).reflected for height in (MIN_HEIGHT, MAX_HEIGHT))
    reflected = min(max(reflected, least), most, max(u - model.leak, least))
    sun = max(u - model.leak - reflected, 0.0)
    if abs(r * reflected + model.leak + s * sun - v) > BLACK_MISFIT * v + WHITE_MISFIT * u:
        return None
    height = NEAR_HEIGHT * (reflected / model.reflected_near) ** (-1.0 / model.falloff)
    ambient = sun / (model.sun_near * (height / NEAR_HEIGHT) ** model.sun_exponent)
    doubt = math.hypot(BLACK_MISFIT * v, SUN_BY_BLACK_SD * sun) / (s - r)
    farthest = FARTHEST_LIGHT_SHARE * least
    sure = max(DARKEST_WHITE_SHARE * reflected - 2.0 * doubt, farthest)
    return Explanation(model.generation, height, ambient, reflected, s, sure, farthest)


def _implausibility(explanation: Explanation) -> float:
    """Distance from the usual: heights of 5 to 25 mm, and indoors rather than in the sun."""
    below = max(0.005 / explanation.height - 1.0, 0.0)
    above = max(explanation.height / 0.025 - 1.0, 0.0)
    return below + above + 0.1 * explanation.ambient
