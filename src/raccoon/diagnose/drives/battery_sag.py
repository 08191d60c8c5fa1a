"""The residual of a battery's reading beyond the wheels' sag, and other loads that it shows.

With the duty d and the speed w of each wheel, a battery of voltage V and resistance R_b gives

    U = V - R_b I,    I = sum over the wheels of d (d U - K w) / R

so the wheels' sag is nearly linear in d^2 and d w of each wheel, behind the filter of the battery's reading.
The back-EMF that stands for w is late behind a filter of its own, which matters where wheels reverse at full
power, so d dw/dt is a regressor as well. Discharge is linear in the charge, recovery in a slow mean of the
current. All of them are fitted together, so R_b, R and K need not be known. No load adds voltage: the
residual is 0, or negative under another load.

If loads are found, a battery that carries all of the currents (`Chain.whole`), as in a simulation that adds
them up, is fitted as well: I is then the sum of |d U - K w| / R, linear in d U and w with the current's sign.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.battery_sag_fits import (
    OUTLIER_NOISES,
    bin_costs,
    biweight_fits,
    fit_costs,
    huber_fit,
)
from raccoon.diagnose.drives.bins import bin_means, low_pass, runs_of_true
from raccoon.diagnose.drives.log import MIN_DRIVE_S, SETTLING_DRIVE_S, Load, Log
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Regressors = Callable[[Array, Array, list[Array], Array, float], Array]
"""Of time (s), duties, wheels' readings, the battery's (V) and the time constant (s) of its filter."""

BIN_S = 0.05
"""Width of a bin, s."""
BATTERY_FILTERS_S = (0.02, 0.05, 0.1, 0.15, 0.25, 0.4)
"""Time constants of the battery reading's filter that are tried, s."""
RECOVERY_S = 3.0
"""Time constant with which a battery's voltage recovers, s."""
MIN_NOISE_V = 0.004
"""Lower bound of the noise of a bin's mean, V."""
DIFFERENCE_BINS = 6
"""Lag, in bins, of the differences that one starting point is fitted to: constant loads cancel in them."""
LEVEL_PERCENTILES = (50.0, 70.0, 85.0, 95.0)
"""Percentiles of the residual that are tried as the level without another load."""
MIN_SAG_SCATTERS, MIN_SAG_V = 4.0, 0.01
"""Least sag of a load, in scatters of the residual and in V."""
END_SAG_SCATTERS, END_SAG_V = 1.5, 0.003
"""The same at which a load ends: it fades behind the reading's filter."""
MIN_SAG_STEPS = 1.5
"""Least sag of a load in quantisation steps of the reading."""
MIN_REST_BINS, MIN_BINS = 3, 8
"""Least number of bins with a load while no wheel is powered; and else in all."""
MIN_DRIVEN_SAG_SHARE = 0.15
"""Least sag, as a share of the wheels' own, of a load that is only seen while driving."""
MAX_ABOVE_SHARE = 0.02
"""Largest share of bins with a reading above the fit. A filter that holds its reading, as the stock
firmware's does, has 4 % and more."""
MAX_COST_RATIO = 1.25
"""Largest cost of a fit without readings above it, relative to the best fit's. In drives with loads such a
fit was at most 1.05 times as bad as the best. Where the reading's filter is none of those tried, it may be
one that leaves most of the drive out, 2.4 times as bad: of a sound battery without a filter 7 s of 12 were
taken for a servo's load."""
MIN_DRIVEN_LEFT = 0.25
"""Least share of the time with powered wheels that must remain outside of loads."""
QUICK_COLUMNS = 7
"""Number of columns that follow the wheels at once; charge and recovery come after them."""
MIN_STAYING_SHARE = 0.9
"""Least share of the time in which a load that stays on is seen."""
NO_LOAD_SHARE = 0.85
"""Share of back-EMF in the voltage that holds a speed, roughly: a current has the sign of the rest."""
MIN_BRAKED_SHARE, BRAKED_BINS = 0.1, 2
"""Least speed, as a share of the largest, at which a current against the motion counts as braking, and number
of bins after it that are also left out: the delayed back-EMF determines braking currents too poorly."""


@dataclass(frozen=True, slots=True)
class SagResidual:
    """The residual in bins. begin: s. rest: the reading less the fitted one, V. known: where there is a
    reading. driven: where a wheel is powered. noise, step, sag: V, of a bin's mean, the reading's
    quantisation step and the largest sag by the wheels."""

    begin: float
    rest: Array
    known: Flags
    driven: Flags
    noise: float
    step: float
    sag: float

    @classmethod
    def of(cls, log: Log) -> SagResidual | None:
        """The residual of a log; None where a reading is missing, or no fit explains the battery's."""
        found = cls.of_form(log, _regressors)
        if found is None or not any(found.loads()):
            return found
        whole = cls.of_form(log, _regressors_of_whole_currents)
        taken = whole is not None and not any(whole.loads()) and whole.is_better_than(found)
        return whole if taken else found

    @classmethod
    def of_form(cls, log: Log, regressors: Regressors) -> SagResidual | None:
        """The residual for one form of the wheels' sag."""
        battery, wheels = log.channel("battery"), [log.wheel(side) for side in ("left", "right")]
        if battery is None or None in wheels:
            return None
        time = log.time - log.time[0]
        speeds = [_interpolated(each.values) for each in wheels if each is not None]
        voltage = _bin_means(time, battery.values)
        known = np.isfinite(voltage) & (BIN_S * np.arange(len(voltage)) >= SETTLING_DRIVE_S)
        for start, end in log.lost:
            first, last = (max(int((each - log.time[0]) / BIN_S), -1) for each in (start, end))
            # in a part of a drive, losses before its begin end below 0
            known[max(first, 0) : last + 1] = False
        step = _reading_step(battery.values)
        noise = max(MIN_NOISE_V, 0.5 * step, _robust_std(np.diff(voltage[known])) / np.sqrt(2.0))
        given = np.nan_to_num(voltage)
        fits: list[tuple[float, Array]] = []
        for seconds in BATTERY_FILTERS_S:
            columns = regressors(time, log.duty, speeds, _interpolated(battery.values), seconds)
            known = known & np.isfinite(columns).all(axis=1)
            if known.sum() < 2 * DIFFERENCE_BINS:
                return None
            columns = np.nan_to_num(columns)
            starts = _starts(columns, given, known, noise)
            fits.extend(fit_costs(columns, given, known, noise, starts))
        most = MAX_COST_RATIO * min(cost for cost, _ in fits)
        able = [
            each
            for each in fits
            if each[0] <= most and (each[1][known] > OUTLIER_NOISES * noise).mean() <= MAX_ABOVE_SHARE
        ]
        if not able:
            return None
        _, rest = min(able, key=lambda each: each[0])
        driven = _bin_means(time, log.duty.any(axis=1).astype(float)) > 0.0
        return cls(float(log.time[0]), rest, known, driven, noise, step, float(np.ptp((given - rest)[known])))

    def is_better_than(self, other: SagResidual) -> bool:
        """Whether it leaves less than another form, in the bins that both know."""
        both = self.known & other.known
        mine, others = (float(bin_costs(each.rest, each.noise)[both].sum()) for each in (self, other))
        return mine < others

    def loads(self) -> Iterator[Load]:
        """The other loads that the residual shows, in the order of time."""
        scatter = _robust_std(self.rest[self.known & (np.abs(self.rest) < OUTLIER_NOISES * self.noise)])
        low = self.known & (
            self.rest < -max(MIN_SAG_V, MIN_SAG_SCATTERS * scatter, MIN_SAG_STEPS * self.step)
        )
        below = ~self.known | (self.rest < -max(END_SAG_V, END_SAG_SCATTERS * scatter))
        for start, end in runs_of_true(below):
            deep = low[start:end]
            if not deep.any():
                continue
            sag = float(np.percentile(-self.rest[start:end][deep], 80.0))
            at_rest = int((deep & ~self.driven[start:end]).sum())
            if at_rest >= MIN_REST_BINS or (deep.sum() >= MIN_BINS and sag > MIN_DRIVEN_SAG_SHARE * self.sag):
                yield Load(self.begin + BIN_S * (start - 1), self.begin + BIN_S * (end + 1), sag)

    def is_enough_without(self, found: Sequence[Load]) -> bool:
        """Whether the time outside of these loads is long enough, and driven enough, for a comparison."""
        kept = self.known & ~self.within(found)
        driven = float((kept & self.driven).sum()) >= MIN_DRIVEN_LEFT * float(
            (self.known & self.driven).sum()
        )
        return driven and BIN_S * float(kept.sum()) >= MIN_DRIVE_S

    def is_on_from(self, start: float, found: Sequence[Load]) -> bool:
        """Whether loads are on from `start` (s) to the end, but for short gaps due to a poor fit."""
        later = self.begin + BIN_S * np.arange(len(self.rest)) >= start
        return float(self.within(found)[later & self.known].mean()) > MIN_STAYING_SHARE

    def within(self, found: Sequence[Load]) -> Flags:
        """The bins in which one of these loads is on."""
        time = self.begin + BIN_S * (np.arange(len(self.rest)) + 0.5)
        inside = np.zeros(len(time), bool)
        for each in found:
            inside |= (time > each.start) & (time < each.end)
        return inside


def _interpolated(values: Array) -> Array:
    """Samples, missing ones interpolated linearly."""
    rows = np.arange(len(values))
    seen = np.isfinite(values)
    return np.asarray(np.interp(rows, rows[seen], values[seen]), float)


def _bin_means(time: Array, values: Array) -> Array:
    """The mean of each bin, NaN where it has no sample."""
    place = (time / BIN_S).astype(np.intp)
    return bin_means(place, values, int(place[-1]) + 1)


def _regressors(time: Array, duty: Array, speeds: list[Array], _: Array, seconds: float) -> Array:
    """Regressors (bins, 9), each scaled to a maximum of 1: a constant; d^2, d w and d dw/dt of each wheel
    behind a filter of `seconds`; charge; recovery."""
    drawn, quick = np.zeros(len(time)), list[Array]()
    for index, speed in enumerate(speeds):
        power = duty[:, index] * (duty[:, index] - _speed_as_duty(duty[:, index], speed))
        drawn = drawn + np.maximum(power, 0.0)
        quick.extend(duty[:, index] * each for each in (duty[:, index], speed, np.gradient(speed)))
    return _columns(time, quick, drawn, seconds)


def _regressors_of_whole_currents(
    time: Array, duty: Array, speeds: list[Array], voltage: Array, seconds: float
) -> Array:
    """The same for a battery that carries all of the currents: d U, w and dw/dt with the current's sign; NaN
    where a wheel is braked."""
    drawn, quick, braked = np.zeros(len(time)), list[Array](), np.zeros(len(time))
    for index, speed in enumerate(speeds):
        current = duty[:, index] - NO_LOAD_SHARE * _speed_as_duty(duty[:, index], speed)
        sign = np.sign(current)
        drawn = drawn + np.abs(current)
        braked += sign * speed < -MIN_BRAKED_SHARE * np.abs(speed).max()
        quick.extend(sign * each for each in (duty[:, index] * voltage, speed, np.gradient(speed)))
    columns = _columns(time, quick, drawn, seconds)
    ended = np.convolve(np.nan_to_num(_bin_means(time, braked)), np.ones(1 + BRAKED_BINS))[: len(columns)]
    columns[ended > 0.0] = np.nan
    return columns


def _columns(time: Array, quick: Sequence[Array], drawn: Array, seconds: float) -> Array:
    """In bins and scaled: a constant, the quick columns behind a filter of `seconds`, charge and recovery of
    the current that is drawn."""
    step = median_step(time)
    charge = np.cumsum(drawn * np.diff(time, append=time[-1]))
    made = (np.ones(len(time)), *(low_pass(each, step, seconds) for each in quick), charge)
    every = np.column_stack([_bin_means(time, each) for each in (*made, low_pass(drawn, step, RECOVERY_S))])
    return np.asarray(every / np.maximum(np.nanmax(np.abs(every), axis=0), 1e-9), float)


def _speed_as_duty(duty: Array, speed: Array) -> Array:
    """The speed in units of the duty that holds it: duty less that is proportional to a motor's current."""
    power = float(duty @ duty)
    factor = float(duty @ speed) / power if power > 0.0 else 0.0
    return speed / factor if factor > 0.0 else np.zeros(len(speed))


def _starts(columns: Array, voltage: Array, known: Flags, noise: float) -> Array:
    """Starting points (starts, columns) of the fits: a fit of all readings; a fit of differences over
    DIFFERENCE_BINS, with the constant at several percentiles of the residual; and these refined without
    charge and recovery, which extrapolate badly."""
    quick = columns[:, 1:QUICK_COLUMNS]
    both = known[DIFFERENCE_BINS:] & known[:-DIFFERENCE_BINS]
    found = np.zeros(columns.shape[1])
    changes = (
        quick[DIFFERENCE_BINS:] - quick[:-DIFFERENCE_BINS],
        voltage[DIFFERENCE_BINS:] - voltage[:-DIFFERENCE_BINS],
    )
    found[1:QUICK_COLUMNS] = huber_fit(*changes, both, noise)
    left = voltage - columns @ found
    levels = np.tile(found, (len(LEVEL_PERCENTILES), 1))
    levels[:, 0] = np.percentile(left[known], LEVEL_PERCENTILES)
    without = np.zeros_like(levels)
    without[:, :QUICK_COLUMNS] = biweight_fits(
        columns[:, :QUICK_COLUMNS], voltage, known, noise, levels[:, :QUICK_COLUMNS]
    )
    return np.concatenate([huber_fit(columns, voltage, known, noise)[None], levels, without])


def _reading_step(values: Array) -> float:
    """The quantisation step of a reading, V: a low percentile of the gaps between its values."""
    apart = np.diff(np.unique(values[np.isfinite(values)]))
    return float(np.percentile(apart, 10.0)) if len(apart) else 0.0


def _robust_std(values: Array) -> float:
    """Standard deviation by the median of the absolute values."""
    return 1.48 * float(np.median(np.abs(values))) if len(values) else 0.0
