"""Reflectance recordings: is it light from outside, the sensor's gain, its height, or noise?

The simulated reading is factor * counts(height) + offset. White and black are two levels, so one of the three
can be told from the others, and two together only by what usual deviations are; where that does not decide,
all that fit are listed. Light from outside may change with time, the others do not.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.tophat_levels import Levels, levels_of
from raccoon.diagnose.recordings.tophat_words import (
    AMBIENT,
    GAIN,
    HEIGHT,
    NOISE,
    USUAL_NOISE,
    noise_cause,
    tophat_cause,
)
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Curve,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    Unexplained,
    Verdict,
)
from raccoon.model.reflectance import FULL_SCALE, LEAST_HEIGHT, MOST_HEIGHT, counts
from raccoon.sim.effects import effect
from raccoon.sim.parameters import Parameters
from raccoon.sim.tophats import GENERATION

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

WIDTHS = {AMBIENT: 200.0, GAIN: 0.2, HEIGHT: 0.006}
"""Twice the catalogue's width of a usual deviation."""
SAME_UNIT = 4.0
"""Counts by which two sound sensors of one make differ on the same floor at the least."""
FITS = 9.0
PAIR_PENALTY = 6.0
TIE = 3.0
FITTED = 0.7
ROUNDS = 40


@dataclass(frozen=True, slots=True)
class _Fit:
    """Causes with their values. cost: misfit of the levels plus that of usual deviations."""

    ids: tuple[str, ...]
    values: Array
    stds: Array
    misfit: float
    cost: float


def tophat_ports(columns: Columns, robot: RobotConfig) -> list[int]:
    """Analog ports of the robot's tophats that were recorded; all recorded ones where it names none."""
    recorded = [int(name.split(".")[1]) for name in columns if name.startswith("analog.")]
    named = [each.analog for each in robot.tophats.values() if each.analog in recorded]
    return named or sorted(recorded)


def diagnose_tophats(
    columns: Columns, robot: RobotConfig, model: Parameters | None = None, truth_free: bool = False
) -> Diagnosis:
    """Compare recorded tophats with the simulated ones. truth_free: do not use `truth.surface.N`."""
    begin = clock.perf_counter()
    parts = [
        _sensor(columns, port, _nominal(model, port), truth_free) for port in tophat_ports(columns, robot)
    ]
    causes = [cause for each in parts for cause in each.causes]
    causes.sort(key=lambda each: each.gain.heldout_rmse_after - each.gain.heldout_rmse_before)
    channels = tuple(each.channel for each in parts if each.channel is not None)
    return Diagnosis(
        _verdict(bool(channels), bool(causes), any(each.unknown for each in parts)),
        channels,
        tuple(
            CauseResult(
                each.id, each.where, rank + 1, each.parameters, each.gain, each.probability,
                each.confounded_with, each.explanation,
            )
            for rank, each in enumerate(causes)
        ),
        tuple(rejected for each in parts for rejected in each.rejected),
        Unexplained(
            float(np.mean([each.rest for each in parts])) if parts else 1.0,
            tuple(dict.fromkeys(name for each in parts for name in each.unknown)),
        ),
        tuple(dict.fromkeys(text for each in parts for text in each.advice)),
        clock.perf_counter() - begin,
        None,
        tuple(note for each in parts for note in each.notes),
        {name: value for each in parts for name, value in each.identified.items()},
        (),
        tuple(curve for each in parts for curve in each.curves),
    )  # fmt: skip


def _verdict(seen: bool, causes: bool, unknown: bool) -> Verdict:
    if not seen:
        return Verdict.NOT_IDENTIFIABLE
    if causes:
        return Verdict.PARTLY if unknown else Verdict.EXPLAINED
    return Verdict.UNKNOWN if unknown else Verdict.ADEQUATE


@dataclass(frozen=True, slots=True)
class _Nominal:
    """What the simulation assumes of one sensor."""

    offset: float = 0.0
    factor: float = 1.0
    height: float = 0.007
    sd: float = 0.0

    def level(self, black: bool | float, offset: float, factor: float, height: float) -> float:
        """Counts over a surface with changes of the three on top."""
        at = float(np.clip(self.height + height, LEAST_HEIGHT, MOST_HEIGHT))
        read = self.factor * factor * counts(float(black), GENERATION, at) + self.offset + offset
        return float(np.clip(read, 0.0, FULL_SCALE))


def _nominal(model: Parameters | None, port: int) -> _Nominal:
    names = {AMBIENT: "offset", GAIN: "factor", HEIGHT: "height", NOISE: "sd"}
    if model is None:
        return _Nominal(height=float(effect(HEIGHT).parameters[0].neutral or 0.007))
    return _Nominal(*(model.value(id_, name, str(port)) for id_, name in names.items()))


@dataclass(frozen=True, slots=True)
class _Sensor:
    """What was found at one port."""

    channel: ChannelResult | None
    causes: tuple[CauseResult, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    unknown: tuple[str, ...] = ()
    rest: float = 1.0
    advice: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    identified: Mapping[str, ParameterResult] = None  # type: ignore[assignment]
    curves: tuple[Curve, ...] = ()


def _sensor(columns: Columns, port: int, nominal: _Nominal, truth_free: bool) -> _Sensor:
    surface = None if truth_free else columns.get(f"truth.surface.{port}")
    levels = levels_of(columns["t"], columns[f"analog.{port}"], surface)
    if isinstance(levels, str):
        reason = f"not identifiable: analog.{port}: {levels}"
        return _Sensor(
            None,
            rejected=tuple(Rejected(f"{id_}@{port}", reason) for id_ in (*WIDTHS, NOISE)),
            advice=("drive slowly over a black line on white, several times",),
            notes=(reason,),
            identified={},
        )
    return _judged(levels, port, nominal)


def _judged(levels: Levels, port: int, nominal: _Nominal) -> _Sensor:
    early = levels.time < levels.time[0] + FITTED * float(np.ptp(levels.time))
    if not all((early & (levels.black == side)).sum() >= 8 for side in (False, True)):
        early = np.ones(len(early), np.bool_)
    table = levels.means(early)
    fits = _fits(table, nominal)
    best = min(fits, key=lambda each: each.cost)
    late = ~early if (~early).sum() >= 20 else np.ones(len(early), np.bool_)
    return _result(levels, port, nominal, fits, best, late)


def _fits(table: Array, nominal: _Nominal) -> list[_Fit]:
    """No cause, each alone, each pair; a second one must earn its place."""
    names = tuple(WIDTHS)
    choices: list[tuple[str, ...]] = [(), *((each,) for each in names), *combinations(names, 2)]
    return [_fit(table, nominal, each) for each in choices]


def _fit(table: Array, nominal: _Nominal, ids: tuple[str, ...]) -> _Fit:
    """Gauss-Newton on the levels with usual deviations as priors."""
    widths = np.array([WIDTHS[each] for each in ids])
    weight = 1.0 / np.hypot(table[:, 3], SAME_UNIT)

    def residual(u: Array) -> Array:
        return (_predicted(table[:, 1], nominal, ids, widths * u) - table[:, 2]) * weight

    u = np.zeros(len(ids))
    for _ in range(ROUNDS if len(ids) else 0):
        r = residual(u)
        J = np.column_stack([(residual(u + 1e-4 * row) - r) / 1e-4 for row in np.eye(len(ids))])
        A = J.T @ J + np.eye(len(ids))
        step = np.linalg.solve(A, J.T @ r + u)
        u = u - np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-6:
            break
    r = residual(u)
    if len(ids):
        J = np.column_stack([(residual(u + 1e-4 * row) - r) / 1e-4 for row in np.eye(len(ids))])
        stds = widths * np.sqrt(np.diag(np.linalg.inv(J.T @ J + np.eye(len(ids)))))
    else:
        stds = np.zeros(0)
    misfit = float(r @ r) / max(len(table) / 2.0, 1.0)
    cost = misfit * max(len(table) / 4.0, 1.0) + float(u @ u) + PAIR_PENALTY * len(ids)
    return _Fit(ids, widths * u, stds, misfit, cost)


def _predicted(black: Array, nominal: _Nominal, ids: Sequence[str], values: Array) -> Array:
    found = dict(zip(ids, values, strict=True))
    offset, height = float(found.get(AMBIENT, 0.0)), float(found.get(HEIGHT, 0.0))
    factor = max(1.0 + float(found.get(GAIN, 0.0)), 0.01)
    pair = [nominal.level(side, offset, factor, height) for side in (0.0, 1.0)]
    return np.where(black > 0.5, pair[1], pair[0])


def _result(
    levels: Levels,
    port: int,
    nominal: _Nominal,
    fits: Sequence[_Fit],
    best: _Fit,
    late: NDArray[np.bool_],
) -> _Sensor:
    seen, black = levels.counts[late], levels.black[late].astype(float)
    spread = float(np.std(seen - np.where(black > 0.5, _mean(seen, black, 1), _mean(seen, black, 0))))
    floor = max(levels.noise, 1.0)

    def error(ids: Sequence[str], values: Array) -> float:
        return float(np.sqrt(np.mean((_predicted(black, nominal, ids, values) - seen) ** 2)))

    before, after = error((), np.zeros(0)), error(best.ids, best.values)
    removable = max(before - spread, 1e-9)
    causes = []
    for index, id_ in enumerate(best.ids):
        others = [place for place in range(len(best.ids)) if place != index]
        kept = tuple(best.ids[place] for place in others)
        without = min(error(each.ids, each.values) for each in fits if each.ids == kept)
        gain = Gain(without / floor, after / floor, float(np.clip((without - after) / removable, 0.0, 1.0)))
        number = _number(id_, float(best.values[index]), float(best.stds[index]), nominal)
        causes.append(tophat_cause(id_, port, number, gain, _rivals(fits, best, id_)))
    noisy = levels.noise > nominal.sd + 2.0 * USUAL_NOISE
    if noisy:
        causes.append(noise_cause(port, levels.noise, nominal.sd, spread / floor))
    drift = _drift(levels, nominal, best, port)
    unknown = ("time",) if drift else ()
    if not drift and best.misfit > FITS:
        unknown = ("surface",)
    named = {each.id for each in causes}
    rejected = tuple(
        Rejected(f"{id_}@{port}", "another cause explains the levels better, or they are as assumed")
        for id_ in (*WIDTHS, NOISE)
        if id_ not in named
    )
    plain = _along(levels, nominal, (), np.zeros(0))
    shown = _along(levels, nominal, best.ids, best.values)
    return _Sensor(
        ChannelResult(f"analog.{port}", "counts", before, after, floor, 0.0),
        tuple(causes),
        rejected,
        unknown,
        float(np.clip((after**2 - spread**2) / max(before**2 - spread**2, 1e-9), 0.0, 1.0)),
        ("read white and black again in another light and at the height of the table",) if drift else (),
        drift,
        {
            f"analog.{port} over {name}": ParameterResult(
                level, levels.noise, "counts", nominal.level(side, 0, 1, 0)
            )
            for side, (name, level) in enumerate(zip(("white", "black"), levels.usual, strict=True))
        },
        (Curve(f"analog.{port}", "counts", levels.time, levels.counts, plain, shown),),
    )


def _along(levels: Levels, nominal: _Nominal, ids: tuple[str, ...], values: Array) -> Array:
    return _predicted(levels.black.astype(float), nominal, ids, values)


def _number(id_: str, moved: float, std: float, nominal: _Nominal) -> ParameterResult:
    base = {AMBIENT: nominal.offset, GAIN: nominal.factor, HEIGHT: nominal.height}[id_]
    unit = effect(id_).parameters[0].unit
    return ParameterResult(base * (1.0 + moved) if id_ == GAIN else base + moved, std, unit, base)


def _mean(seen: Array, black: Array, side: int) -> float:
    mine = seen[black == side]
    return float(mine.mean()) if len(mine) else 0.0


def _rivals(fits: Sequence[_Fit], best: _Fit, id_: str) -> tuple[str, ...]:
    """Causes of other fits that do about as well without this one."""
    found = {
        name
        for each in fits
        if each.cost < best.cost + TIE and id_ not in each.ids
        for name in each.ids
        if name not in best.ids
    }
    return tuple(sorted(found))


def _drift(levels: Levels, nominal: _Nominal, best: _Fit, port: int) -> tuple[str, ...]:
    """Whether both levels move together with time, in one sentence; () where they stand."""
    table = levels.means(np.ones(len(levels.time), np.bool_))
    left = table[:, 2] - _predicted(table[:, 1], nominal, best.ids, best.values)
    pieces = np.unique(table[:, 0])
    shift = np.array([left[table[:, 0] == each].mean() for each in pieces])
    limit = 5.0 * float(np.hypot(np.median(table[:, 3]), SAME_UNIT))
    if len(shift) < 3 or float(np.ptp(shift)) < limit:
        return ()
    lowest, highest = int(pieces[int(np.argmin(shift))]), int(pieces[int(np.argmax(shift))])
    length = float(np.ptp(levels.time)) / 10.0
    return (
        f"analog.{port} moves by {float(np.ptp(shift)):.0f} counts on the same surface: lowest around "
        f"{levels.time[0] + (lowest + 0.5) * length:.1f} s, highest around "
        f"{levels.time[0] + (highest + 0.5) * length:.1f} s; light that changes does that",
    )
