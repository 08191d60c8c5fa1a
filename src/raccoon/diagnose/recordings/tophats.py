"""Reflectance recordings: is it light from outside, the sensor's gain, its height, or noise?

The simulated reading is factor * counts(height) + offset. White and black are two levels, so one of the three
can be told from the others, and two together only by what usual deviations are; where that does not decide,
all that fit are listed. Light from outside may change with time, the others do not.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.extend import with_causes
from raccoon.diagnose.recordings.tophat_fit import SAME_UNIT, WIDTHS, LevelFit, Nominal, level_fits, predicted
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
from raccoon.sim.effects import effect
from raccoon.sim.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

FITS = 9.0
TIE = 3.0
FITTED = 0.7


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
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(causes, start=1))
    channels = tuple(each.channel for each in parts if each.channel is not None)
    return Diagnosis(
        _verdict(bool(channels), bool(causes), any(each.unknown for each in parts)),
        channels,
        ranked,
        tuple(rejected for each in parts for rejected in each.rejected),
        Unexplained(
            float(np.mean([each.rest for each in parts])) if parts else 1.0,
            tuple(dict.fromkeys(name for each in parts for name in each.unknown)),
        ),
        tuple(dict.fromkeys(text for each in parts for text in each.advice)),
        clock.perf_counter() - begin,
        with_causes(model or Parameters.from_robot(robot), ranked) if robot.tophats else None,
        tuple(note for each in parts for note in each.notes),
        {name: value for each in parts for name, value in each.identified.items()},
        (),
        tuple(curve for each in parts for curve in each.curves),
    )


def _verdict(seen: bool, causes: bool, unknown: bool) -> Verdict:
    if not seen:
        return Verdict.NOT_IDENTIFIABLE
    if causes:
        return Verdict.PARTLY if unknown else Verdict.EXPLAINED
    return Verdict.UNKNOWN if unknown else Verdict.ADEQUATE


def _nominal(model: Parameters | None, port: int) -> Nominal:
    names = {AMBIENT: "offset", GAIN: "factor", HEIGHT: "height", NOISE: "sd"}
    if model is None:
        return Nominal(height=float(effect(HEIGHT).parameters[0].neutral or 0.007))
    return Nominal(*(model.value(id_, name, str(port)) for id_, name in names.items()))


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


def _sensor(columns: Columns, port: int, nominal: Nominal, truth_free: bool) -> _Sensor:
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


def _judged(levels: Levels, port: int, nominal: Nominal) -> _Sensor:
    early = levels.time < levels.time[0] + FITTED * float(np.ptp(levels.time))
    if not all((early & (levels.black == side)).sum() >= 8 for side in (False, True)):
        early = np.ones(len(early), np.bool_)
    table = levels.means(early)
    fits = level_fits(table, nominal)
    best = min(fits, key=lambda each: each.cost)
    late = ~early if (~early).sum() >= 20 else np.ones(len(early), np.bool_)
    return _result(levels, port, nominal, fits, best, late)


def _result(
    levels: Levels,
    port: int,
    nominal: Nominal,
    fits: Sequence[LevelFit],
    best: LevelFit,
    late: NDArray[np.bool_],
) -> _Sensor:
    seen, black = levels.counts[late], levels.black[late].astype(float)
    spread = float(np.std(seen - np.where(black > 0.5, _mean(seen, black, 1), _mean(seen, black, 0))))
    floor = max(levels.noise, 1.0)

    def error(ids: Sequence[str], values: Array) -> float:
        return float(np.sqrt(np.mean((predicted(black, nominal, ids, values) - seen) ** 2)))

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


def _along(levels: Levels, nominal: Nominal, ids: tuple[str, ...], values: Array) -> Array:
    return predicted(levels.black.astype(float), nominal, ids, values)


def _number(id_: str, moved: float, std: float, nominal: Nominal) -> ParameterResult:
    base = {AMBIENT: nominal.offset, GAIN: nominal.factor, HEIGHT: nominal.height}[id_]
    unit = effect(id_).parameters[0].unit
    return ParameterResult(base * (1.0 + moved) if id_ == GAIN else base + moved, std, unit, base)


def _mean(seen: Array, black: Array, side: int) -> float:
    mine = seen[black == side]
    return float(mine.mean()) if len(mine) else 0.0


def _rivals(fits: Sequence[LevelFit], best: LevelFit, id_: str) -> tuple[str, ...]:
    """Causes of other fits that do about as well without this one."""
    found = {
        name
        for each in fits
        if each.cost < best.cost + TIE and id_ not in each.ids
        for name in each.ids
        if name not in best.ids
    }
    return tuple(sorted(found))


def _drift(levels: Levels, nominal: Nominal, best: LevelFit, port: int) -> tuple[str, ...]:
    """Whether both levels move together with time, in one sentence; () where they stand."""
    table = levels.means(np.ones(len(levels.time), np.bool_))
    left = table[:, 2] - predicted(table[:, 1], nominal, best.ids, best.values)
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
