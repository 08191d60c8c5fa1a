"""The diagnosis of one tophat: its levels, their causes, and what is not identifiable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.alternatives import alternative_notes, find_rivals
from raccoon.diagnose.recordings.tophats.checks import (
    describe_other_unit,
    describe_wrong_labels,
    without_impossible_counts,
)
from raccoon.diagnose.recordings.tophats.fit import (
    CHANGE_WIDTHS,
    MAX_MISFIT,
    LevelFit,
    NominalSensor,
    fit_levels,
    predict_counts,
    probability,
)
from raccoon.diagnose.recordings.tophats.level_changes import find_movement, split_at_step
from raccoon.diagnose.recordings.tophats.levels import SurfaceLevels, sort_levels
from raccoon.diagnose.recordings.tophats.sentences import (
    AMBIENT_LIGHT,
    GAIN,
    HEIGHT,
    NOISE,
    RECALIBRATE_ADVICE,
    USUAL_NOISE_COUNTS,
    describe_light,
    describe_light_offset,
    describe_older_factor,
    describe_older_sensor,
    describe_saturation,
    describe_unsure_surfaces,
    noise_cause,
    rejection_reason,
    tophat_cause,
)
from raccoon.diagnose.recordings.tophats.sorting import labelled_readings
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Curve,
    Gain,
    ParameterResult,
    Rejected,
    SensorFault,
)
from raccoon.sim.effects.effect import effect
from raccoon.sim.tophats import SENSOR_GENERATION

Array = NDArray[np.float64]

FITTED_SHARE = 0.7
"""Share of the time that is fitted; the rest is held out."""
MAX_MOVE_SHARE = 0.25
"""Largest movement of the levels, relative to their error, at which a single cause explains them."""


@dataclass(frozen=True, slots=True)
class SensorDiagnosis:
    """The result at one port. depends_on: covariates of the unexplained rest. unexplained_share: its share of
    the squared error."""

    channel: ChannelResult | None
    causes: tuple[CauseResult, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    depends_on: tuple[str, ...] = ()
    unexplained_share: float = 1.0
    advice: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    identified: Mapping[str, ParameterResult] = field(default_factory=dict)
    faults: tuple[SensorFault, ...] = ()
    curves: tuple[Curve, ...] = ()


def diagnose_sensor(
    time: Array, counts: Array, surface: Array | None, port: int, nominal: NominalSensor
) -> SensorDiagnosis:
    """Diagnose the tophat at `port`. surface: 1 black, 0 white, NaN without a label; None without labels."""
    counts, faults = without_impossible_counts(counts, port)
    found = _judge(*labelled_readings(time, counts, surface), port, nominal)
    return replace(found, faults=(*faults, *found.faults))


def _judge(
    time: Array, counts: Array, surface: Array | None, port: int, nominal: NominalSensor
) -> SensorDiagnosis:
    levels = sort_levels(time, counts, surface)
    if unit := describe_other_unit(counts, levels, nominal):
        return _not_identifiable(port, unit, "record whole counts of 0 to 4095")
    step = split_at_step(time, counts, surface, levels)
    if step is not None:
        return _judge_both_sides(port, nominal, *step)
    if isinstance(levels, str) and (problem := describe_wrong_labels(time, counts, surface, port)):
        return _not_identifiable(port, f"{problem} {levels}", "leave such labels out (--truth-free)")
    if isinstance(levels, str):
        return _not_identifiable(port, levels, "drive slowly over a black line on white, several times")
    movement = find_movement(levels)
    if movement is None:
        return _judge_constant(levels, port, nominal)
    return _judge_drifting(levels, port, nominal, movement)


def _not_identifiable(port: int, reason: str, advice: str) -> SensorDiagnosis:
    text = f"not identifiable: analog.{port}: {reason}"
    rejected = tuple(Rejected(f"{id_}@{port}", text) for id_ in (*CHANGE_WIDTHS, NOISE))
    return SensorDiagnosis(None, rejected=rejected, advice=(advice,), notes=(text,))


def _judge_both_sides(
    port: int, nominal: NominalSensor, when: float, before: SurfaceLevels, after: SurfaceLevels
) -> SensorDiagnosis:
    """Judge levels that jump at `when` (s), separately before and after. The later part is the sensor's
    current state, so its causes are named first."""
    earlier, later = _judge_constant(before, port, nominal), _judge_constant(after, port, nominal)
    is_later_shown = bool(later.causes) or not earlier.causes
    shown, other = (later, earlier) if is_later_shown else (earlier, later)
    words = f"From {when:.1f} s on" if is_later_shown else f"Until {when:.1f} s"
    note = (
        f"analog.{port} jumps at {when:.1f} s: white from {before.medians[0]:.0f} to {after.medians[0]:.0f}, "
        f"black from {before.medians[1]:.0f} to {after.medians[1]:.0f} counts; before and after were judged "
        "separately"
    )
    meanwhile = "; ".join(each.explanation for each in other.causes) or "as assumed"
    note += f"; {'until then' if is_later_shown else 'from then on'}: {meanwhile.rstrip('.')}"
    causes = tuple(
        each
        if each.id == NOISE
        else replace(each, explanation=f"{words}: {each.explanation[0].lower()}{each.explanation[1:]}")
        for each in shown.causes
    )
    return replace(
        shown,
        causes=causes,
        depends_on=("time",),
        advice=RECALIBRATE_ADVICE,
        notes=tuple(dict.fromkeys((note, *earlier.notes, *later.notes))),
        faults=tuple(dict.fromkeys((*earlier.faults, *later.faults))),
        identified=_identified(after if is_later_shown else before, port, nominal),
        curves=(_join_curves(earlier.curves[0], later.curves[0]),),
    )


def _join_curves(first: Curve, second: Curve) -> Curve:
    pairs = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("time", "measured", "before", "after")
    }
    return Curve(first.name, first.unit, **pairs)


def _judge_drifting(
    levels: SurfaceLevels, port: int, nominal: NominalSensor, movement: tuple[float, float, float]
) -> SensorDiagnosis:
    """Judge levels that drift. If they move by more than `MAX_MOVE_SHARE` of their error they have no single
    cause; else the cause of their mean is named."""
    size, lowest, highest = movement
    largest_error = max(abs(levels.medians[side] - nominal.level(side)) for side in (0, 1))
    found = _judge_constant(levels, port, nominal, (() if size > MAX_MOVE_SHARE * largest_error else None))
    note = (
        f"analog.{port} moves by {size:.0f} counts on the same surface: lowest around {lowest:.1f} s, "
        f"highest around {highest:.1f} s; changing light, a loose mount or a warming sensor does that"
    )
    return replace(found, depends_on=("time",), advice=RECALIBRATE_ADVICE, notes=(note, *found.notes))


def _judge_constant(
    levels: SurfaceLevels, port: int, nominal: NominalSensor, allowed: tuple[str, ...] | None = None
) -> SensorDiagnosis:
    """Judge constant levels. allowed: causes that may be named, all by default."""
    is_early = levels.time < levels.time[0] + FITTED_SHARE * float(np.ptp(levels.time))
    if not all((is_early & (levels.black == side)).sum() >= 8 for side in (False, True)):
        is_early = np.ones(len(is_early), np.bool_)
    fits = fit_levels(levels.surface_levels(is_early), nominal, levels.clipped)
    best = min(fits, key=lambda each: each.cost)
    is_certain = levels.is_sorting_certain or best.parameter_count < 2
    if allowed is not None or not is_certain:
        named = allowed or ()
        best = min((each for each in fits if each.ids == named), key=lambda each: each.cost)
    is_late = ~is_early if (~is_early).sum() >= 20 else np.ones(len(is_early), np.bool_)
    return _sensor_diagnosis(levels, port, nominal, fits, best, is_late, is_certain)


def _sensor_diagnosis(
    levels: SurfaceLevels,
    port: int,
    nominal: NominalSensor,
    fits: Sequence[LevelFit],
    best: LevelFit,
    is_late: NDArray[np.bool_],
    is_certain: bool,
) -> SensorDiagnosis:
    counts, black = levels.counts[is_late], levels.black[is_late].astype(float)
    white_mean, black_mean = (_surface_mean(counts, black, side) for side in (0, 1))
    spread = float(np.std(counts - np.where(black > 0.5, black_mean, white_mean)))
    floor = max(levels.noise, 1.0)

    def error(ids: Sequence[str], values: Array) -> float:
        return float(np.sqrt(np.mean((predict_counts(black, nominal, ids, values) - counts) ** 2)))

    before, after = error((), np.zeros(0)), error(best.ids, best.values)
    removable = max(before - spread, 1e-9)
    causes = []
    for index, id_ in enumerate(best.ids):
        kept = tuple(each for each in best.ids if each != id_)
        without = min(error(each.ids, each.values) for each in fits if set(each.ids) == set(kept))
        gain = Gain(without / floor, after / floor, float(np.clip((without - after) / removable, 0.0, 1.0)))
        number = _parameter_result(id_, float(best.values[index]), float(best.stds[index]), nominal)
        rivals = find_rivals(fits, best, id_, levels.unclipped_count)
        causes.append(tophat_cause(id_, port, number, gain, rivals, probability(fits, id_)))
    causes, notes = _with_model_sentences(causes, port, best)
    notes = (*notes, *alternative_notes(port, levels, nominal, fits, best))
    if not is_certain:
        notes = (*notes, describe_unsure_surfaces(port, levels.medians))
    if levels.noise > np.hypot(nominal.sd + 2.0 * USUAL_NOISE_COUNTS, levels.floor_pattern):
        causes = [*causes, noise_cause(port, levels.noise_number(nominal.sd), spread / floor)]
    named = {each.id for each in causes}
    rivals_of_named = {name for each in causes for name in each.confounded_with}
    return SensorDiagnosis(
        ChannelResult(f"analog.{port}", "counts", before, after, floor),
        tuple(causes),
        tuple(
            Rejected(f"{id_}@{port}", rejection_reason(id_ in rivals_of_named))
            for id_ in (*CHANGE_WIDTHS, NOISE)
            if id_ not in named
        ),
        () if best.is_exact and best.misfit <= MAX_MISFIT else ("surface",),
        float(np.clip((after**2 - spread**2) / max(before**2 - spread**2, 1e-9), 0.0, 1.0)),
        RECALIBRATE_ADVICE if best.parameter_count > 1 or not is_certain else (),
        notes,
        _identified(levels, port, nominal),
        _saturation_faults(levels, port, fits),
        (_curve(levels, port, nominal, best),),
    )


def _with_model_sentences(
    causes: Sequence[CauseResult], port: int, best: LevelFit
) -> tuple[list[CauseResult], tuple[str, ...]]:
    """The causes with sentences on the light or the make of the sensor, and notes on their approximation by
    the contract's parameters."""
    described, notes = [], []
    for each in causes:
        if each.id == AMBIENT_LIGHT and best.light:
            described.append(replace(each, explanation=describe_light(port, best.light, best.level_drops)))
            notes.append(describe_light_offset(port, each.parameters["offset"]))
        elif each.id == GAIN and best.generation != SENSOR_GENERATION:
            described.append(replace(each, explanation=describe_older_sensor(port)))
            notes.append(describe_older_factor(port, each.parameters["factor"]))
        else:
            described.append(each)
    return described, tuple(notes)


def _saturation_faults(levels: SurfaceLevels, port: int, fits: Sequence[LevelFit]) -> tuple[SensorFault, ...]:
    """The fault of a clipped level."""
    if levels.unclipped_count == 2:
        return ()
    words = {AMBIENT_LIGHT: "light", GAIN: "gain", HEIGHT: "height"}
    wrong = fits[0].misfit > MAX_MISFIT
    possible_causes = tuple(
        words[each.ids[0]] for each in fits if wrong and len(each.ids) == 1 and each.misfit <= MAX_MISFIT
    )
    text = describe_saturation(port, levels.clipped, possible_causes)
    return (SensorFault(f"analog.{port}", "saturated", text),)


def _identified(levels: SurfaceLevels, port: int, nominal: NominalSensor) -> dict[str, ParameterResult]:
    return {
        f"analog.{port} over {name}": ParameterResult(level, levels.noise, "counts", nominal.level(side))
        for side, (name, level) in enumerate(zip(("white", "black"), levels.medians, strict=True))
    }


def _curve(levels: SurfaceLevels, port: int, nominal: NominalSensor, best: LevelFit) -> Curve:
    black = levels.black.astype(float)
    plain = predict_counts(black, nominal, (), np.zeros(0))
    shown = predict_counts(black, nominal, best.ids, best.values)
    return Curve(f"analog.{port}", "counts", levels.time, levels.counts, plain, shown)


def _parameter_result(id_: str, change: float, std: float, nominal: NominalSensor) -> ParameterResult:
    """The changed parameter, clipped to the catalogue's bounds."""
    base = {AMBIENT_LIGHT: nominal.offset, GAIN: nominal.factor, HEIGHT: nominal.height}[id_]
    parameter = effect(id_).parameters[0]
    value, std = (base * (1.0 + change), base * std) if id_ == GAIN else (base + change, std)
    value = float(np.clip(value, parameter.bounds.low, parameter.bounds.high))
    return ParameterResult(value, std, parameter.unit, base)


def _surface_mean(counts: Array, black: Array, side: int) -> float:
    mine = counts[black == side]
    return float(mine.mean()) if len(mine) else 0.0
