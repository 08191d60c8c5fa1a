"""One tophat: its levels, what explains them, and what cannot be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.alike import also_so, rivals_of
from raccoon.diagnose.recordings.tophats.checks import other_unit, possible, strange_labels
from raccoon.diagnose.recordings.tophats.fit import (
    FITS,
    WIDTHS,
    LevelFit,
    Nominal,
    level_fits,
    predicted,
    probability,
)
from raccoon.diagnose.recordings.tophats.levels import Levels, levels_of
from raccoon.diagnose.recordings.tophats.over_time import at_a_step, move
from raccoon.diagnose.recordings.tophats.sorting import labelled
from raccoon.diagnose.recordings.tophats.words import (
    ADVICE,
    AMBIENT,
    GAIN,
    HEIGHT,
    NOISE,
    USUAL_NOISE,
    cut_text,
    light_note,
    light_sentence,
    noise_cause,
    older_note,
    older_sentence,
    tophat_cause,
    unsure_note,
    why_not,
)
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
from raccoon.sim.tophats import GENERATION

Array = NDArray[np.float64]

FITTED = 0.7
"""Part of the time that is fitted; the rest is there to judge on."""
LITTLE_MOVE = 0.25
"""Share of what is wrong with the levels by which they may move and still be judged as one."""


@dataclass(frozen=True, slots=True)
class SensorResult:
    """What was found at one port. unknown: what the rest depends on. rest: its share."""

    channel: ChannelResult | None
    causes: tuple[CauseResult, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    unknown: tuple[str, ...] = ()
    rest: float = 1.0
    advice: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    identified: Mapping[str, ParameterResult] = field(default_factory=dict)
    faults: tuple[SensorFault, ...] = ()
    curves: tuple[Curve, ...] = ()


def judge_tophat(
    time: Array, counts: Array, surface: Array | None, port: int, nominal: Nominal
) -> SensorResult:
    """Judge the tophat at `port`. surface: 1 black, 0 white where a reference says so."""
    counts, faults = possible(counts, port)
    found = _judged(*labelled(time, counts, surface), port, nominal)
    return replace(found, faults=(*faults, *found.faults))


def _judged(time: Array, counts: Array, surface: Array | None, port: int, nominal: Nominal) -> SensorResult:
    levels = levels_of(time, counts, surface)
    if unit := other_unit(counts, levels, nominal):
        return _not_told(port, unit, "record whole counts of 0 to 4095")
    apart = at_a_step(time, counts, surface, levels)
    if apart is not None:
        return _before_and_after(port, nominal, *apart)
    if isinstance(levels, str) and (strange := strange_labels(time, counts, surface, port)):
        return _not_told(port, f"{strange} {levels}", "leave such labels out (--truth-free)")
    if isinstance(levels, str):
        return _not_told(port, levels, "drive slowly over a black line on white, several times")
    moved = move(levels)
    if moved is None:
        return _standing(levels, port, nominal)
    return _drifting(levels, port, nominal, moved)


def _not_told(port: int, reason: str, advice: str) -> SensorResult:
    said = f"not identifiable: analog.{port}: {reason}"
    rejected = tuple(Rejected(f"{id_}@{port}", said) for id_ in (*WIDTHS, NOISE))
    return SensorResult(None, rejected=rejected, advice=(advice,), notes=(said,))


def _before_and_after(
    port: int, nominal: Nominal, when: float, before: Levels, after: Levels
) -> SensorResult:
    """Both parts apart; the later one is how the sensor is now, so its causes are named first."""
    sooner, later = _standing(before, port, nominal), _standing(after, port, nominal)
    of_later = bool(later.causes) or not sooner.causes
    shown, other = (later, sooner) if of_later else (sooner, later)
    words = f"From {when:.1f} s on" if of_later else f"Until {when:.1f} s"
    note = (
        f"analog.{port} jumps at {when:.1f} s: white from {before.usual[0]:.0f} to {after.usual[0]:.0f}, "
        f"black from {before.usual[1]:.0f} to {after.usual[1]:.0f} counts; before and after were judged apart"
    )
    meanwhile = "; ".join(each.explanation for each in other.causes) or "as assumed"
    note += f"; {'until then' if of_later else 'from then on'}: {meanwhile.rstrip('.')}"
    causes = tuple(
        each
        if each.id == NOISE
        else replace(each, explanation=f"{words}: {each.explanation[0].lower()}{each.explanation[1:]}")
        for each in shown.causes
    )
    return replace(
        shown,
        causes=causes,
        unknown=("time",),
        advice=ADVICE,
        notes=tuple(dict.fromkeys((note, *sooner.notes, *later.notes))),
        faults=tuple(dict.fromkeys((*sooner.faults, *later.faults))),
        identified=_identified(after if of_later else before, port, nominal),
        curves=(_joined(sooner.curves[0], later.curves[0]),),
    )


def _joined(first: Curve, second: Curve) -> Curve:
    pairs = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("time", "measured", "before", "after")
    }
    return Curve(first.name, first.unit, **pairs)


def _drifting(levels: Levels, port: int, nominal: Nominal, moved: tuple[float, float, float]) -> SensorResult:
    """Levels that move more than they are wrong have no one cause; else the one of their mean is named."""
    size, lowest, highest = moved
    wrong = max(abs(levels.usual[side] - nominal.level(side)) for side in (0, 1))
    found = _standing(levels, port, nominal, (() if size > LITTLE_MOVE * wrong else None))
    note = (
        f"analog.{port} moves by {size:.0f} counts on the same surface: lowest around {lowest:.1f} s, "
        f"highest around {highest:.1f} s; changing light, a loose mount or a warming sensor does that"
    )
    return replace(found, unknown=("time",), advice=ADVICE, notes=(note, *found.notes))


def _standing(
    levels: Levels, port: int, nominal: Nominal, only: tuple[str, ...] | None = None
) -> SensorResult:
    """Levels that stand. only: the causes that may be named, all by default."""
    early = levels.time < levels.time[0] + FITTED * float(np.ptp(levels.time))
    if not all((early & (levels.black == side)).sum() >= 8 for side in (False, True)):
        early = np.ones(len(early), np.bool_)
    fits = level_fits(levels.both(early), nominal, levels.cut)
    best = min(fits, key=lambda each: each.cost)
    told = levels.sorted_surely or best.numbers < 2
    if only is not None or not told:
        named = only or ()
        best = min((each for each in fits if each.ids == named), key=lambda each: each.cost)
    late = ~early if (~early).sum() >= 20 else np.ones(len(early), np.bool_)
    return _result(levels, port, nominal, fits, best, late, told)


def _result(
    levels: Levels,
    port: int,
    nominal: Nominal,
    fits: Sequence[LevelFit],
    best: LevelFit,
    late: NDArray[np.bool_],
    told: bool,
) -> SensorResult:
    seen, black = levels.counts[late], levels.black[late].astype(float)
    spread = float(np.std(seen - np.where(black > 0.5, _mean(seen, black, 1), _mean(seen, black, 0))))
    floor = max(levels.noise, 1.0)

    def error(ids: Sequence[str], values: Array) -> float:
        return float(np.sqrt(np.mean((predicted(black, nominal, ids, values) - seen) ** 2)))

    before, after = error((), np.zeros(0)), error(best.ids, best.values)
    removable = max(before - spread, 1e-9)
    causes = []
    for index, id_ in enumerate(best.ids):
        kept = tuple(each for each in best.ids if each != id_)
        without = min(error(each.ids, each.values) for each in fits if set(each.ids) == set(kept))
        gain = Gain(without / floor, after / floor, float(np.clip((without - after) / removable, 0.0, 1.0)))
        number = _number(id_, float(best.values[index]), float(best.stds[index]), nominal)
        rivals = rivals_of(fits, best, id_, levels.whole)
        causes.append(tophat_cause(id_, port, number, gain, rivals, probability(fits, id_)))
    causes, notes = _as_it_is(causes, port, best)
    notes = (*notes, *also_so(port, levels, nominal, fits, best))
    if not told:
        notes = (*notes, unsure_note(port, levels.usual))
    if levels.noise > np.hypot(nominal.sd + 2.0 * USUAL_NOISE, levels.pattern):
        causes = [*causes, noise_cause(port, levels.noise_number(nominal.sd), spread / floor)]
    named = {each.id for each in causes}
    rivals_of_named = {name for each in causes for name in each.confounded_with}
    return SensorResult(
        ChannelResult(f"analog.{port}", "counts", before, after, floor),
        tuple(causes),
        tuple(
            Rejected(f"{id_}@{port}", why_not(id_ in rivals_of_named))
            for id_ in (*WIDTHS, NOISE)
            if id_ not in named
        ),
        () if best.exact and best.misfit <= FITS else ("surface",),
        float(np.clip((after**2 - spread**2) / max(before**2 - spread**2, 1e-9), 0.0, 1.0)),
        ADVICE if best.numbers > 1 or not told else (),
        notes,
        _identified(levels, port, nominal),
        _cut(levels, port, fits),
        (_curve(levels, port, nominal, best),),
    )


def _as_it_is(
    causes: Sequence[CauseResult], port: int, best: LevelFit
) -> tuple[list[CauseResult], tuple[str, ...]]:
    """Causes whose sentences say what light or what make of sensor it is, and what the numbers make of it."""
    said, notes = [], []
    for each in causes:
        if each.id == AMBIENT and best.light:
            said.append(replace(each, explanation=light_sentence(port, best.light, best.falls)))
            notes.append(light_note(port, each.parameters["offset"]))
        elif each.id == GAIN and best.generation != GENERATION:
            said.append(replace(each, explanation=older_sentence(port)))
            notes.append(older_note(port, each.parameters["factor"]))
        else:
            said.append(each)
    return said, tuple(notes)


def _cut(levels: Levels, port: int, fits: Sequence[LevelFit]) -> tuple[SensorFault, ...]:
    """What is said of a level that is cut off."""
    if levels.whole == 2:
        return ()
    words = {AMBIENT: "light", GAIN: "gain", HEIGHT: "height"}
    wrong = fits[0].misfit > FITS
    able = tuple(words[each.ids[0]] for each in fits if wrong and len(each.ids) == 1 and each.misfit <= FITS)
    text = cut_text(port, levels.cut, able)
    return (SensorFault(f"analog.{port}", "saturated", text),)


def _identified(levels: Levels, port: int, nominal: Nominal) -> dict[str, ParameterResult]:
    return {
        f"analog.{port} over {name}": ParameterResult(level, levels.noise, "counts", nominal.level(side))
        for side, (name, level) in enumerate(zip(("white", "black"), levels.usual, strict=True))
    }


def _curve(levels: Levels, port: int, nominal: Nominal, best: LevelFit) -> Curve:
    black = levels.black.astype(float)
    plain = predicted(black, nominal, (), np.zeros(0))
    shown = predicted(black, nominal, best.ids, best.values)
    return Curve(f"analog.{port}", "counts", levels.time, levels.counts, plain, shown)


def _number(id_: str, moved: float, std: float, nominal: Nominal) -> ParameterResult:
    """The number as the catalogue allows it."""
    base = {AMBIENT: nominal.offset, GAIN: nominal.factor, HEIGHT: nominal.height}[id_]
    parameter = effect(id_).parameters[0]
    value, std = (base * (1.0 + moved), base * std) if id_ == GAIN else (base + moved, std)
    value = float(np.clip(value, parameter.bounds.low, parameter.bounds.high))
    return ParameterResult(value, std, parameter.unit, base)


def _mean(seen: Array, black: Array, side: int) -> float:
    mine = seen[black == side]
    return float(mine.mean()) if len(mine) else 0.0
