"""What a reflectance sensor read over white and over black, piece of time by piece of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PIECES = 10
FEWEST = 8
LEAST_CONTRAST = 12.0
CLEAR = 5.0
"""Noise deviations that the two levels must lie apart to be two."""
EDGE = 0.2
"""Share of the contrast around a level; readings outside lie on an edge."""
EDGE_SECONDS = 0.03
"""S: a spot of 5 mm is over an edge for so long, before its middle and after, at 0.08 m/s."""
SMALLEST_SD = 1.0
NOISY = 50.0
"""Counts from reading to reading that no floor makes: `_pattern` is 20 at the most."""
CUT = 0.1
"""Share of a surface's readings at the end of the converter from which its level is cut off."""
CLEARLY_MORE = 1.5
"""How much more a floor's pattern must show over one surface to be told from noise."""
OUTLIER = 5.0
"""Noise deviations from which a step between neighbours is no noise."""
SAME_UNIT = 4.0
"""Counts by which two sound sensors of one make differ on the same floor at the least."""
FLOOR_SHARE = 0.02
"""Of its light by which one piece of floor differs from another (`raccoon.model.reflectance.read`)."""
VISITS = 3
"""How often black must have been seen, where no reference says what is black: a shadow over white falls once
or twice, and its two levels are those of no sensor."""
ROBUST = 1.4826
"""Standard deviation of normal numbers over their median distance from the middle."""


@dataclass(frozen=True, slots=True)
class Levels:
    """Readings of one sensor sorted by surface.

    time, counts, black (n,): the readings that lie clearly on a surface. noise: counts, sd of a reading.
    pattern: counts, how much of that the floor itself may make. piece (n,): piece of time of each. usual:
    counts, white and black over all. cut: for white and black, 1 where the level is cut off at the
    converter's largest value, -1 at 0, else 0. sorted_surely: a reference told white from black, or both
    were seen in turns.
    """

    time: Array
    counts: Array
    black: Flags
    noise: float
    piece: NDArray[np.intp]
    usual: tuple[float, float]
    cut: tuple[int, int]
    sorted_surely: bool
    pattern: float

    @property
    def whole(self) -> int:
        """How many of the two levels were read as they are."""
        return self.cut.count(0)

    def part(self, keep: Flags) -> Levels | None:
        """The levels of a part of the time; None where it did not see enough of both."""
        if min((keep & self.black).sum(), (keep & ~self.black).sum()) < FEWEST:
            return None
        time, counts, black = self.time[keep], self.counts[keep], self.black[keep]
        return Levels(
            time,
            counts,
            black,
            self.noise,
            pieces(time),
            *_usual(counts, black),
            self.sorted_surely,
            self.pattern,
        )

    def means(self, keep: Flags) -> Array:
        """Rows of piece, black 0/1, level, its deviation, for pieces with enough readings."""
        rows = []
        for piece in range(PIECES):
            for black in (False, True):
                mine = keep & (self.piece == piece) & (self.black == black)
                if mine.sum() >= FEWEST:
                    values = self.counts[mine]
                    rows.append((piece, float(black), float(np.median(values)), self._deviation(values)))
        return np.array(rows).reshape(-1, 4)

    def both(self, keep: Flags) -> Array:
        """Rows of black 0/1, level, and by how much a sound sensor's may be off: by its own spread, and since
        no two floors and no two sensors are alike."""
        rows = []
        for black in (False, True):
            values = self.counts[keep & (self.black == black)]
            level = float(np.median(values))
            off = np.hypot(np.hypot(self._deviation(values), SAME_UNIT), _pattern(level))
            rows.append((float(black), level, float(off)))
        return np.array(rows)

    def _deviation(self, values: Array) -> float:
        return _median_off(values, self.noise)


def levels_of(time: Array, counts: Array, surface: Array | None) -> Levels | str:
    """Sort the readings. surface: 1 black, 0 white where a reference says so, else the readings decide.

    Gives the reason as text where it cannot be done.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    if len(counts) < 4 * FEWEST:
        return f"it has {len(counts)} readings: at least {4 * FEWEST} are needed"
    noise = _noise(np.diff(counts))
    piece = pieces(time)
    if surface is not None:
        black = surface[known] > 0.5
        sure = _far_from_change(time, black)
    else:
        sorted_ = _by_reading(counts, piece, noise)
        if sorted_ is None:
            return _one_surface(counts, noise)
        black, sure = sorted_
    if min((sure & black).sum(), (sure & ~black).sum()) < FEWEST:
        return _one_surface(counts, noise if surface is None else 0.0)
    usual, cut = _usual(counts[sure], black[sure])
    # Edges are steps, not noise; and what is cut off has none.
    steady = sure & _far_from_change(time, black) & np.where(black, cut[1] == 0, cut[0] == 0)
    pairs = steady[1:] & steady[:-1] & (black[1:] == black[:-1])
    if pairs.sum() >= FEWEST:
        noise = _noise(np.diff(counts)[pairs])
    quiet, pattern = _quieter(np.diff(counts), pairs, black, usual, noise)
    off = noise if surface is None else _apart(counts[sure], black[sure], noise)
    if abs(usual[1] - usual[0]) < max(LEAST_CONTRAST, CLEAR * off):
        end = "; both are cut off: it is saturated" if 0 not in cut else ""
        return f"white ({usual[0]:.0f}) and black ({usual[1]:.0f} counts) cannot be told apart{end}"
    if usual[1] < usual[0]:
        return (
            f"black ({usual[1]:.0f}) reads lower than white ({usual[0]:.0f} counts), which no light, gain or "
            "height does: the labels of black and white look swapped"
        )
    if 0 not in cut:
        return f"white ({usual[0]:.0f}) and black ({usual[1]:.0f} counts) are both cut off"
    surely = surface is not None or _visits(black[sure]) >= VISITS
    return Levels(time[sure], counts[sure], black[sure], quiet, piece[sure], usual, cut, surely, pattern)


def pair_of(counts: Array, black: Flags | None) -> tuple[float, float] | None:
    """Levels of white and of black, by `black` or else by the readings; None where not both are seen."""
    if black is not None:
        sides = counts[~black], counts[black]
        if min(map(len, sides)) < FEWEST:
            return None
        return float(np.median(sides[0])), float(np.median(sides[1]))
    found = _threshold(counts, _noise(np.diff(counts))) if len(counts) > 1 else None
    return None if found is None else (found[0], found[2])


def pieces(time: Array) -> NDArray[np.intp]:
    """Piece of time of each reading."""
    share = (time - time[0]) / max(float(np.ptp(time)), 1e-9)
    return np.asarray(np.minimum(share * PIECES, PIECES - 1), np.intp)


def _apart(counts: Array, black: Flags, noise: float) -> float:
    """Deviation of the contrast where a reference says what is black: then single readings need not tell."""
    return float(np.hypot(_median_off(counts[black], noise), _median_off(counts[~black], noise)))


def _median_off(values: Array, noise: float) -> float:
    """Deviation of a median, which some readings on an edge do not move. The floor's own brightness is alike
    for neighbouring readings: a tenth of them counts."""
    spread = max(_spread(values), noise)
    return float(np.sqrt(0.5 * np.pi) * spread / np.sqrt(max(len(values) / 10.0, 1.0)))


def _one_surface(counts: Array, noise: float) -> str:
    """Why nothing is told. noise: counts, of readings that had to tell the surfaces themselves."""
    if noise >= NOISY:
        return (
            f"readings differ by {noise:.0f} counts from one to the next, which hides what is white and what "
            "black: check its plug and wires, and keep it from flickering lamps"
        )
    ends = float(((counts >= FULL_SCALE) | (counts <= 0.0)).mean())
    cut = f" ({100 * ends:.0f} % of the readings are cut off: it may be saturated)" if ends >= CUT else ""
    return f"only one surface was seen{cut}: drive over black and white"


def _noise(steps: Array) -> float:
    """Deviation of a reading from the steps between neighbours, those at edges and spikes left out."""
    rough = max(1.4826 * float(np.median(np.abs(steps))), np.sqrt(2.0) * SMALLEST_SD)
    usual = steps[np.abs(steps) < OUTLIER * rough]
    return max(float(np.sqrt(np.mean(usual**2) / 2.0)), SMALLEST_SD)


def _quieter(
    steps: Array, pairs: Flags, black: Flags, usual: tuple[float, float], noise: float
) -> tuple[float, float]:
    """Deviation of a reading, and how much of it the floor may make. noise: where no surface has enough.

    A converter's noise is the same over both surfaces; a floor's own pattern goes with the slope of the
    reading, and shows over white, and flickering lamps show over black. So with n² = e² + g² p² on either
    surface, p as `_pattern` has it, the noise is e; where that has no g it is the smaller n.
    """
    found = []
    for side in (False, True):
        mine = pairs & (black[1:] == side)
        if mine.sum() >= FEWEST:
            found.append((_noise(steps[mine]), _pattern(usual[int(side)])))
    if len(found) < 2:
        return found[0] if found else (noise, max(map(_pattern, usual)))
    found.sort()
    (less, little), (more, much) = found
    if much < CLEARLY_MORE * little:
        return less, min(little, much)
    square = (less**2 * much**2 - more**2 * little**2) / (much**2 - little**2)
    return max(float(np.sqrt(max(square, 0.0))), SMALLEST_SD), 0.0


def _pattern(level: float) -> float:
    """Counts that a floor's own brightness makes: counts = 4095 / (1 + x) has the slope -counts (1 - counts /
    4095) over the logarithm of light x."""
    return FLOOR_SHARE * abs(level * (1.0 - level / FULL_SCALE))


def _visits(black: Flags) -> int:
    """How often black was come to."""
    return int((np.diff(black.astype(int), prepend=0) == 1).sum())


def _spread(values: Array) -> float:
    """Their standard deviation where they are normal; a few that are far off do not widen it."""
    return ROBUST * float(np.median(np.abs(values - np.median(values))))


def _usual(counts: Array, black: Flags) -> tuple[tuple[float, float], tuple[int, int]]:
    """Usual reading over white and over black, and whether it is cut off."""
    sides = counts[~black], counts[black]
    white, dark = (float(np.median(each)) for each in sides)
    cut = [
        1 if (each >= FULL_SCALE).mean() >= CUT else -1 if (each <= 0.0).mean() >= CUT else 0
        for each in sides
    ]
    return (white, dark), (cut[0], cut[1])


def _far_from_change(time: Array, black: Flags) -> Flags:
    """Not on an edge: not beside a change of surface, nor within the time that the spot takes over one."""
    changed = np.flatnonzero(np.diff(black.astype(int)) != 0)
    sure = np.ones(len(black), np.bool_)
    for row in changed:
        start, end = np.searchsorted(time, [time[row] - EDGE_SECONDS, time[row + 1] + EDGE_SECONDS])
        sure[min(int(start), row) : max(int(end), row + 2)] = False
    return sure


def _by_reading(counts: Array, piece: NDArray[np.intp], noise: float) -> tuple[Flags, Flags] | None:
    """Black reads high. The threshold is found anew in each piece, for light that changes."""
    plain = _without_spikes(counts)
    overall = _threshold(plain, noise)
    each_own = {int(index): _threshold(plain[piece == index], noise) for index in np.unique(piece)}
    black, sure = np.zeros(len(counts), np.bool_), np.zeros(len(counts), np.bool_)
    for index, own in each_own.items():
        mine = piece == index
        if own is None or (overall is not None and own[2] - own[0] < 0.5 * (overall[2] - overall[0])):
            own = overall
        if own is None:
            continue
        low, middle, high = own
        margin = max(EDGE * (high - low), 4.0 * noise)
        black[mine] = counts[mine] > middle
        sure[mine] = np.minimum(np.abs(counts[mine] - low), np.abs(counts[mine] - high)) < margin
    if not sure.any():
        return None
    return black, sure & _beside_alike(black)


def _beside_alike(black: Flags) -> Flags:
    """Readings with a neighbour on the same surface: a lone one is a spike."""
    alike = black[1:] == black[:-1]
    return np.asarray(np.append(False, alike) | np.append(alike, False), np.bool_)


def _without_spikes(counts: Array) -> Array:
    """The median of each reading and its neighbours."""
    around = np.pad(counts, 1, mode="edge")
    return np.asarray(np.median([around[:-2], around[1:-1], around[2:]], axis=0), float)


def _threshold(counts: Array, noise: float) -> tuple[float, float, float] | None:
    """(white, threshold, black) by two means; None where the readings are of one surface, which drifts or is
    uneven: then the two lie no farther apart than each of them spreads."""
    if len(counts) < 2 * FEWEST:
        return None
    ordered = np.sort(counts)
    low, high = float(ordered[FEWEST // 2]), float(ordered[-1 - FEWEST // 2])
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = counts > middle
        if not above.any() or above.all():
            return None
        moved = float(np.median(counts[~above])), float(np.median(counts[above]))
        if moved == (low, high):
            break
        low, high = moved
    middle = 0.5 * (low + high)
    spread = max(_spread(counts[counts <= middle]), _spread(counts[counts > middle]), noise)
    if high - low < max(LEAST_CONTRAST, CLEAR * spread):
        return None
    return low, middle, high
