"""The times at which a controller with its own clock took its samples, found from its position counters.

Rows come every 5 ms, and RaccoonOS has a new sample every 5.5 ms: one row in eleven has none. Such a row lies
between two samples, and its middle is half a cycle from both. The sample that a row shows may be up to a
cycle old, so a wheel's response appears up to 5 ms late, and a command waits up to a cycle for the next
sample. Both delays are known once the sample times are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.truncation import undo_truncation
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

MIN_COUNTED_BEMF, MIN_COUNTED_TICKS = 100.0, 1.5
"""Least back-EMF (counts), and least advance per sample where positions are whole ticks, for which the
samples of a row can be counted."""
MAX_COUNTED_CHANGE = 0.2
"""Largest relative change of the reading in such a row."""
ROW_TOLERANCE = 0.2
"""Largest relative deviation of such a row's length from the usual one."""
RATE_STEP_CYCLES = 0.05
"""Step of the rates that are tried, in cycles over the whole recording."""
PHASE_WINDOW_S = 0.4
"""s, standard deviation of the window in which the clock's phase is estimated, as the clock may drift."""
MIN_UNUSUAL_ROWS, MIN_ROWS_NEAR = 30, 3.0
"""Least number of rows with an unusual number of samples: in all, and (weighted by the window) near a knot of
the phase."""
MAX_MEAN_DEVIATION = 0.15
"""Largest difference between the mean count of samples a row and that of a rate. Rows of 10 ms have the same
phases at 235 and at 265 samples per second, but other counts."""
MIN_BEATS = 2.0
"""Least number of times in the recording that the phase of a rate returns with respect to the rows. At a
whole number of samples a row all rows have one phase, whatever the clock is."""
MAX_SAMPLE_GAP_CYCLES = 2.5
"""Cycles between two samples beyond which nothing is interpolated between them."""
CLOSE = 1e-6
"""Share of a row below which rounding made it."""
MIN_SHARP = 0.8
"""Least concentration of the unusual rows' phases, relative to that of a perfect clock."""


@dataclass(frozen=True, slots=True)
class SampleClock:
    """Samples that are ready at phase(t) + k period, for whole k.

    period: s. knots, phases (s): times at which the phase is known, and the phase there; it is linear between
    them. waits: how many times a period waiting commands come into force. lead: s from the taking of a
    sample, after which a command comes into force, until the sample is ready.
    """

    period: float
    knots: Array
    phases: Array
    waits: int = 1
    lead: float = 0.0

    def latest_samples(self, time: Array) -> tuple[NDArray[np.intp], Array]:
        """Number of the latest sample that is ready at each time, and when it was ready, s."""
        phase = self._phase(time)
        number = np.floor((time - phase) / self.period)
        return number.astype(np.intp), phase + number * self.period

    def shifted(self, by: float) -> SampleClock:
        """The clock on a time axis whose zero is `by` s earlier."""
        return replace(self, knots=self.knots + by, phases=self.phases + by)

    def times_in_force(self, time: Array) -> Array:
        """When commands given at each time come into force, s."""
        cycle = self.period / self.waits
        first = self._phase(time) - self.lead
        moments = first + cycle * np.ceil((time - first) / cycle)
        return np.asarray(np.maximum.accumulate(moments), float)

    def in_force(self, time: Array, duty: Array, closed: Array) -> tuple[Array, Array]:
        """duty and closed (rows,) as they are in force from row to row.

        A command that comes into force within a row has the rest of it, so a row has the mean of its
        commands: duty while the motor is connected, and the part of the time in which it is.
        """
        moments = self.times_in_force(time)
        edges = np.append(moments, moments[-1] + (time[-1] - time[-2]))
        spans = np.append(time, time[-1] + (time[-1] - time[-2]))
        powered = _means_between(edges, duty * closed, spans)
        connected = np.clip(_means_between(edges, closed, spans), 0.0, 1.0)
        connected = np.where(connected < CLOSE, 0.0, np.where(connected > 1.0 - CLOSE, 1.0, connected))
        mean = np.divide(powered, connected, out=np.zeros_like(powered), where=connected > 0.0)
        return np.clip(mean, -1.0, 1.0), connected

    def _phase(self, time: Array) -> Array:
        return np.interp(time, self.knots, self.phases)


@dataclass(frozen=True, slots=True)
class SampleCounts:
    """The number of samples in each row (rows,), and whether it is known."""

    samples: Array
    known: NDArray[np.bool_]


def count_arrivals(time: Array, values: Array) -> SampleCounts:
    """Counts for a channel that has a value (rows,) only in rows with a new sample, and NaN elsewhere."""
    return SampleCounts(np.isfinite(values).astype(float), _is_even(time))


def count_by_ticks(time: Array, bemf: Array, position: Array, tick: float) -> SampleCounts:
    """Counts for a motor whose position counter is the sum of its back-EMF samples.

    time: s, of rows. bemf: counts. position: ticks. tick: counts of one sample that move the position by one.
    """
    now = np.nan_to_num(np.abs(bemf))
    before = np.concatenate([now[:1], now[:-1]])
    gone = tick * np.abs(_ticks_moved(position))
    whole = not np.any(np.nan_to_num(position) % 1.0)
    least = max(MIN_COUNTED_BEMF, MIN_COUNTED_TICKS * tick) if whole else MIN_COUNTED_BEMF
    known = (np.minimum(now, before) > least) & (np.abs(now - before) < MAX_COUNTED_CHANGE * now)
    known &= np.isfinite(gone) & _is_even(time)
    return SampleCounts(np.rint(np.divide(gone, now, out=np.ones_like(now), where=known)), known)


def _ticks_moved(position: Array) -> Array:
    return np.asarray(np.diff(position, prepend=position[:1]), float)


def _is_even(time: Array) -> NDArray[np.bool_]:
    steps = np.diff(time, prepend=time[0])
    usual = float(np.median(steps[1:]))
    return np.asarray(np.abs(steps - usual) < ROW_TOLERANCE * usual)


def find_sample_clock(
    time: Array, rows: SampleCounts, rates: tuple[float, float], waits: int = 1, lead: float = 0.0
) -> SampleClock | None:
    """The clock by which the samples were taken; None where the rows show none.

    rates: lowest and highest samples per second. waits, lead: see `SampleClock`.
    """
    row = median_step(time)
    per_row = row * 0.5 * (rates[0] + rates[1])
    usual = round(per_row)
    rare = usual + 1 if per_row > usual else usual - 1
    unusual = np.flatnonzero(rows.known & (rows.samples == rare))
    if len(unusual) < MIN_UNUSUAL_ROWS:
        return None
    middles = 0.5 * (time[unusual] + time[unusual - 1])
    found = _best_rate(middles, time, float(rows.samples[rows.known].mean()), rates)
    if found is None:
        return None
    turns = _phasors(middles, found)
    knots = np.arange(time[0], time[-1] + PHASE_WINDOW_S, 0.5 * PHASE_WINDOW_S)
    weights = np.exp(-0.5 * ((knots[:, None] - middles) / PHASE_WINDOW_S) ** 2)
    known = weights.sum(axis=1) >= MIN_ROWS_NEAR
    if not known.any():
        return None
    angles = np.unwrap(np.angle(weights[known] @ turns))
    near = np.exp(1j * np.interp(middles, knots[known], angles))
    if (turns / near).real.mean() < MIN_SHARP * np.sinc(abs(row * found - usual)):
        return None
    phases = angles / (2.0 * np.pi * found) + (0.0 if rare % 2 else 0.5 / found)
    return SampleClock(1.0 / found, knots[known], phases, waits, lead)


def _best_rate(moments: Array, time: Array, mean: float, rates: tuple[float, float]) -> float | None:
    """The rate (1/s) within these bounds at which the phases of the moments are most concentrated, of those
    that give about this mean number of samples a row and whose phase moves with respect to the rows."""
    span, row = float(np.ptp(time)), median_step(time)
    low, high = ((mean + sign * MAX_MEAN_DEVIATION) / row for sign in (-1.0, 1.0))
    step = RATE_STEP_CYCLES / span
    tried = np.arange(max(rates[0], low), min(rates[1], high), step)
    possible = np.abs(row * tried - np.rint(row * tried)) * span > MIN_BEATS * row
    if not possible.any():
        return None
    turns, further = _phasors(moments, tried[0]), _phasors(moments, step)
    agreed = np.empty(len(tried))
    for index in range(len(tried)):
        agreed[index] = abs(turns.sum())
        turns *= further  # a product costs a tenth of an exponential
    return float(tried[int(np.argmax(np.where(possible, agreed, 0.0)))])


def _phasors(moments: Array, rate: float) -> NDArray[np.complex128]:
    return np.asarray(np.exp(2j * np.pi * rate * moments), np.complex128)


def resample_to_one_age(clock: SampleClock, time: Array, values: Array) -> Array:
    """A channel (rows,) resampled as if each row's sample had been taken half a cycle before; NaN stays
    NaN."""
    moments, rows = _first_rows(clock, time, values)
    even, silent = _interpolate_samples(clock, time, values, moments, values[rows])
    return np.where(silent, values, even)


def resample_wheel_to_one_age(
    clock: SampleClock,
    time: Array,
    bemf: Array,
    position: Array,
    tick: float,
    sums: bool = False,
    zone: float = 0.0,
) -> Array:
    """`resample_to_one_age` for back-EMF.

    position, tick: see `count_by_ticks`. sums: whether a row with several samples shows their mean. zone:
    counts of the reading's dead zone. Readings next to a 0, or that would fall into the zone, stay as they
    are. Half a count is added to truncated readings.
    """
    bemf = undo_truncation(bemf)
    moments, rows = _first_rows(clock, time, bemf)
    values = bemf[rows]
    if sums:
        each = count_by_ticks(time, bemf, position, tick)
        samples = np.where(each.known, each.samples, 1.0)[rows]
        values = np.where(
            samples > 1.0, tick * _ticks_moved(position)[rows] / np.maximum(samples, 1.0), values
        )
        moments = moments - 0.5 * np.maximum(samples - 1.0, 0.0) * clock.period
    even, silent = _interpolate_samples(clock, time, bemf, moments, values)
    return np.where(silent | (np.abs(even) <= zone), bemf, even)


def _first_rows(clock: SampleClock, time: Array, values: Array) -> tuple[Array, NDArray[np.intp]]:
    """When each sample was ready, s, and the first row that shows it."""
    number, ready = clock.latest_samples(time)
    _, rows = np.unique(number, return_index=True)
    rows = rows[np.isfinite(values[rows])]
    return ready[rows], rows


def _interpolate_samples(
    clock: SampleClock, time: Array, channel: Array, moments: Array, values: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Samples interpolated linearly at half a cycle before each row of the channel, and whether a
    neighbouring sample is 0 or too far away."""
    if len(moments) < 2:
        return channel, np.zeros(len(channel), bool)
    at = time + clock.lead - 0.5 * clock.period
    after = np.clip(np.searchsorted(moments, at), 1, len(moments) - 1)
    silent = (values[after] == 0.0) | (values[after - 1] == 0.0)
    silent |= moments[after] - moments[after - 1] > MAX_SAMPLE_GAP_CYCLES * clock.period
    even = np.where(np.isfinite(channel), np.interp(at, moments, values), np.nan)
    return np.asarray(even, float), np.asarray(silent)


def _means_between(edges: Array, values: Array, spans: Array) -> Array:
    """Means between neighbouring spans (n + 1,) of the step function that is values[i] from edges[i] to
    edges[i + 1], constant before the first and after the last edge."""
    total = np.concatenate([[0.0], np.cumsum(values * np.diff(edges))])
    reached = np.interp(spans, edges, total)
    reached += np.minimum(spans - edges[0], 0.0) * values[0] + np.maximum(spans - edges[-1], 0.0) * values[-1]
    return np.asarray(np.diff(reached) / np.diff(spans), float)
