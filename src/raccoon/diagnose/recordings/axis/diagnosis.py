"""The diagnosis of one motor or axis: force, torque or voltage in, speed or position out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.unseen import said_of_holdout
from raccoon.diagnose.fit.noise_model import whiteness
from raccoon.diagnose.recordings.axis.causes import unit_of
from raccoon.diagnose.recordings.axis.fit import NEAR_END
from raccoon.diagnose.recordings.axis.judge import (
    JudgedAxis,
    error_with,
    error_with_twin,
    judge_axis,
    model_errors,
    overall,
)
from raccoon.diagnose.recordings.axis.log import AxisLog, axis_log, like
from raccoon.diagnose.recordings.axis.rest import depends_on
from raccoon.diagnose.recordings.axis.search import TIE, Tried, alike
from raccoon.diagnose.recordings.axis.words import axis_sentence
from raccoon.diagnose.result import (
    LARGE_REST,
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

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

FAR = 3.0
"""Noise floors that a speed or current may be off by before what is left is large. A position's error grows
with every push, so there only the share counts."""
SAME_DIRECTION = 0.95
"""Cosine of what two causes change from which they are the same to the data."""
AS_GOOD = 1.1
"""Times the error on unseen data up to which another cause foresees it as well."""
TWINS = {
    "drive.slope": "friction.direction_dependent",
    "friction.direction_dependent": "drive.slope",
}
"""Causes that are one term of the equations while the axis moves, as long as there is dry friction."""
NOT_SHOWN = {
    "battery.internal_resistance": "not visible: battery.voltage is missing, or a current",
    "motor.heating": "not visible: it takes minutes of load and a current",
    "drive.backlash": "not visible: one sensor before or after the gear sees no play",
}


@dataclass(frozen=True, slots=True)
class Place:
    """Which axis it is. where: of its causes in the contract. words: for people."""

    where: str | None
    words: str


def diagnose_axis(columns: Columns, port: int, place: Place, holdout: Columns | None = None) -> Diagnosis:
    """Name what is wrong with the model of the axis at motor `port`.

    Raises TraceError where the recording does not hold what drives it and how it moves, or is too short, and
    HoldoutError where the other one does not.
    """
    begin = time.perf_counter()
    log = axis_log(columns, port)
    other = None
    if holdout is not None:
        with said_of_holdout():
            other = like(log, axis_log(holdout, port))
    return _diagnosis(judge_axis(log, other), place, begin)


def _diagnosis(judged: JudgedAxis, place: Place, begin: float) -> Diagnosis:
    causes = tuple(_cause(judged, place, index) for index in range(len(judged.causes)))
    channels = _channels(judged)
    rest = _rest(channels[0])
    far = judged.log.is_speed and any(each.rmse_after > FAR * each.noise_floor for each in channels)
    dependence = depends_on(judged.unseen, judged.fit) if far or rest > 0.1 else ()
    large = far or (rest > LARGE_REST and bool(dependence))
    return Diagnosis(
        _verdict(bool(causes), large),
        channels,
        causes,
        _rejected(judged, place),
        Unexplained(rest, dependence),
        (),
        time.perf_counter() - begin,
        None,
        _notes(judged),
        _identified(judged),
        (),
        _curves(judged),
    )


def _verdict(causes: bool, large: bool) -> Verdict:
    if causes:
        return Verdict.PARTLY if large else Verdict.EXPLAINED
    return Verdict.UNKNOWN if large else Verdict.ADEQUATE


def _rest(channel: ChannelResult) -> float:
    """Share of the squared error before, less the noise, that is left."""
    before, after, floor = (
        each**2 for each in (channel.rmse_before, channel.rmse_after, channel.noise_floor)
    )
    return float(np.clip((after - floor) / max(before - floor, 1e-300), 0.0, 1.0))


def _cause(judged: JudgedAxis, place: Place, index: int) -> CauseResult:
    tried = judged.causes[index]
    values, stds = judged.final.values, judged.final.stds()
    parameters = {
        name: ParameterResult(
            values[number.name], _std(number.name, stds, judged.log), unit_of(number.name, judged.log), 0.0
        )
        for number, name in zip(tried.cause.numbers, tried.cause.names, strict=True)
    }
    without, after = judged.without[index], overall(judged.after, judged.floor)
    removable = max(overall(judged.before, judged.floor) - min(after, 1.0), 1e-300)
    share = float(np.clip((without - after) / removable, 0.0, 1.0))
    rivals = _rivals(judged, tried)
    return CauseResult(
        tried.cause.id,
        place.where,
        index + 1,
        parameters,
        Gain(without, after, share),
        _probability(tried, sum(rivals.values())),
        tuple(rivals),
        axis_sentence(tried.cause.id, place.words, parameters, tried.cause.numbers[0].name),
    )


def _std(name: str, stds: Mapping[str, float], log: AxisLog) -> float:
    """Deviation of a number. When a command began to act is not known better than to a sample."""
    return math.hypot(stds[name], log.step / math.sqrt(12.0)) if name == "latency" else stds[name]


def _probability(tried: Tried, odds: float) -> float:
    """That the data ask for it at all, shared with what cannot be told from it."""
    return 1.0 / (1.0 + odds + math.exp(-min(tried.evidence / 2.0, 30.0)))


def _rivals(judged: JudgedAxis, tried: Tried) -> dict[str, float]:
    """Causes that cannot be told from this one, with their odds against it.

    Candidates with as much evidence at the same step, that move the data in the same direction and foresee
    unseen data as well; and the one that is the same term of the equations while the axis moves."""
    limit = AS_GOOD * overall(judged.after, judged.floor)
    found = {
        each.cause.id: math.exp(min(0.5 * (each.evidence - tried.evidence), 30.0))
        for each in sorted(tried.rivals, key=lambda each: each.evidence)
        if each.evidence > tried.evidence - TIE
        and alike(tried.fit, tried.cause, each.fit, each.cause) > SAME_DIRECTION
        and error_with(judged, each, instead_of=tried) < limit
    }
    twin = TWINS.get(tried.cause.id)
    if twin is not None and twin not in found and error_with_twin(judged) < limit:
        found[twin] = 1.0
    return found


def _channels(judged: JudgedAxis) -> tuple[ChannelResult, ...]:
    found = []
    units = (judged.log.motion_unit, "A")
    motion, current = model_errors(judged.unseen, judged.fit)
    for index, error in enumerate((motion, current)):
        if error is None:
            continue
        column = np.nan_to_num(error.T.ravel()[np.isfinite(error.T.ravel())])[:, None]
        found.append(
            ChannelResult(
                judged.log.names[1 + index],
                units[index],
                float(judged.before[index]),
                float(judged.after[index]),
                float(judged.floor[index]),
                float(whiteness(column)[0]),
            )
        )
    return tuple(found)


def _rejected(judged: JudgedAxis, place: Place) -> tuple[Rejected, ...]:
    suffix = "" if place.where is None else f"@{place.where}"
    named = {each.cause.id for each in judged.causes}
    found = [
        Rejected(each.cause.id + suffix, "it improves the fit but not the data that the fit has not seen")
        for each in judged.useless
    ]
    told = named | {each.cause.id for each in judged.useless}
    # The better one of two rules of one effect comes last, and stays.
    tried = {each.cause.id: each for each in sorted(judged.search.tried, key=lambda each: each.evidence)}
    found += [
        Rejected(each.cause.id + suffix, _reason(each))
        for each in judged.search.tried
        if each.cause.id not in told and tried[each.cause.id] is each
    ]
    return (*found, *(Rejected(id_, reason) for id_, reason in NOT_SHOWN.items()))


def _reason(tried: Tried) -> str:
    if tried.evidence <= 0.0:
        return f"the data do not ask for it (evidence {tried.evidence:.1f}; 10 is needed)"
    if tried.left_out <= 0.0:
        return f"it makes the blocks left out of the fit worse (evidence {tried.evidence:.1f})"
    return (
        f"too little evidence ({tried.evidence:.1f}, and {tried.left_out:.1f} on blocks left out; "
        "10 and 6 are needed)"
    )


def _identified(judged: JudgedAxis) -> Mapping[str, ParameterResult]:
    values, stds = judged.final.values, judged.final.stds()
    return {
        _name(each.name, judged.log): ParameterResult(
            values[each.name], stds[each.name], unit_of(each.name, judged.log), math.nan
        )
        for each in judged.search.base.numbers
        if not each.at_its_end(values[each.name])
    }


def _name(number: str, log: AxisLog) -> str:
    return "electrical_lag" if number == "inductance" and not log.electrical else number


def _notes(judged: JudgedAxis) -> tuple[str, ...]:
    log = judged.log
    notes = []
    if not log.is_speed:
        seconds = (judged.data.parts.count - 1) * judged.data.parts.every * log.step
        notes.append(f"errors of {log.names[1]} are those of free simulations of {seconds:g} s each")
    if log.effort_unit == "V" and log.current is None:
        notes.append(
            f"{log.names[2]} is missing: resistance, K_E, inertia and friction share one scale, so friction "
            "is given in volts at the motor and none of the four by itself"
        )
    if log.effort_unit != "V":
        notes.append(
            "dry friction that differs by direction acts like a constant force while the axis moves: the two "
            "are one number here, offset"
        )
    notes += [
        f"{_name(each.name, log)} ends at {value:.2g} {unit_of(each.name, log)}, the "
        f"{'smallest' if value <= NEAR_END * each.low else 'largest'} that is tried: this recording does not "
        "show it"
        for each, value in ((each, judged.final.values[each.name]) for each in judged.final.numbers)
        if each.at_its_end(value)
    ]
    return tuple(notes)


def _curves(judged: JudgedAxis) -> tuple[Curve, ...]:
    unseen = judged.unseen
    rows = unseen.parts.rows().T.ravel()
    measured = unseen.parts.measured.T.ravel()
    before, after = (model_errors(unseen, each)[0].T.ravel() for each in (judged.search.base, judged.fit))
    if not judged.log.is_speed:
        # Millimetres beside centimetres would not be seen: the errors themselves are drawn.
        name = f"error of {judged.log.names[1]}"
        return (Curve(name, judged.log.motion_unit, unseen.log.time[rows], 0.0 * before, before, after),)
    return (
        Curve(
            judged.log.names[1], judged.log.motion_unit, unseen.log.time[rows], measured, measured + before,
            measured + after,
        ),
    )  # fmt: skip
