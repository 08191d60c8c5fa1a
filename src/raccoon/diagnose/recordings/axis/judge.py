"""Judges the causes of an axis on held-out data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis.causes import axis_causes, constant_force, dry_friction_asymmetry
from raccoon.diagnose.recordings.axis.fit import AxisData, AxisFit, RowFilter, Rows, cut_stretches, fit_axis
from raccoon.diagnose.recordings.axis.log import AxisLog
from raccoon.diagnose.recordings.axis.rough_estimate import RoughAxis, estimate_rough_axis
from raccoon.diagnose.recordings.axis.search import AxisSearch, TriedCause, search_axis

Array = NDArray[np.float64]

MIN_GAIN = 0.03
"""Least relative reduction of the held-out error by a named cause."""
MIN_SIZE = 0.1
"""Least size of a cause over its usual size (its width): a smaller one is of no use to a team."""
LARGE_GAIN = 0.3
"""Relative reduction of the held-out error above which a cause is named however small it is."""
OVERLAP = 2
"""Number of fitted stretches that cover each instant."""
TINY = 1e-12
"""Replaces an error or friction of 0 in a denominator."""
MIN_TIME_CONSTANTS = 4.0
"""Least length of a recording, in time constants."""


@dataclass(frozen=True, slots=True)
class JudgedAxis:
    """A judged axis with its causes, best first.

    data: fitted part. heldout_data: part on which it was judged. before, after: held-out errors of (motion,
    current) without causes and with them. floor: errors of a fit of all candidates to the fitted part, which
    nothing known improves. errors_without: held-out error over the floor, both channels combined, without
    each cause. unhelpful: causes with evidence that do not improve held-out data. final_fit: to the whole
    recording, for the reported values.
    """

    rough: RoughAxis
    data: AxisData
    heldout_data: AxisData
    search: AxisSearch
    causes: tuple[TriedCause, ...]
    unhelpful: tuple[TriedCause, ...]
    before: Array
    after: Array
    floor: Array
    errors_without: tuple[float, ...]
    fit: AxisFit
    final_fit: AxisFit

    @property
    def log(self) -> AxisLog:
        """The recording."""
        return self.data.log


def judge_axis(log: AxisLog, holdout: AxisLog | None) -> JudgedAxis:
    """Search the causes of an axis and judge them on `holdout`, or by default on the rows from
    `log.holdout_row`.

    Raises TraceError if the recording is too short for both.
    """
    rough = estimate_rough_axis(log)
    if holdout is not None:
        data, heldout_data = (
            _make_data(log, rough, _all_rows, OVERLAP),
            _make_data(holdout, rough, _all_rows, 1),
        )
    else:
        data = _make_data(log, rough, lambda rows: rows < log.holdout_row, OVERLAP)
        heldout_data = _make_data(log, rough, lambda rows: rows >= log.holdout_row, 1)
    causes = axis_causes(log, rough)
    search = search_axis(data, rough.parameters, causes)
    # The saturated fit may not have converged although that of the selected causes did.
    floor = np.maximum(
        np.fmin(channel_errors(data, search.saturated), channel_errors(data, search.fit)), TINY
    )
    fits = _FitCache(data, search)
    kept, unhelpful = _split_by_gain(fits, heldout_data, floor)
    fit = fits.fit_with(kept)
    before, after = channel_errors(heldout_data, search.base), channel_errors(heldout_data, fit)
    errors_without = [
        combined_error(
            channel_errors(heldout_data, fits.fit_with([other for other in kept if other is not each])), floor
        )
        for each in kept
    ]
    order = np.argsort([-each for each in errors_without], kind="stable")
    return JudgedAxis(
        rough,
        data,
        heldout_data,
        search,
        tuple(kept[index] for index in order),
        tuple(unhelpful),
        before,
        after,
        floor,
        tuple(errors_without[index] for index in order),
        fit,
        fit if holdout is not None else _refit_on_everything(log, rough, data, fit),
    )


def _all_rows(rows: Rows) -> NDArray[np.bool_]:
    return np.ones(np.shape(rows), np.bool_)


def _make_data(log: AxisLog, rough: RoughAxis, keep: RowFilter, overlap: int) -> AxisData:
    parts = cut_stretches(log, rough.time_constant, keep, overlap)
    if (
        parts is None
        or not parts.weight.any()
        or len(log.time) * log.step < MIN_TIME_CONSTANTS * rough.time_constant
    ):
        raise TraceError(
            f"{len(log.time) * log.step:.3g} s are too short for an axis with a time constant of "
            f"{rough.time_constant:.2g} s: record at least {10 * rough.time_constant:.2g} s"
        )
    return AxisData(log, parts)


def _refit_on_everything(log: AxisLog, rough: RoughAxis, data: AxisData, fit: AxisFit) -> AxisFit:
    everything = _make_data(log, rough, _all_rows, OVERLAP)
    everything.scales = data.scales
    return fit_axis(everything, fit.parameters, fit.u)


@dataclass(slots=True)
class _FitCache:
    """Cache of fits of the base model with sets of causes, each started from the end of the search."""

    data: AxisData
    search: AxisSearch
    by_causes: dict[frozenset[str], AxisFit] = field(default_factory=dict)

    def fit_with(self, causes: Sequence[TriedCause]) -> AxisFit:
        """The fit with exactly these causes."""
        key = frozenset(each.cause.id for each in causes)
        if key not in self.by_causes:
            found = dict(zip((n.name for n in self.search.fit.parameters), self.search.fit.u, strict=True))
            numbers = [*self.search.base.parameters, *(n for each in causes for n in each.cause.parameters)]
            start = np.array([found[each.name] for each in numbers])
            self.by_causes[key] = fit_axis(self.data, numbers, start)
        return self.by_causes[key]


def error_with_rival(judged: JudgedAxis, rival: TriedCause, replaced: TriedCause) -> float:
    """Held-out error over the floor with a rival in place of a named cause."""
    kept = [each for each in judged.causes if each is not replaced]
    parameters = [
        *judged.search.base.parameters,
        *(number for each in (*kept, rival) for number in each.cause.parameters),
    ]
    starts = dict(zip((each.name for each in judged.fit.parameters), judged.fit.u, strict=True))
    starts |= dict(zip((each.name for each in rival.fit.parameters), rival.fit.u, strict=True))
    fit = fit_axis(judged.data, parameters, np.array([starts[each.name] for each in parameters]))
    return combined_error(channel_errors(judged.heldout_data, fit), judged.floor)


def error_with_equivalent(judged: JudgedAxis) -> float:
    """Held-out error over the floor with a constant force in place of direction-dependent dry friction, or
    vice versa, started from the equivalent value; infinite if they are not interchangeable."""
    found = judged.fit.values
    coulomb = found.get("coulomb", 0.0)
    old_name, new_parameter, value = (
        ("offset", dry_friction_asymmetry(), found.get("offset", 0.0) / max(coulomb, TINY))
        if "offset" in found
        else ("asymmetry", constant_force(judged.rough), found.get("asymmetry", 0.0) * coulomb)
    )
    base = {each.name for each in judged.search.base.parameters}
    if (
        coulomb <= 0.0
        or old_name not in found
        or old_name in base
        or new_parameter.name in found
        or not new_parameter.low < value < new_parameter.high
    ):
        return math.inf
    parameters = [new_parameter if each.name == old_name else each for each in judged.fit.parameters]
    start = np.where(
        [each is new_parameter for each in parameters], value / new_parameter.width, judged.fit.u
    )
    return combined_error(
        channel_errors(judged.heldout_data, fit_axis(judged.data, parameters, start)), judged.floor
    )


def _split_by_gain(
    fits: _FitCache, heldout: AxisData, floor: Array
) -> tuple[list[TriedCause], list[TriedCause]]:
    """Accepted causes that lower the held-out error, and those that do not (backward elimination)."""
    kept, unhelpful = list(fits.search.accepted), []
    while kept:
        error = combined_error(channel_errors(heldout, fits.fit_with(kept)), floor)
        others = [[other for other in kept if other is not each] for each in kept]
        gains = [
            1.0 - error / combined_error(channel_errors(heldout, fits.fit_with(each)), floor)
            for each in others
        ]
        gains = [
            0.0 if gain < LARGE_GAIN and _is_tiny(each, fits.search) else gain
            for each, gain in zip(kept, gains, strict=True)
        ]
        worst = int(np.argmin(gains))
        if gains[worst] >= MIN_GAIN:
            break
        unhelpful.append(kept.pop(worst))
    return kept, unhelpful


def _is_tiny(tried: TriedCause, search: AxisSearch) -> bool:
    found = dict(zip((each.name for each in search.fit.parameters), search.fit.u, strict=True))
    return all(abs(found[each.name]) < MIN_SIZE for each in tried.cause.parameters)


def combined_error(error: Array, floor: Array) -> float:
    """Root mean square of both channels' errors in units of their floors."""
    return _rms(error / floor)


def channel_errors(data: AxisData, fit: AxisFit) -> Array:
    """Root mean square error of motion and current under a fit; NaN for a missing current."""
    motion, current = model_errors(data, fit)
    return np.array([_rms(motion), np.nan if current is None else _rms(current)])


def _rms(values: Array) -> float:
    known = np.isfinite(values)
    return float(np.sqrt(np.mean(values[known] ** 2))) if known.any() else float("nan")


def model_errors(data: AxisData, fit: AxisFit) -> tuple[Array, Array | None]:
    """Simulated minus measured motion and current, (rows, stretches) each, NaN in rows without weight or
    reading."""
    scales, data.scales = data.scales, np.ones(2)
    try:
        flat = data.residuals(fit.parameters, fit.u[None])[0]
    finally:
        data.scales = scales
    shape = data.stretches.measured.shape
    ignored = (data.stretches.weight == 0.0) | ~np.isfinite(data.stretches.measured)
    motion = np.where(ignored, np.nan, flat[: ignored.size].reshape(shape))
    if data.stretches.current is None:
        return motion, None
    ignored = (data.stretches.weight == 0.0) | ~np.isfinite(data.stretches.current)
    return motion, np.where(ignored, np.nan, flat[ignored.size :].reshape(shape))
