"""The diagnosis of one motor or axis: force, torque or voltage in, speed or position out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.noise import whiteness
from raccoon.diagnose.recordings.axis_causes import unit_of
from raccoon.diagnose.recordings.axis_judge import JudgedAxis, error_with, judge_axis, model_errors, overall
from raccoon.diagnose.recordings.axis_log import AxisLog, axis_log
from raccoon.diagnose.recordings.axis_rest import depends_on
from raccoon.diagnose.recordings.axis_search import TIE, Tried, alike
from raccoon.diagnose.recordings.axis_words import axis_sentence
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

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

LARGE_REST = 0.3
SAME_DIRECTION = 0.95
AS_GOOD = 1.1
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


def diagnose_axis(
    columns: Columns, port: int, place: Place, holdout: Columns | None = None
) -> tuple[Diagnosis, JudgedAxis]:
    """Name what is wrong with the model of the axis at motor `port`.

    Raises TraceError where the recording does not hold what drives it and how it moves, or is too short.
    """
    begin = time.perf_counter()
    log = axis_log(columns, port)
    other = None if holdout is None else axis_log(holdout, port)
    judged = judge_axis(log, other)
    return _diagnosis(judged, place, begin), judged


def _diagnosis(judged: JudgedAxis, place: Place, begin: float) -> Diagnosis:
    causes = tuple(_cause(judged, place, index) for index in range(len(judged.causes)))
    channels = _channels(judged)
    rest = _rest(channels[0])
    dependence = depends_on(judged.unseen, judged.fit) if rest > 0.1 else ()
    return Diagnosis(
        _verdict(bool(causes), rest, dependence),
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


def _verdict(causes: bool, rest: float, dependence: tuple[str, ...]) -> Verdict:
    large = rest > LARGE_REST
    if causes:
        return Verdict.PARTLY if large and dependence else Verdict.EXPLAINED
    return Verdict.UNKNOWN if large and dependence else Verdict.ADEQUATE


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
        name: ParameterResult(values[number.name], stds[number.name], unit_of(number.name, judged.log), 0.0)
        for number, name in zip(tried.cause.numbers, tried.cause.names, strict=True)
    }
    without, after = judged.without[index], overall(judged.after, judged.floor)
    removable = max(overall(judged.before, judged.floor) - min(after, 1.0), 1e-300)
    share = float(np.clip((without - after) / removable, 0.0, 1.0))
    return CauseResult(
        tried.cause.id,
        place.where,
        index + 1,
        parameters,
        Gain(without, after, share),
        1.0 / (1.0 + math.exp(-min(tried.evidence / 2.0, 30.0))),
        _rivals(judged, tried),
        axis_sentence(tried.cause.id, place.words, parameters),
    )


def _rivals(judged: JudgedAxis, tried: Tried) -> tuple[str, ...]:
    """Candidates with as much evidence at the same step, that move the data in the same direction and
    foresee unseen data as well."""
    return tuple(
        each.cause.id
        for each in tried.rivals
        if each.evidence > tried.evidence - TIE
        and alike(tried.fit, tried.cause, each.fit, each.cause) > SAME_DIRECTION
        and error_with(judged, each, instead_of=tried) < AS_GOOD * overall(judged.after, judged.floor)
    )


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
    found += [
        Rejected(each.cause.id + suffix, _reason(each))
        for each in judged.search.tried
        if each.cause.id not in told
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


__all__ = ["AxisLog", "Place", "diagnose_axis"]
