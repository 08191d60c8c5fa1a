"""The cluster calibrator: how many surfaces are in these readings, and where to cut between them.

One-dimensional Gaussian mixtures of one, two and three components (scikit-learn) compete by evidence (BIC)
with each other and with one surface of any usual shape. Components that overlap are one surface: a floor that
is not Gaussian takes several. What is left must stand apart by more than noise can pretend.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP
from raccoon.estimate.tophat.calibration import LEAST_SD, Surface, TophatCalibration, Verdict, believed
from raccoon.estimate.tophat.flicker import UNEVEN, demodulated, lamps
from raccoon.estimate.tophat.mixture import best_mixture, single_surface_bic
from raccoon.estimate.tophat.quality import checked, nothing, refusal, wide_enough
from raccoon.estimate.tophat.sensor import not_black
from raccoon.estimate.tophat.sequence import (
    changes_quickly,
    in_runs,
    noise_sd,
    runs,
    settled,
    spikes,
    trend,
)

Array = NDArray[np.float64]

MOST_FITTED = 1000  # readings; more only cost time: every n-th of the sorted ones keeps the distribution
LEAST_COUNT = 3  # readings on the rarer surface
SLOPE = 4.0  # standard deviations of a peak that count as its top
APART = 2.1  # separation below which components are one surface (halves of a uniform floor have 1.73)
SURE = 2.5  # separation from which a threshold is `ok`
SURE_COUNT = 8  # readings on the rarer surface below which a near threshold is not well known
FAR_APART = 4.0  # separation from which that does not matter
NEARLY_ALL = 0.98  # of the readings searched already; the rest changes nothing
RARE = 0.03  # share of black below which lone readings may be spikes
BORROWED = 8.0  # readings that the other surface's spread is worth as a guess of this one's
DRIFT = 3.0  # noise standard deviations by which the floor may wander before it is called a drift
SOME_EVIDENCE, EVIDENCE = 2.0, 10.0
"""BIC by which two surfaces must beat one of any shape where no order tells: "positive" gives a weak verdict,
"very strong" a sure one (Kass and Raftery 1995, Bayes factors)."""


def calibrate(samples: ArrayLike, ways: ArrayLike | None = None) -> TophatCalibration:
    """Find white and black in the readings of a drive.

    samples: counts 0..4095, shape (n,), in order of time where there is one: edges, spikes and drift are then
    told from surfaces. The threshold takes black to be as likely as white, whatever the share in the samples:
    a line is rarely driven over but always meant. ways: m that the sensor went to each reading, shape (n,),
    where that is known: what is narrower than any line is a seam then, as dark as it may be. NaN at the first
    reading of each drive.

    Raises ConfigError for anything that is not 1-D finite numbers in 0..4095, or another number of ways.
    """
    counts = checked(samples)
    found = _whatever_width(counts)
    return found if ways is None else wide_enough(found, counts, ways)


def _whatever_width(counts: Array) -> TophatCalibration:
    """The calibration, of a line or of a seam."""
    refused = refusal(counts)
    if refused is not None:
        return refused
    hertz = lamps(counts)
    if hertz:
        found = _found(demodulated(counts, hertz))
        told = "flickers" if hertz == UNEVEN else f"flickers at {hertz} Hz"
        return replace(found, flickers=hertz, reason=f"{found.reason}; the light {told}")
    return _found(counts)


def _found(counts: Array) -> TophatCalibration:
    """The calibration on readings that are worth a search."""
    calm = settled(counts) & ~spikes(counts)
    found = clusters(counts[calm])
    judged = _in_order(counts, found) or _on_level(counts) or _against_trend(counts, calm)
    if judged is not None:
        return judged
    if calm.mean() < NEARLY_ALL:
        found = clusters(counts)
    return _in_no_order(counts, found)


def _in_order(counts: Array, found: Clusters) -> TophatCalibration | None:
    """The calibration, where the darker readings come in rows with edges as short as a line's."""
    if len(found.surfaces) < 2:
        return None
    white, black = _two_sides(found.surfaces)
    if not in_runs(counts, _middle(white, black)) or not changes_quickly(counts, white.mean, black.mean):
        return None
    level = counts[settled(counts, ends=True)]
    white, black = _without_edges(white, level), _without_edges(black, level)
    return _judged(_at_least_few(white, counts, -1.0), _at_least_few(black, counts, 1.0))


def _on_level(counts: Array) -> TophatCalibration | None:
    """The same where the first and last readings of edges, left out here, hid a narrow line."""
    level = counts[settled(counts, ends=True) & ~spikes(counts)]
    return _in_order(counts, clusters(level)) if len(level) >= SURE_COUNT else None


def _without_edges(surface: Surface, level: Array) -> Surface:
    """The surface by its `level` readings, where there are some: the first of an edge to a surface that is
    ten times as dark reads many times what noise does.
    """
    own = level[np.abs(level - surface.mean) <= SLOPE * surface.sd]
    if len(own) < SURE_COUNT:
        return surface
    return Surface(float(own.mean()), max(float(own.std()), LEAST_SD), surface.count)


def _at_least_few(surface: Surface, counts: Array, outward: float) -> Surface:
    """The surface, with the readings on its slopes where hardly any is level: a line as wide as the spot.

    outward: 1 for the darker surface, -1 for the brighter.
    """
    if surface.count >= LEAST_COUNT:
        return surface
    near = counts[outward * (counts - surface.mean) > -SLOPE * surface.sd]
    return Surface(float(near.mean()), max(float(near.std()), surface.sd), len(near))


def _against_trend(counts: Array, calm: NDArray[np.bool_]) -> TophatCalibration | None:
    """The same for readings whose floor drifts, at the level where the drive ended."""
    slow, known = trend(counts)
    drift = float(np.ptp(slow))
    if drift < DRIFT * noise_sd(counts) or not calm[known].any():  # a drift as steep as an edge is all edge
        return None
    level = float(slow[-1])
    flat = (counts - slow + level)[known]
    judged = _in_order(flat, clusters(flat[calm[known]]))
    if judged is None or judged.separation < FAR_APART or judged.white is None or judged.black is None:
        return None
    told = f"{judged.reason}; the light drifted by {drift:.0f} counts, the threshold holds for the end"
    lasting = drift < 0.5 * (judged.black.mean - judged.white.mean)
    return replace(judged, verdict=judged.verdict if lasting else Verdict.WEAK, reason=told)


def _in_no_order(counts: Array, found: Clusters) -> TophatCalibration:
    """The calibration of a shuffled sample, or of one surface. Readings in rows had their chance before."""
    evidence = found.evidence
    if evidence < SOME_EVIDENCE:
        return nothing(counts)
    white, black = _two_sides(found.surfaces)
    middle = _middle(white, black)
    if in_runs(counts, middle):
        return TophatCalibration(
            Verdict.ONE_SURFACE, "the readings drift between two levels but never cross an edge", white=white
        )
    dark = counts > middle
    alone = runs(dark) == np.count_nonzero(dark)
    judged = _judged(white, black)
    if judged.verdict is not Verdict.OK:
        return judged
    if alone and judged.share_black < RARE:
        told = f"{black.count} dark readings, each alone: a line, or spikes"
        return replace(judged, verdict=Verdict.WEAK, reason=told)
    if evidence < EVIDENCE:
        return replace(judged, verdict=Verdict.WEAK, reason="it may be one surface with a long tail")
    return judged


def _middle(white: Surface, black: Surface) -> float:
    """Counts as many standard deviations from white as from black."""
    return white.mean + (black.mean - white.mean) * white.sd / (white.sd + black.sd)


def calibrate_two_phase(floor: ArrayLike, line: ArrayLike) -> TophatCalibration:
    """The same from two collections: the robot stood or drove on white first, then on black.

    Raises ConfigError as `calibrate` does.
    """
    sets = [checked(floor), checked(line)]
    refused = [each for each in map(refusal, sets) if each is not None]
    for each in refused:
        # Black alone may stand at the top of the converter, and white at its bottom.
        if each.verdict is Verdict.TOO_FEW or len(refused) == 2:
            return each
    white, black = (_bulk(counts) for counts in sets)
    if _separation(white, black) < APART:
        return TophatCalibration(
            Verdict.ONE_SURFACE,
            f"floor {white.mean:.0f} and line {black.mean:.0f} counts do not stand apart",
            white=white,
        )
    return _judged(white, black)


@dataclass(frozen=True, slots=True)
class Clusters:
    """What a search found: surfaces, bright first; the readings it saw, ascending; the BIC of its mixture."""

    surfaces: list[Surface]
    ordered: Array
    bic: float

    @property
    def evidence(self) -> float:
        """BIC of one surface of any usual shape less that of the mixture: above 0 speaks for several."""
        return single_surface_bic(self.ordered) - self.bic if len(self.surfaces) > 1 else 0.0


def clusters(counts: Array) -> Clusters:
    """The surfaces in readings of any order."""
    ordered = np.sort(counts)
    step = -(-len(ordered) // MOST_FITTED)
    ordered = ordered[step // 2 :: step]
    if ordered[0] == ordered[-1]:
        return Clusters([Surface.of(counts)], ordered, 0.0)
    mixture = best_mixture(ordered)
    merged: list[Surface] = []
    for each in mixture.components:
        surface = Surface(each.mean, max(each.sd, LEAST_SD), round(each.weight * len(counts)))
        while merged and _separation(merged[-1], surface) < APART:
            surface = _joined(merged.pop(), surface)
        merged.append(surface)
    return Clusters(merged if len(merged) > 1 else [Surface.of(counts)], ordered, mixture.bic)


def _judged(white: Surface, black: Surface) -> TophatCalibration:
    rarer = min(white.count, black.count)
    share = black.count / (white.count + black.count)
    separation = _separation(white, black)
    if rarer < LEAST_COUNT:
        return TophatCalibration(
            Verdict.ONE_SURFACE, f"{rarer} readings are not a second surface", white=white
        )
    wrong, surely = not_black(white.mean, black.mean, share)
    if surely:
        return TophatCalibration(Verdict.ONE_SURFACE, wrong, white=white)
    verdict, reason = Verdict.OK, f"separation {separation:.1f} standard deviations"
    if separation < SURE:
        verdict, reason = Verdict.WEAK, f"separation is only {separation:.1f} standard deviations"
    elif rarer < SURE_COUNT and separation < FAR_APART:
        verdict, reason = Verdict.WEAK, f"only {rarer} readings of the rarer surface, and close to the other"
    elif white.mean <= ANALOG_BOTTOM:
        reason = f"white reads {white.mean:.0f}, the converter's bottom: a change of the light is seen late"
        verdict = Verdict.WEAK
    elif black.mean >= ANALOG_TOP:
        reason = f"black reads {black.mean:.0f}, the converter's top, as an input does whose wire is loose"
        verdict = Verdict.WEAK
    elif wrong:
        verdict, reason = Verdict.WEAK, wrong
    return believed(verdict, reason, _shrunk(white, black), _shrunk(black, white), share)


def _two_sides(found: list[Surface]) -> tuple[Surface, Surface]:
    """Two surfaces of two or three: a middle one belongs to the side that it stands closer to.

    A middle one that holds few readings is the edges, seen on the way across: it belongs to neither.
    """
    if len(found) == 2:
        return found[0], found[1]
    white, middle, black = found
    if middle.count < max(white.count, black.count) and middle.count < 2 * min(white.count, black.count):
        return white, black
    if _separation(white, middle) < _separation(middle, black):
        return _joined(white, middle), black
    return white, _joined(middle, black)


def _separation(white: Surface, black: Surface) -> float:
    return (black.mean - white.mean) / (white.sd + black.sd)


def _joined(one: Surface, other: Surface) -> Surface:
    """Both as one surface, with the moments of the two together."""
    count = max(one.count + other.count, 1)
    share = other.count / count
    mean = one.mean + share * (other.mean - one.mean)
    variance = (1 - share) * (one.sd**2 + (one.mean - mean) ** 2)
    variance += share * (other.sd**2 + (other.mean - mean) ** 2)
    return Surface(mean, variance**0.5, count)


def _shrunk(surface: Surface, other: Surface) -> Surface:
    """A few readings say little of their spread: the other surface's counts as that many of them.

    By the ratio of the spreads, so that many readings keep theirs beside a surface a hundred times as wide.
    """
    share = BORROWED / (surface.count + BORROWED)
    if other.sd > surface.sd:
        sd = surface.sd * (other.sd / surface.sd) ** share
    else:
        sd = (surface.sd**2 + share * (other.sd**2 - surface.sd**2)) ** 0.5
    return Surface(surface.mean, max(sd, LEAST_SD), surface.count)


def _bulk(counts: Array) -> Surface:
    """The surface that most of the readings come from."""
    return max(clusters(counts[settled(counts)]).surfaces, key=lambda each: each.count)
