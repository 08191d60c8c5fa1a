"""The diagnosis of one motor or axis: force, torque or voltage in, speed or position out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.holdout import naming_holdout
from raccoon.diagnose.fit.noise_model import whiteness_p_values
from raccoon.diagnose.recordings.axis.causes import unit_of
from raccoon.diagnose.recordings.axis.fit import BOUND_TOLERANCE
from raccoon.diagnose.recordings.axis.judge import (
    JudgedAxis,
    combined_error,
    error_with_equivalent,
    error_with_rival,
    judge_axis,
    model_errors,
)
from raccoon.diagnose.recordings.axis.log import AxisLog, axis_log, with_channels_of
from raccoon.diagnose.recordings.axis.residual_dependence import residual_dependence
from raccoon.diagnose.recordings.axis.search import MAX_TIE, TriedCause, cause_similarity
from raccoon.diagnose.recordings.axis.sentences import axis_sentence
from raccoon.diagnose.result import (
    MAX_UNEXPLAINED_SHARE,
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

MAX_ERROR_OVER_FLOOR = 3.0
"""Ratio of a speed's or current's error to its noise floor above which the unexplained rest is large. A
position's error grows with every disturbance, so for it only the share counts."""
MIN_RIVAL_COSINE = 0.95
"""Cosine of the changes by two causes above which the data do not distinguish them."""
MAX_RIVAL_ERROR_RATIO = 1.1
"""Largest ratio of held-out errors at which another cause predicts equally well."""
EQUIVALENT_CAUSES = {
    "drive.slope": "friction.direction_dependent",
    "friction.direction_dependent": "drive.slope",
}
"""Causes that are the same term of the equations while the axis moves and has dry friction."""
INVISIBLE_CAUSES = {
    "battery.internal_resistance": "not visible: battery.voltage is missing, or a current",
    "motor.heating": "not visible: that takes minutes of load and a current",
    "drive.backlash": "not visible: one sensor before or after the gear sees no play",
}


@dataclass(frozen=True, slots=True)
class AxisName:
    """Names of an axis. where: place of its causes in the contract. text: for people."""

    where: str | None
    text: str


def diagnose_axis(columns: Columns, port: int, name: AxisName, holdout: Columns | None = None) -> Diagnosis:
    """Diagnose the axis at motor `port`.

    Raises TraceError if the recording lacks its effort or motion or is too short, and HoldoutError if the
    held-out one does.
    """
    begin = time.perf_counter()
    log = axis_log(columns, port)
    other = None
    if holdout is not None:
        with naming_holdout():
            other = with_channels_of(log, axis_log(holdout, port))
    return _diagnosis(judge_axis(log, other), name, begin)


def _diagnosis(judged: JudgedAxis, name: AxisName, begin: float) -> Diagnosis:
    causes = tuple(_cause(judged, name, index) for index in range(len(judged.causes)))
    channels = _channels(judged)
    remaining_share = _remaining_share(channels[0])
    is_far_from_floor = judged.log.is_speed and any(
        each.rmse_after > MAX_ERROR_OVER_FLOOR * each.noise_floor for each in channels
    )
    dependences = (
        residual_dependence(judged.heldout_data, judged.fit)
        if is_far_from_floor or remaining_share > 0.1
        else ()
    )
    has_large_rest = is_far_from_floor or (remaining_share > MAX_UNEXPLAINED_SHARE and bool(dependences))
    return Diagnosis(
        _verdict(bool(causes), has_large_rest),
        channels,
        causes,
        _rejected(judged, name),
        Unexplained(remaining_share, dependences),
        (),
        time.perf_counter() - begin,
        None,
        _notes(judged),
        _identified(judged),
        (),
        _curves(judged),
    )


def _verdict(has_causes: bool, has_large_rest: bool) -> Verdict:
    if has_causes:
        return Verdict.PARTLY if has_large_rest else Verdict.EXPLAINED
    return Verdict.UNKNOWN if has_large_rest else Verdict.ADEQUATE


def _remaining_share(channel: ChannelResult) -> float:
    """Share of the squared error above the noise floor that remains with the causes."""
    before, after, floor = (
        each**2 for each in (channel.rmse_before, channel.rmse_after, channel.noise_floor)
    )
    return float(np.clip((after - floor) / max(before - floor, 1e-300), 0.0, 1.0))


def _cause(judged: JudgedAxis, axis_name: AxisName, index: int) -> CauseResult:
    tried = judged.causes[index]
    values, stds = judged.final_fit.values, judged.final_fit.stds()
    parameters = {
        name: ParameterResult(
            values[number.name], _std(number.name, stds, judged.log), unit_of(number.name, judged.log), 0.0
        )
        for number, name in zip(tried.cause.parameters, tried.cause.contract_names, strict=True)
    }
    without, after = judged.errors_without[index], combined_error(judged.after, judged.floor)
    removable = max(combined_error(judged.before, judged.floor) - min(after, 1.0), 1e-300)
    share = float(np.clip((without - after) / removable, 0.0, 1.0))
    rivals = _rivals(judged, tried)
    return CauseResult(
        tried.cause.id,
        axis_name.where,
        index + 1,
        parameters,
        Gain(without, after, share),
        _probability(tried, sum(rivals.values())),
        tuple(rivals),
        axis_sentence(tried.cause.id, axis_name.text, parameters, tried.cause.parameters[0].name),
    )


def _std(name: str, stds: Mapping[str, float], log: AxisLog) -> float:
    """Standard deviation of a parameter; that of a latency includes the sample period, uniformly
    distributed."""
    return math.hypot(stds[name], log.step / math.sqrt(12.0)) if name == "latency" else stds[name]


def _probability(tried: TriedCause, odds: float) -> float:
    """Probability of the cause, given its evidence and the summed odds of its rivals."""
    return 1.0 / (1.0 + odds + math.exp(-min(tried.evidence / 2.0, 30.0)))


def _rivals(judged: JudgedAxis, tried: TriedCause) -> dict[str, float]:
    """Causes that are indistinguishable from this one, with their odds against it.

    These are the candidates of the same search step with about as much evidence, the same direction of change
    and as good a held-out prediction; and the cause that is the same term of the equations while the axis
    moves.
    """
    limit = MAX_RIVAL_ERROR_RATIO * combined_error(judged.after, judged.floor)
    found = {
        each.cause.id: math.exp(min(0.5 * (each.evidence - tried.evidence), 30.0))
        for each in sorted(tried.rivals, key=lambda each: each.evidence)
        if each.evidence > tried.evidence - MAX_TIE
        and cause_similarity(tried.fit, tried.cause, each.fit, each.cause) > MIN_RIVAL_COSINE
        and error_with_rival(judged, each, replaced=tried) < limit
    }
    equivalent = EQUIVALENT_CAUSES.get(tried.cause.id)
    if equivalent is not None and equivalent not in found and error_with_equivalent(judged) < limit:
        found[equivalent] = 1.0
    return found


def _channels(judged: JudgedAxis) -> tuple[ChannelResult, ...]:
    found = []
    units = (judged.log.motion_unit, "A")
    motion, current = model_errors(judged.heldout_data, judged.fit)
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
                float(whiteness_p_values(column)[0]),
            )
        )
    return tuple(found)


def _rejected(judged: JudgedAxis, axis_name: AxisName) -> tuple[Rejected, ...]:
    suffix = "" if axis_name.where is None else f"@{axis_name.where}"
    named = {each.cause.id for each in judged.causes}
    found = [
        Rejected(each.cause.id + suffix, "it improves the fit but not the prediction of held-out data")
        for each in judged.unhelpful
    ]
    judged_ids = named | {each.cause.id for each in judged.unhelpful}
    # If an effect has two candidates, the one with more evidence comes last and is kept.
    tried = {each.cause.id: each for each in sorted(judged.search.tried, key=lambda each: each.evidence)}
    found += [
        Rejected(each.cause.id + suffix, _rejection_reason(each))
        for each in judged.search.tried
        if each.cause.id not in judged_ids and tried[each.cause.id] is each
    ]
    return (*found, *(Rejected(id_, reason) for id_, reason in INVISIBLE_CAUSES.items()))


def _rejection_reason(tried: TriedCause) -> str:
    if tried.evidence <= 0.0:
        return f"the data do not support it (evidence {tried.evidence:.1f}; 10 is needed)"
    if tried.left_out_gain <= 0.0:
        return f"it makes the blocks left out of the fit worse (evidence {tried.evidence:.1f})"
    return (
        f"too little evidence ({tried.evidence:.1f}, and {tried.left_out_gain:.1f} on blocks left out; "
        "10 and 6 are needed)"
    )


def _identified(judged: JudgedAxis) -> Mapping[str, ParameterResult]:
    values, stds = judged.final_fit.values, judged.final_fit.stds()
    return {
        _contract_name(each.name, judged.log): ParameterResult(
            values[each.name], stds[each.name], unit_of(each.name, judged.log), math.nan
        )
        for each in judged.search.base.parameters
        if not each.is_at_bound(values[each.name])
    }


def _contract_name(number: str, log: AxisLog) -> str:
    return "electrical_lag" if number == "inductance" and not log.is_electrical else number


def _notes(judged: JudgedAxis) -> tuple[str, ...]:
    log = judged.log
    notes = []
    if not log.is_speed:
        seconds = (judged.data.stretches.count - 1) * judged.data.stretches.every * log.step
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
        f"{_contract_name(each.name, log)} ends at {value:.2g} {unit_of(each.name, log)}, the "
        f"{'smallest' if value <= BOUND_TOLERANCE * each.low else 'largest'} that is tried: this recording "
        "does not determine it"
        for each, value in (
            (each, judged.final_fit.values[each.name]) for each in judged.final_fit.parameters
        )
        if each.is_at_bound(value)
    ]
    return tuple(notes)


def _curves(judged: JudgedAxis) -> tuple[Curve, ...]:
    unseen = judged.heldout_data
    rows = unseen.stretches.rows().T.ravel()
    measured = unseen.stretches.measured.T.ravel()
    before, after = (model_errors(unseen, each)[0].T.ravel() for each in (judged.search.base, judged.fit))
    if not judged.log.is_speed:
        # Errors in millimetres are invisible beside a motion in centimetres: the errors themselves are drawn.
        name = f"error of {judged.log.names[1]}"
        return (Curve(name, judged.log.motion_unit, unseen.log.time[rows], 0.0 * before, before, after),)
    return (
        Curve(
            judged.log.names[1], judged.log.motion_unit, unseen.log.time[rows], measured, measured + before,
            measured + after,
        ),
    )  # fmt: skip
