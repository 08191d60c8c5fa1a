"""Report of a diagnosis as text for a terminal."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping

from raccoon.diagnose.fleet.other_robots import ROBOT_TOML_QUESTION, far_constants_text
from raccoon.diagnose.hypotheses.cause_catalogue import TURN_SCALE_CAUSES
from raccoon.diagnose.reports.headline import other_robot_question, verdict_text, visible_sizes_text
from raccoon.diagnose.reports.numbers import parameter_text
from raccoon.diagnose.reports.plain_names import capitalise
from raccoon.diagnose.reports.similar_causes import similar_size_text
from raccoon.diagnose.reports.unknown_text import depends_text, shape_text
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Curve,
    Diagnosis,
    ParameterResult,
    Unexplained,
    Verdict,
)

MAX_NOT_WHITE_P = 0.01
"""Largest p-value of the whiteness test for which a channel's residual is reported as not white."""
MIN_FAR_OFF_RATIO = 1.5
"""Least ratio of error to noise for which the report says when a channel's error is largest."""
MAX_COMPENSATED_RATIO = 1.05
"""Largest ratio of the error without a cause to the error with it at which the other causes compensate for
it."""
NOT_SHOWN_PREFIX, NOT_IDENTIFIABLE_PREFIX = "not ", "not identifiable: "
"""Beginning of the reasons of causes that this recording cannot show at all, and of most of these."""
TOLERANCES = "the tolerances in robot.toml"
MAX_ABSORBED_CHANGE = 0.02
"""Largest change by a cause beyond robot.toml's tolerances, over the noise, at which these absorb nearly all
of it."""
MAX_NO_GAIN_RATIO = 1.005
"""Largest ratio of the error without a cause to the error with it at which held-out data does not show the
cause."""
NO_GAIN_TEXT = (
    "without it, the held-out data (the last 30 %, or --holdout) are predicted as well: confirm it in a "
    "second recording before you change the robot"
)
"""Text for such a cause. Its probability refers to the whole recording."""
RECORD_AGAIN_ADVICE = (
    "drive the checkup and diagnose that (raccoon excite --record again.jsonl.gz; a single motor or axis: "
    "steps and reversals at several speeds); if that is unknown as well, compare ports, signs and units in "
    "robot.toml with the robot"
)
"""Advice if nothing is known of what is wrong."""
_VISIBLE_SIZE = re.compile(r"; would show from about .*")
_IMPOSSIBLE_SIZE = re.compile(r"; would show from about (?:\d{4,}|[\d.]+e\+\d\d)\b.*")
"""A size of a thousand and more, which no robot has: it only says that the cause would not show."""


def terminal_report(diagnosis: Diagnosis) -> str:
    """The report: plain sentences, the numbers behind them, and what to do next."""
    return "\n".join(_lines(diagnosis))


def _lines(diagnosis: Diagnosis) -> Iterator[str]:
    if asked := other_robot_question(diagnosis):
        yield asked
    yield verdict_text(diagnosis)
    for cause in diagnosis.causes:
        yield from _cause_lines(cause, diagnosis)
    if diagnosis.unexplained.depends_on:
        depends_on = depends_text(diagnosis.unexplained.depends_on)
        yield f"  ? {unexplained_share_text(diagnosis.unexplained)}: {depends_on}."
    for shape in diagnosis.shapes:
        yield f"       {shape_text(shape)}"
    for fault in diagnosis.sensor_faults:
        yield f"  ! {fault.kind}: {fault.text}."
    if seen := visible_sizes_text(diagnosis):
        yield f"  {seen}"
    yield from _identified_lines(diagnosis.identified)
    if diagnosis.channels:
        yield ""
        yield "Error on data that was not fitted (before -> after, noise floor):"
    for each in diagnosis.channels:
        numbers = f"{each.rmse_before:9.4g} -> {each.rmse_after:9.4g}   ({each.noise_floor:.4g} {each.unit})"
        yield f"  {each.name:18s} {numbers}{_worst_time_text(diagnosis, each)}"
    if any(reason.startswith(NOT_SHOWN_PREFIX) for reason in reasons_not_named(diagnosis)):
        yield ""
        yield "What this recording cannot show:"
    for reason, ids in reasons_not_named(diagnosis).items():
        if reason.startswith(NOT_SHOWN_PREFIX):
            yield f"  {', '.join(ids)}: {reason}"
    yield ""
    for text in next_recording_advice(diagnosis):
        yield f"To learn more: {text}."
    for text in unrepeated_notes(diagnosis):
        yield f"Note: {text}" if text.endswith("?") else f"Note: {text}."
    yield f"(The diagnosis took {diagnosis.seconds:.1f} s.)"


def unrepeated_notes(diagnosis: Diagnosis) -> list[str]:
    """The notes that are not already listed under what the recording cannot show, or asked at first."""
    said = {
        each.removeprefix(NOT_IDENTIFIABLE_PREFIX)
        for each in reasons_not_named(diagnosis)
        if each.startswith(NOT_SHOWN_PREFIX)
    }
    lists = tuple(f"not checked, since {each}: " for each in said)  # these list the same causes
    asked, is_far = other_robot_question(diagnosis), far_constants_text(diagnosis) != ""
    return [
        each
        for each in diagnosis.notes
        if each.removeprefix(NOT_IDENTIFIABLE_PREFIX) not in said
        and not each.startswith(lists)
        and not (is_far and each.endswith(ROBOT_TOML_QUESTION))
        and capitalise(each) != asked
    ]


def unexplained_share_text(unexplained: Unexplained) -> str:
    """Text of the share of the held-out error's power that no cause describes, omitted if it rounds to 0
    %."""
    share = round(100 * unexplained.share)
    if share == 0:
        return "The remaining error depends on"
    return f"{share} % of the error's power remains; it depends on"


def channel_residual_text(diagnosis: Diagnosis, channel: ChannelResult) -> str:
    """A channel's residual in a few words (whiteness, time of the largest error); "" without a time
    course."""
    if _curve_of(diagnosis, channel) is None:
        return ""
    if math.isnan(channel.whiteness_p):
        return _worst_time_text(diagnosis, channel).removeprefix(", ")
    white = "white" if channel.whiteness_p > MAX_NOT_WHITE_P else "not white"
    return f"{white} (p {channel.whiteness_p:.2g}){_worst_time_text(diagnosis, channel)}"


def _worst_time_text(diagnosis: Diagnosis, channel: ChannelResult) -> str:
    """Text of the time at which a channel's error is largest, if it is clearly above the noise."""
    curve = _curve_of(diagnosis, channel)
    if curve is None or channel.rmse_after < MIN_FAR_OFF_RATIO * channel.noise_floor:
        return ""
    return f", largest error around {curve.worst:.1f} s"


def _curve_of(diagnosis: Diagnosis, channel: ChannelResult) -> Curve | None:
    return next((each for each in diagnosis.curves if each.name == channel.name and len(each.time)), None)


def reasons_not_named(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Causes that were not named, grouped by reason. The sizes above which they would show are omitted if the
    simulation does not follow the recording, where they mean nothing."""
    sizes = _VISIBLE_SIZE if _is_nothing_known(diagnosis) else _IMPOSSIBLE_SIZE
    found: dict[str, list[str]] = defaultdict(list)
    for each in diagnosis.rejected:
        found[sizes.sub("", each.reason)].append(each.id)
    return dict(found)


def next_recording_advice(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Advice on the next recording, without what a note already says. If the simulation does not follow the
    recording at all, a drive that would show one more cause does not help."""
    if _is_nothing_known(diagnosis):
        return (RECORD_AGAIN_ADVICE,)
    return tuple(each for each in diagnosis.suggested_manoeuvres if each not in diagnosis.notes)


def _is_nothing_known(diagnosis: Diagnosis) -> bool:
    """Whether something is wrong and nothing at all is known about it."""
    known = diagnosis.causes or diagnosis.shapes or diagnosis.unexplained.depends_on
    return diagnosis.verdict is Verdict.UNKNOWN and not known


def _identified_lines(numbers: Mapping[str, ParameterResult]) -> Iterator[str]:
    if numbers:
        yield ""
        yield "Also measured:"
    for name, each in numbers.items():
        known = each.nominal == each.nominal and each.nominal != 0.0
        assumed = f" (assumed {each.nominal:.4g})" if known else ""
        yield f"  {name:26s} {parameter_text(each)}{assumed}"


def compensation_text(cause: CauseResult, diagnosis: Diagnosis) -> str:
    """Text for a cause without which the held-out error is hardly larger: one that the reference shows, or
    the first-ranked one, for which the others would compensate; "" otherwise."""
    first = cause.rank == 1 and len(diagnosis.causes) > 1
    without, after = cause.gain.heldout_rmse_before, cause.gain.heldout_rmse_after
    referred = any(name.endswith(" by the reference") for name in diagnosis.identified)
    if referred and cause.id in TURN_SCALE_CAUSES and without < MAX_COMPENSATED_RATIO * after:
        return "the reference of the pose shows it (see 'Also measured'); the sensors' errors hardly do"
    alike = (
        without != after and without < MAX_COMPENSATED_RATIO * after
    )  # a cause that is noise does not lower the error
    return "without it, the other causes would compensate for it" if first and alike else ""


def change_text(cause: CauseResult, diagnosis: Diagnosis) -> str:
    """How much a cause changes the readings, whether it is negligible, and for the first-ranked one the
    causes of similar size; "" if it is not a cause of a drive."""
    if not math.isfinite(cause.change):
        return ""
    why = f", {cause.negligible_reason}" if cause.negligible_reason else ""
    little = f"real, but too small to matter{why}: it " if cause.is_negligible else ""
    most = f"changes the most affected reading by {_factor_text(cause.change)} its noise"
    if cause.unabsorbed < MAX_ABSORBED_CHANGE:
        return f"{little}{most}; {TOLERANCES} could explain nearly all of that"
    alike = similar_size_text(cause, diagnosis.causes)
    size = _factor_text(cause.unabsorbed)
    beyond = f"and all readings by {size} the noise beyond what {TOLERANCES} explain"
    return ", ".join([f"{little}{most}", beyond, *([alike] if alike else [])])


def _factor_text(number: float) -> str:
    """A factor with two significant digits, without an exponent."""
    return f"{number:.0f} times" if number >= 99.5 else f"{number:.2g} times"


def evidence_text(cause: CauseResult) -> str:
    """The held-out evidence for a cause."""
    without, after = cause.gain.heldout_rmse_before, cause.gain.heldout_rmse_after
    if cause.id.endswith(".noise"):
        return f"no simulation can predict it: the error on unseen data is {after:.2f} times the noise"
    if without < MAX_NO_GAIN_RATIO * after:
        return NO_GAIN_TEXT
    return f"error on unseen data {without:.2f} times the noise without it, {after:.2f} with it"


def probability_text(cause: CauseResult) -> str:
    """The probability of a cause, and of what exactly: that it is this cause, possibly beside others that
    share its effect."""
    parts = f", alone or with {' or '.join(cause.beside)} beside it" if cause.beside else ""
    none = " and none of the others" if set(cause.confounded_with) - set(cause.beside) else ""
    those = f" that it is {cause.name}{parts}{',' if parts and none else ''}{none}" if parts or none else ""
    return f"probability {cause.probability:.2f}{those}"


def _cause_lines(cause: CauseResult, diagnosis: Diagnosis) -> Iterator[str]:
    yield f"  {cause.rank}. {_cause_sentence(cause)}"
    for name, each in cause.parameters.items():
        yield f"       {name} {parameter_text(each)} (assumed {each.nominal:.4g})"
    if change := change_text(cause, diagnosis):
        yield f"       {change}"
    if not cause.is_negligible:  # where a negligible cause shows is irrelevant
        yield f"       {compensation_text(cause, diagnosis) or evidence_text(cause)}"
    yield f"       {probability_text(cause)}"


def _cause_sentence(cause: CauseResult) -> str:
    """The sentence of a cause; with indistinguishable rivals all of them, and the sentence conditional on
    this cause."""
    if not cause.confounded_with:
        return cause.explanation
    *first, last = (cause.name, *cause.confounded_with)
    said = cause.explanation[0].lower() + cause.explanation[1:]
    some = " or some of each" if cause.beside else ""
    return (
        f"One of these{some}, which cannot be told apart here: {', '.join(first)} or {last}. "
        f"If it is {cause.name}, {said}"
    )
