"""What the causes of an axis are worth on data that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis.causes import axis_causes, constant_force, dry_asymmetry
from raccoon.diagnose.recordings.axis.fit import AxisData, AxisFit, Keep, Rows, cut, fit_axis
from raccoon.diagnose.recordings.axis.log import AxisLog
from raccoon.diagnose.recordings.axis.search import AxisSearch, Tried, search_axis
from raccoon.diagnose.recordings.axis.start import Rough, rough_axis

Array = NDArray[np.float64]

LEAST_GAIN = 0.03
"""Share of the error on unseen data that a cause must save to be named."""
LEAST_SIZE = 0.1
"""Share of its usual size (its width) below which a cause is nothing that a team could act on."""
MUCH = 0.3
"""Share of the error on unseen data from which a cause is named however small it is."""
OVERLAP = 2
"""Stretches that are fitted over any instant."""
TINY = 1e-12
"""In the place of an error, or a friction, of 0 that is divided by."""
SHORTEST = 4.0
"""Time constants that a recording must last."""


@dataclass(frozen=True, slots=True)
class JudgedAxis:
    """An axis with its causes, best first.

    data: what was fitted. unseen: what it was judged on. before, after: error of (motion, current) on unseen
    data without causes and with them. floor: what every candidate together leaves of the data it was fitted
    to; nothing known does better. without: error on unseen data over the floor, both channels together,
    without each cause. useless: causes with evidence that do not help unseen data. final: the fit that gives
    the numbers, on everything there is of the recording.
    """

    rough: Rough
    data: AxisData
    unseen: AxisData
    search: AxisSearch
    causes: tuple[Tried, ...]
    useless: tuple[Tried, ...]
    before: Array
    after: Array
    floor: Array
    without: tuple[float, ...]
    fit: AxisFit
    final: AxisFit

    @property
    def log(self) -> AxisLog:
        """The recording."""
        return self.data.log


def judge_axis(log: AxisLog, holdout: AxisLog | None) -> JudgedAxis:
    """Search the causes of an axis and judge them on `holdout`, or on the part after `log.split`.

    Raises TraceError where the recording is too short for both.
    """
    rough = rough_axis(log)
    if holdout is not None:
        data, unseen = _data(log, rough, _all, OVERLAP), _data(holdout, rough, _all, 1)
    else:
        data = _data(log, rough, lambda rows: rows < log.split, OVERLAP)
        unseen = _data(log, rough, lambda rows: rows >= log.split, 1)
    causes = axis_causes(log, rough)
    search = search_axis(data, rough.numbers, causes)
    # All candidates at once may get lost where the named ones did not.
    floor = np.maximum(np.fmin(errors(data, search.saturated), errors(data, search.fit)), TINY)
    fits = _Fits(data, search)
    kept, useless = _helpful(fits, unseen, floor)
    fit = fits.of(kept)
    before, after = errors(unseen, search.base), errors(unseen, fit)
    without = [
        overall(errors(unseen, fits.of([other for other in kept if other is not each])), floor)
        for each in kept
    ]
    order = np.argsort([-each for each in without], kind="stable")
    return JudgedAxis(
        rough,
        data,
        unseen,
        search,
        tuple(kept[index] for index in order),
        tuple(useless),
        before,
        after,
        floor,
        tuple(without[index] for index in order),
        fit,
        fit if holdout is not None else _on_everything(log, rough, data, fit),
    )


def _all(rows: Rows) -> NDArray[np.bool_]:
    return np.ones(np.shape(rows), np.bool_)


def _data(log: AxisLog, rough: Rough, keep: Keep, overlap: int) -> AxisData:
    parts = cut(log, rough.constant, keep, overlap)
    if parts is None or not parts.weight.any() or len(log.time) * log.step < SHORTEST * rough.constant:
        raise TraceError(
            f"{len(log.time) * log.step:.3g} s are too short for an axis with a time constant of "
            f"{rough.constant:.2g} s: record at least {10 * rough.constant:.2g} s"
        )
    return AxisData(log, parts)


def _on_everything(log: AxisLog, rough: Rough, data: AxisData, fit: AxisFit) -> AxisFit:
    whole = _data(log, rough, _all, OVERLAP)
    whole.scales = data.scales
    return fit_axis(whole, fit.numbers, fit.u)


@dataclass(slots=True)
class _Fits:
    """The base model with any set of causes, each set fitted once, from where the search had ended."""

    data: AxisData
    search: AxisSearch
    known: dict[frozenset[str], AxisFit] = field(default_factory=dict)

    def of(self, causes: Sequence[Tried]) -> AxisFit:
        """The fit with exactly these."""
        key = frozenset(each.cause.id for each in causes)
        if key not in self.known:
            found = dict(zip((n.name for n in self.search.fit.numbers), self.search.fit.u, strict=True))
            numbers = [*self.search.base.numbers, *(n for each in causes for n in each.cause.numbers)]
            start = np.array([found[each.name] for each in numbers])
            self.known[key] = fit_axis(self.data, numbers, start)
        return self.known[key]


def error_with(judged: JudgedAxis, rival: Tried, instead_of: Tried) -> float:
    """Error on unseen data over the floor with another cause in place of a named one."""
    kept = [each for each in judged.causes if each is not instead_of]
    numbers = [
        *judged.search.base.numbers,
        *(number for each in (*kept, rival) for number in each.cause.numbers),
    ]
    starts = dict(zip((each.name for each in judged.fit.numbers), judged.fit.u, strict=True))
    starts |= dict(zip((each.name for each in rival.fit.numbers), rival.fit.u, strict=True))
    fit = fit_axis(judged.data, numbers, np.array([starts[each.name] for each in numbers]))
    return overall(errors(judged.unseen, fit), judged.floor)


def error_with_twin(judged: JudgedAxis) -> float:
    """The same with a constant force in place of dry friction that differs by direction, or the other way
    round, from where both are one; infinite where they cannot be exchanged."""
    found = judged.fit.values
    coulomb = found.get("coulomb", 0.0)
    old, new, value = (
        ("offset", dry_asymmetry(), found.get("offset", 0.0) / max(coulomb, TINY))
        if "offset" in found
        else ("asymmetry", constant_force(judged.rough), found.get("asymmetry", 0.0) * coulomb)
    )
    base = {each.name for each in judged.search.base.numbers}
    if (
        coulomb <= 0.0
        or old not in found
        or old in base
        or new.name in found
        or not new.low < value < new.high
    ):
        return math.inf
    numbers = [new if each.name == old else each for each in judged.fit.numbers]
    start = np.where([each is new for each in numbers], value / new.width, judged.fit.u)
    return overall(errors(judged.unseen, fit_axis(judged.data, numbers, start)), judged.floor)


def _helpful(fits: _Fits, unseen: AxisData, floor: Array) -> tuple[list[Tried], list[Tried]]:
    """Accepted causes that lower the error on unseen data, and those that do not."""
    kept, useless = list(fits.search.accepted), []
    while kept:
        whole = overall(errors(unseen, fits.of(kept)), floor)
        others = [[other for other in kept if other is not each] for each in kept]
        gains = [1.0 - whole / overall(errors(unseen, fits.of(each)), floor) for each in others]
        gains = [
            0.0 if gain < MUCH and _tiny(each, fits.search) else gain
            for each, gain in zip(kept, gains, strict=True)
        ]
        worst = int(np.argmin(gains))
        if gains[worst] >= LEAST_GAIN:
            break
        useless.append(kept.pop(worst))
    return kept, useless


def _tiny(tried: Tried, search: AxisSearch) -> bool:
    found = dict(zip((each.name for each in search.fit.numbers), search.fit.u, strict=True))
    return all(abs(found[each.name]) < LEAST_SIZE for each in tried.cause.numbers)


def overall(error: Array, floor: Array) -> float:
    """Both channels' errors in units of their floors, as one root mean square."""
    return _rms(error / floor)


def errors(data: AxisData, fit: AxisFit) -> Array:
    """Root mean square error of motion and current under a fit; NaN for a current that is not there."""
    motion, current = model_errors(data, fit)
    return np.array([_rms(motion), np.nan if current is None else _rms(current)])


def _rms(values: Array) -> float:
    known = np.isfinite(values)
    return float(np.sqrt(np.mean(values[known] ** 2))) if known.any() else float("nan")


def model_errors(data: AxisData, fit: AxisFit) -> tuple[Array, Array | None]:
    """Simulated minus measured, (rows, stretches) each, NaN where nothing counts."""
    scales, data.scales = data.scales, np.ones(2)
    try:
        flat = data.residuals(fit.numbers, fit.u[None])[0]
    finally:
        data.scales = scales
    shape = data.parts.measured.shape
    ignored = (data.parts.weight == 0.0) | ~np.isfinite(data.parts.measured)
    motion = np.where(ignored, np.nan, flat[: ignored.size].reshape(shape))
    if data.parts.current is None:
        return motion, None
    ignored = (data.parts.weight == 0.0) | ~np.isfinite(data.parts.current)
    return motion, np.where(ignored, np.nan, flat[ignored.size :].reshape(shape))
