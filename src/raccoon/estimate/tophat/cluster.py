"""Calibration by clusters: the number of surfaces in a set of readings, and the threshold between them.

One-dimensional Gaussian mixtures of one, two and three components (scikit-learn) compete by evidence (BIC)
with each other and with one surface of any usual shape. Overlapping components are one surface: a floor that
is not Gaussian takes several. The others must be further apart than noise explains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP
from raccoon.estimate.tophat.calibration import MIN_SD, Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.flicker import UNEVEN_HZ, average_out_flicker, detect_flicker_hz
from raccoon.estimate.tophat.mixture import best_mixture, single_surface_bic
from raccoon.estimate.tophat.quality import check_counts, find_refusal, no_surfaces_calibration, refuse_narrow
from raccoon.estimate.tophat.sensor import why_not_black
from raccoon.estimate.tophat.sequence import (
    comes_in_runs,
    count_runs,
    has_quick_edge,
    noise_sd,
    running_trend,
    settled_mask,
    spike_mask,
)

Array = NDArray[np.float64]
MAX_FITTED = 1000  # readings; of more, every n-th of the sorted ones, which keeps the distribution
MIN_COUNT = 3  # readings on the rarer surface
SLOPE_SDS = 4.0  # standard deviations of a peak that belong to it
MIN_SEPARATION = 2.1  # bound below which components are one surface (halves of a uniform floor: 1.73)
SURE_SEPARATION = 2.5  # least separation for `ok`
SURE_COUNT = 8  # readings on the rarer surface; with fewer a near threshold is uncertain
FAR_SEPARATION = 4.0  # separation above which that does not matter
SEARCHED_SHARE = 0.98  # of the readings; if so many were searched, the rest changes nothing
RARE_BLACK_SHARE = 0.03  # share of black; below it single readings may be spikes
BORROWED_READINGS = 8.0  # weight of the other surface's standard deviation, in readings
DRIFT_SDS = 3.0  # noise standard deviations; a slower change is no drift
WEAK_EVIDENCE, SURE_EVIDENCE = 2.0, 10.0
"""Difference of BIC by which two surfaces must beat one of any shape in readings without order: "positive"
gives a weak verdict, "very strong" a sure one (Kass and Raftery 1995, Bayes factors)."""


def calibrate(samples: ArrayLike, ways: ArrayLike | None = None) -> TophatCalibration:
    """Find white and black in the readings of a drive.

    samples: counts 0..4095, shape (n,), in order of time if they have one: that distinguishes edges, spikes
    and drift from surfaces. For the threshold, black is as likely as white, whatever its share of the
    samples: a line is rarely driven over, but always meant. ways: m that the sensor moved to each reading,
    shape (n,), if known: then a surface narrower than any line is a seam, however dark. NaN at the first
    reading of each drive.

    Raises ConfigError for anything but 1-D finite numbers in 0..4095, or for another number of ways.
    """
    counts = check_counts(samples)
    found = _calibrate_any_width(counts)
    return found if ways is None else refuse_narrow(found, counts, ways)


def _calibrate_any_width(counts: Array) -> TophatCalibration:
    """The calibration; its black may be a line or a seam."""
    refused = find_refusal(counts)
    if refused is not None:
        return refused
    hertz = detect_flicker_hz(counts)
    if hertz:
        found = _calibrate_counts(average_out_flicker(counts, hertz))
        told = "flickers" if hertz == UNEVEN_HZ else f"flickers at {hertz} Hz"
        return replace(found, flickers=hertz, reason=f"{found.reason}; the light {told}")
    return _calibrate_counts(counts)


def _calibrate_counts(counts: Array) -> TophatCalibration:
    """The calibration with readings that `find_refusal` does not refuse."""
    calm = settled_mask(counts) & ~spike_mask(counts)
    found = find_clusters(counts[calm])
    judged = _calibrate_ordered(counts, found) or _calibrate_level_readings(counts)
    judged = judged or _calibrate_detrended(counts, calm)
    if judged is not None:
        return judged
    if calm.mean() < SEARCHED_SHARE:
        found = find_clusters(counts)
    return _calibrate_unordered(counts, found)


def _calibrate_ordered(counts: Array, found: Clusters) -> TophatCalibration | None:
    """The calibration if the darker readings come in runs with edges as short as a line's; else None."""
    if len(found.surfaces) < 2:
        return None
    white, black = _merge_to_two(found.surfaces)
    if not comes_in_runs(counts, _balanced_cut(white, black)):
        return None
    if not has_quick_edge(counts, white.mean, black.mean):
        return None
    level = counts[settled_mask(counts, ends=True)]
    white, black = _without_edges(white, level), _without_edges(black, level)
    white, black = _with_slope_readings(white, counts, -1.0), _with_slope_readings(black, counts, 1.0)
    return _judge_surfaces(white, black)


def _calibrate_level_readings(counts: Array) -> TophatCalibration | None:
    """As `_calibrate_ordered`, without the first and last readings of edges, which hide a narrow line."""
    level = counts[settled_mask(counts, ends=True) & ~spike_mask(counts)]
    return _calibrate_ordered(counts, find_clusters(level)) if len(level) >= SURE_COUNT else None


def _without_edges(surface: Surface, level: Array) -> Surface:
    """The surface from its `level` readings, if there are some: the first reading on an edge to a surface ten
    times as dark differs by many times the noise."""
    own = level[np.abs(level - surface.mean) <= SLOPE_SDS * surface.sd]
    if len(own) < SURE_COUNT:
        return surface
    return Surface(float(own.mean()), max(float(own.std()), MIN_SD), surface.count)


def _with_slope_readings(surface: Surface, counts: Array, outward: float) -> Surface:
    """The surface with the readings on its slopes, if hardly any is level: a line as wide as the spot.

    outward: 1 for the darker surface, -1 for the brighter one.
    """
    if surface.count >= MIN_COUNT:
        return surface
    near = counts[outward * (counts - surface.mean) > -SLOPE_SDS * surface.sd]
    return Surface(float(near.mean()), max(float(near.std()), surface.sd), len(near))


def _calibrate_detrended(counts: Array, calm: NDArray[np.bool_]) -> TophatCalibration | None:
    """As `_calibrate_ordered` for readings with a drifting floor, at the level at the end of the drive."""
    trend, known = running_trend(counts)
    drift = float(np.ptp(trend))
    # Without a calm reading the drift is as steep as an edge.
    if drift < DRIFT_SDS * noise_sd(counts) or not calm[known].any():
        return None
    level = float(trend[-1])
    flat = (counts - trend + level)[known]
    judged = _calibrate_ordered(flat, find_clusters(flat[calm[known]]))
    if judged is None or judged.separation < FAR_SEPARATION or judged.white is None or judged.black is None:
        return None
    told = f"{judged.reason}; the light drifted by {drift:.0f} counts, the threshold is for the last light"
    lasting = drift < 0.5 * (judged.black.mean - judged.white.mean)
    return replace(judged, verdict=judged.verdict if lasting else Verdict.WEAK, reason=told)


def _calibrate_unordered(counts: Array, found: Clusters) -> TophatCalibration:
    """The calibration of a shuffled sample or of one surface; ordered readings were tried before."""
    evidence = found.evidence
    if evidence < WEAK_EVIDENCE:
        return no_surfaces_calibration(counts)
    white, black = _merge_to_two(found.surfaces)
    middle = _balanced_cut(white, black)
    if comes_in_runs(counts, middle):
        told = "the readings drift between two levels but never cross an edge"
        return TophatCalibration(Verdict.ONE_SURFACE, told, white=white)
    dark = counts > middle
    all_lone = count_runs(dark) == np.count_nonzero(dark)
    judged = _judge_surfaces(white, black)
    if judged.verdict is not Verdict.OK:
        return judged
    if all_lone and judged.share_black < RARE_BLACK_SHARE:
        told = f"{black.count} single dark readings: a line, or spikes"
        return replace(judged, verdict=Verdict.WEAK, reason=told)
    if evidence < SURE_EVIDENCE:
        return replace(judged, verdict=Verdict.WEAK, reason="it may be one surface with a long tail")
    return judged


def _balanced_cut(white: Surface, black: Surface) -> float:
    """Counts at equal distance from white and black, in their standard deviations."""
    return white.mean + (black.mean - white.mean) * white.sd / (white.sd + black.sd)


def calibrate_two_phase(floor: ArrayLike, line: ArrayLike) -> TophatCalibration:
    """The calibration from two collections: on white first, then on black.

    Raises ConfigError as `calibrate` does.
    """
    sets = [check_counts(floor), check_counts(line)]
    refused = [each for each in map(find_refusal, sets) if each is not None]
    for each in refused:
        # With one refused, black may be at the top of the converter, or white at its bottom.
        if each.verdict is Verdict.TOO_FEW or len(refused) == 2:
            return each
    white, black = (_main_surface(counts) for counts in sets)
    if _separation(white, black) < MIN_SEPARATION:
        return TophatCalibration(
            Verdict.ONE_SURFACE,
            f"floor {white.mean:.0f} and line {black.mean:.0f} counts are too close to each other",
            white=white,
        )
    return _judge_surfaces(white, black)


@dataclass(frozen=True, slots=True)
class Clusters:
    """Result of a search: surfaces, bright first; the readings used, ascending; BIC of the mixture."""

    surfaces: list[Surface]
    ordered: Array
    bic: float

    @property
    def evidence(self) -> float:
        """BIC of one surface of any usual shape minus that of the mixture; positive for several surfaces."""
        return single_surface_bic(self.ordered) - self.bic if len(self.surfaces) > 1 else 0.0


def find_clusters(counts: Array) -> Clusters:
    """The surfaces in readings, regardless of order."""
    ordered = np.sort(counts)
    step = -(-len(ordered) // MAX_FITTED)
    ordered = ordered[step // 2 :: step]
    if ordered[0] == ordered[-1]:
        return Clusters([Surface.of(counts)], ordered, 0.0)
    mixture = best_mixture(ordered)
    merged: list[Surface] = []
    for each in mixture.components:
        surface = Surface(each.mean, max(each.sd, MIN_SD), round(each.weight * len(counts)))
        while merged and _separation(merged[-1], surface) < MIN_SEPARATION:
            surface = _merged_surface(merged.pop(), surface)
        merged.append(surface)
    return Clusters(merged if len(merged) > 1 else [Surface.of(counts)], ordered, mixture.bic)


def _judge_surfaces(white: Surface, black: Surface) -> TophatCalibration:
    rarer = min(white.count, black.count)
    share = black.count / (white.count + black.count)
    separation = _separation(white, black)
    if rarer < MIN_COUNT:
        reason = f"{rarer} readings are too few for a second surface"
        return TophatCalibration(Verdict.ONE_SURFACE, reason, white=white)
    not_black, is_sure = why_not_black(white.mean, black.mean, share)
    if is_sure:
        return TophatCalibration(Verdict.ONE_SURFACE, not_black, white=white)
    weakness = not_black
    if separation < SURE_SEPARATION:
        weakness = f"separation is only {separation:.1f} standard deviations"
    elif rarer < SURE_COUNT and separation < FAR_SEPARATION:
        weakness = f"only {rarer} readings of the rarer surface, whose level is close to the other"
    elif white.mean <= ANALOG_BOTTOM:
        weakness = f"white reads {white.mean:.0f}, the converter's bottom: a change of the light is seen late"
    elif black.mean >= ANALOG_TOP:
        weakness = f"black reads {black.mean:.0f}, the converter's top, as an input with a loose wire does"
    verdict = Verdict.WEAK if weakness else Verdict.OK
    reason = weakness or f"separation {separation:.1f} standard deviations"
    return TophatCalibration.of_surfaces(
        verdict, reason, _shrink_spread(white, black), _shrink_spread(black, white), share
    )


def _merge_to_two(found: list[Surface]) -> tuple[Surface, Surface]:
    """Two surfaces from two or three: a middle one is merged with the nearer one.

    A middle one with few readings comes from crossing edges, and is dropped.
    """
    if len(found) == 2:
        return found[0], found[1]
    white, middle, black = found
    if middle.count < max(white.count, black.count) and middle.count < 2 * min(white.count, black.count):
        return white, black
    if _separation(white, middle) < _separation(middle, black):
        return _merged_surface(white, middle), black
    return white, _merged_surface(middle, black)


def _separation(white: Surface, black: Surface) -> float:
    return (black.mean - white.mean) / (white.sd + black.sd)


def _merged_surface(one: Surface, other: Surface) -> Surface:
    """Both as one surface, with the same moments."""
    count = max(one.count + other.count, 1)
    share = other.count / count
    mean = one.mean + share * (other.mean - one.mean)
    variance = (1 - share) * (one.sd**2 + (one.mean - mean) ** 2)
    variance += share * (other.sd**2 + (other.mean - mean) ** 2)
    return Surface(mean, variance**0.5, count)


def _shrink_spread(surface: Surface, other: Surface) -> Surface:
    """The surface with its standard deviation, known from few readings, moved towards the other's.

    Upwards geometrically, so that many readings keep theirs beside a surface a hundred times as wide.
    """
    share = BORROWED_READINGS / (surface.count + BORROWED_READINGS)
    if other.sd > surface.sd:
        sd = surface.sd * (other.sd / surface.sd) ** share
    else:
        sd = (surface.sd**2 + share * (other.sd**2 - surface.sd**2)) ** 0.5
    return Surface(surface.mean, max(sd, MIN_SD), surface.count)


def _main_surface(counts: Array) -> Surface:
    """The surface of most of the readings."""
    return max(find_clusters(counts[settled_mask(counts)]).surfaces, key=lambda each: each.count)
