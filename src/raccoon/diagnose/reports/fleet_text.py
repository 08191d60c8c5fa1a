"""Text report of many diagnoses: a line for each recording, what they have in common, and what changed."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from raccoon.diagnose.fleet.change_points import MIN_NUMBERS
from raccoon.diagnose.fleet.common_model import CrossCheck
from raccoon.diagnose.fleet.series import Course
from raccoon.diagnose.fleet.summary import Fleet, FleetCause, FleetNumber
from raccoon.diagnose.reports.change_reasons import CREEP_REASONS, JUMP_REASONS, RECURRENCE_REASONS
from raccoon.diagnose.reports.headline import reason_it_cannot_tell
from raccoon.diagnose.reports.numbers import format_two_digits
from raccoon.diagnose.reports.plain_names import capitalise, name_with_id, plain_name, plain_names
from raccoon.diagnose.reports.unknown_text import depends_text
from raccoon.diagnose.result import Diagnosis, Verdict

CHANGES_TITLE = "What changed, in the order of the recordings above"
TOO_SMALL = " (too small to matter)"
MAX_NAMES = 4
MIN_RECURRING = 3
"""Least number of recordings with a cause that may be reported to come and go."""
_NUMBER = re.compile(
    r"(?<![\w./-])(?<!motor )(?<!port )(?<!tophat )[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?![\w/]|[.-]\w)"
)
"""A number of a note, which may differ between recordings that share the note. Digits of a name are none:
motor.0.bemf, port 2, a date, or a file such as run3.csv."""

MAX_NOTES = 8
"""Largest number of notes that a fleet's report prints; the JSON has all."""


def fleet_report(fleet: Fleet, seen: Mapping[str, CrossCheck] | None = None) -> str:
    """A line for each recording, then common causes with their spread, outliers, and changes. seen: cross
    check of each recording with the model of the others, if made."""
    results = fleet.results
    lines = [
        f"{name}{robot_suffix(fleet, name)}: {verdict_words(each)}: {findings_text(each)}"
        for name, each in results.items()
    ]
    lines += ["", *(_cause_line(each, fleet) for each in fleet.causes)] if fleet.causes else []
    if fleet.numbers:
        lines += ["", "Also measured (median +- spread of the recordings):"]
        lines += [_number_line(each, len(results)) for each in fleet.numbers]
    changes = change_lines(fleet)
    if changes:
        lines += ["", f"{CHANGES_TITLE}:", *(f"  {each}" for each in changes)]
    elif len(results) > 1 and fleet.causes and most_recordings_of_a_robot(fleet) < MIN_NUMBERS:
        of_one = " of one robot" if len(fleet.names) > 1 else ""
        lines += ["", f"To see what changed and when, at least {MIN_NUMBERS} recordings{of_one} are needed."]
    if seen:
        lines += [
            "",
            CROSS_CHECK_TITLE,
            *(f"  {name}: {cross_check_text(each)}" for name, each in seen.items()),
        ]
    notes = note_lines(results)
    lines += ["", *(f"Note: {each}" for each in notes[:MAX_NOTES])] if notes else []
    if len(notes) > MAX_NOTES:
        lines.append(f"and {len(notes) - MAX_NOTES} more notes: --json writes all of them")
    return "\n".join(lines)


CROSS_CHECK_TITLE = (
    "With the common model of the other recordings. Error on unseen data in units of the noise: robot.toml's "
    "model -> common model (own model): what is still wrong"
)


def cross_check_text(each: CrossCheck) -> str:
    """The errors of a cross check, and the causes that remain."""
    return f"{each.before:.2f} -> {each.after:.2f} ({each.own:.2f}): {plain_names(each.still) or 'nothing'}"


def robot_suffix(fleet: Fleet, name: str) -> str:
    """The robot of a recording in parentheses, if there are several and its name does not contain it."""
    robot = fleet.robots[name]
    return "" if len(fleet.names) == 1 or robot in name else f" ({robot})"


def most_recordings_of_a_robot(fleet: Fleet) -> int:
    """Largest number of recordings of a single robot."""
    return max(Counter(fleet.robots.values()).values())


def findings_text(diagnosis: Diagnosis) -> str:
    """The findings of a recording, or why there can be none."""
    findings = [f"{plain_name(each.name)}{TOO_SMALL * each.is_negligible}" for each in diagnosis.causes]
    findings += [
        f"something that depends on {depends_text([each])}" for each in diagnosis.unexplained.depends_on
    ]
    text = ", ".join(findings)
    if not text and diagnosis.verdict is Verdict.NOT_IDENTIFIABLE:
        text = reason_it_cannot_tell(diagnosis)
    return "; ".join(
        [
            text or "-",
            *(f"{channel}: {', '.join(it)}" for channel, it in _faults_by_channel(diagnosis).items()),
        ]
    )


def _faults_by_channel(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """The faults of each channel."""
    found: dict[str, list[str]] = defaultdict(list)
    for each in diagnosis.sensor_faults:
        found[each.channel].append(each.fault)
    return found


def verdict_words(diagnosis: Diagnosis) -> str:
    """The verdict as words."""
    return str(diagnosis.verdict).replace("_", " ")


def note_lines(results: Mapping[str, Diagnosis]) -> list[str]:
    """Each distinct note with its recordings, and the recordings whose note differs only in numbers. Notes
    that repeat a recording's own line are left out."""
    having: dict[str, dict[str, str]] = defaultdict(dict)
    for name, diagnosis in results.items():
        line = findings_text(diagnosis)
        for note in diagnosis.notes:
            if note.removeprefix("not identifiable: ") not in line:
                having[_NUMBER.sub("#", note)].setdefault(name, note)
    return [_note_line(notes, len(results)) for notes in having.values()]


def _note_line(notes: Mapping[str, str], count: int) -> str:
    """A note and its recordings. notes: by recording, equal except for numbers."""
    text = next(iter(notes.values()))
    same = [name for name, note in notes.items() if note == text]
    others = [name for name in notes if name not in same]
    where = "all" if len(same) == count else shorten_names(same)
    return f"{text} ({where}{f'; with other numbers: {shorten_names(others)}' if others else ''})"


def shorten_names(names: Sequence[str]) -> str:
    """The first MAX_NAMES names, and the number of the others."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def change_lines(fleet: Fleet) -> list[str]:
    """A line for each parameter that jumps or drifts over a robot's recordings."""
    return [
        (f"{course.robot}: " if len(fleet.names) > 1 else "") + _course_line(each, course)
        for each, course in fleet.courses
    ]


def _course_line(each: FleetCause | FleetNumber, course: Course) -> str:
    """A parameter's name, its course, and possible reasons. The name includes all causes that cannot be
    distinguished, since it is only known that one of them changes."""
    rivals = each.rivals if isinstance(each, FleetCause) else ()
    plain = capitalise(plain_name(each.name))
    name = f"{plain} (or {plain_names(rivals)})" if rivals else plain
    first, *others = course.pieces
    goes = f"creeps from {first.start:.4g} to {first.end:.4g}" if first.creeps else ""
    for piece in others:
        begin = f"{goes}, jumps" if first.creeps and piece is others[0] else f"{goes}, and"
        goes = begin if goes else f"jumps from {first.end:.4g}"
        goes += f" to {piece.start:.4g} with {course.recordings[piece.first]}"
        goes += f" and creeps to {piece.end:.4g}" if piece.creeps else ""
    if not others:
        goes += " over the recordings"
    unit = f" in {each.unit}" if each.unit else ""
    kinds = [CREEP_REASONS] * first.creeps + [JUMP_REASONS] * bool(others)
    id_ = each.name.partition("@")[0]
    behind = "; ".join(dict.fromkeys(it[id_] for it in kinds if id_ in it))
    return f"{name}{unit} {goes}{f' ({behind}?)' if behind else ''}"


def _cause_line(each: FleetCause, fleet: Fleet) -> str:
    count = len(fleet.results)
    low, high = (f"{end(each.values):.4g}" for end in (min, max))
    size = low if low == high else f"{low} to {high}"
    odd = outliers_text(each)
    unit = f" {each.unit}" if each.unit else ""
    alike = f"; not distinguishable from {plain_names(each.rivals)}" if each.rivals else ""
    share = f"{100 * each.share:.0f} %"
    if each.telling < count:
        share += f" of {each.telling} that can tell"
    odd = f"; far from the others: {odd}" if odd else ""
    name = name_with_id(each.name)
    line = f"{name}: {share} ({kind_with_reason_text(each, fleet)}), {size}{unit}{odd}{alike}"
    return "\n  ".join((line, *explanation_lines(each, fleet)))


def explanation_lines(each: FleetCause, fleet: Fleet) -> list[str]:
    """What a cause means and what to do about it, as in the recording with the median value since the last
    change; if some values are below the assumed one and some above, one recording of either."""
    lower, higher = each.standing.lower, each.standing.higher
    agreed = each.common or (each.alike and each.of_robots == 1)
    sides = [max(lower, higher, key=len)] if agreed else [it for it in (lower, higher) if it]
    values = dict(zip(each.recordings, each.values, strict=True))
    found = []
    for side in sides:
        middle = sorted(side, key=values.__getitem__)[(len(side) - 1) // 2]
        said = next(it.explanation for it in fleet.results[middle].causes if it.name == each.name)
        found.append(f"{middle}: {said}" if len(each.recordings) > 1 else said)
    return found


def count_text(each: FleetCause) -> str:
    """Number of recordings that name it out of those that can tell, including those with another unit."""
    return f"{round(each.share * each.telling)} of {each.telling}"


def kind_text(each: FleetCause, fleet: Fleet, named: int | None = None) -> str:
    """Whether a cause is common, since or until when, of which robots, or of which recordings; of more than
    `named` recordings only their number."""
    standing = each.standing
    many = named is not None and len(each.recordings) > named
    if each.instead:
        where = f"{count_text(each)} recordings" if many else shorten_names(each.recordings)
        return f"instead of {plain_name(each.instead)} in {where}"
    if standing.since or standing.until:
        return _since_when(each, fleet)
    if each.common:
        return "common" if each.of_robots < 2 else f"common to {each.alike} of {each.of_robots} robots"
    apart = len(fleet.names) > 1 and 0 < len(each.robots) < len(each.recordings)
    if apart and all(fleet.robots[name] in each.robots for name in each.recordings):
        return (
            f"only robot {each.robots[0]}"
            if len(each.robots) == 1
            else f"robots {shorten_names(each.robots)}"
        )
    if standing.lower and standing.higher and not each.alike:
        return f"lower than assumed in {len(standing.lower)}, higher in {len(standing.higher)}"
    if many:
        return f"{count_text(each)} recordings"
    few = len(each.recordings) <= max(1, len(fleet.results) // 5)
    return ("only " if few else "some: ") + shorten_names(each.recordings)


def _since_when(each: FleetCause, fleet: Fleet) -> str:
    """The recording since or until which a cause is present, "mostly" if some others have it as well."""
    standing, names = each.standing, [*fleet.results]
    at = names.index(standing.since) if standing.since else names.index(standing.until) + 1
    others = names[:at] if standing.since else names[at:]
    mostly = "" if {*others}.isdisjoint(each.recordings) else "mostly "
    return f"{mostly}since {standing.since}" if standing.since else f"{mostly}until {standing.until}"


def kind_with_reason_text(each: FleetCause, fleet: Fleet) -> str:
    """`kind_text`, with the possible reasons of a cause that comes and goes."""
    steady = each.alike or each.series.courses or len(each.recordings) < MIN_RECURRING
    behind = "" if steady else RECURRENCE_REASONS.get(each.name.partition("@")[0], "")
    return f"{kind_text(each, fleet)}; {behind}?" if behind else kind_text(each, fleet)


def _number_line(each: FleetNumber, count: int) -> str:
    far = outliers_text(each)
    odd = f"; far from the others: {far}" if far else ""
    part = "" if len(each.recordings) == count else f"; in {len(each.recordings)} of {count}"
    usual = f"{typical_value_text(each):>10s} +- {format_two_digits(each.series.spread)} {each.unit}"
    return f"  {each.name:28s} {usual}{part}{odd}"


def outliers_text(each: FleetCause | FleetNumber) -> str:
    """Recordings and robots whose value is an outlier."""
    return shorten_names(each.series.outliers)


def typical_value_text(each: FleetNumber) -> str:
    """The median; for a number that changed, its first and last values; for several robots with several
    recordings, the range of their medians."""
    levels, courses = each.series.levels, each.series.courses
    if 1 < len(levels) < len(each.recordings):
        return f"{min(levels.values()):.4g} to {max(levels.values()):.4g}"
    if not courses:
        return f"{each.median:.4g}"
    return f"{courses[0].pieces[0].start:.4g} -> {courses[0].pieces[-1].end:.4g}"
