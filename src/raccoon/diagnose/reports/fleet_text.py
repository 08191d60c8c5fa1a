"""Many diagnoses as text: a line a recording, what they have in common, and what changed."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from raccoon.diagnose.fleet.change_points import MIN_NUMBERS
from raccoon.diagnose.fleet.common_model import CrossCheck
from raccoon.diagnose.fleet.series import Course
from raccoon.diagnose.fleet.summary import Fleet, FleetCause, FleetNumber
from raccoon.diagnose.reports.headline import reason_it_cannot_tell
from raccoon.diagnose.reports.numbers import format_two_digits
from raccoon.diagnose.reports.unknown_text import depends_text
from raccoon.diagnose.result import Diagnosis, Verdict

CREEP_REASONS: Mapping[str, str] = {
    "battery.internal_resistance": "a battery ages",
    "battery.open_circuit_voltage": "a battery runs down",
    "motor.back_emf_constant": "its magnets weaken",
    "motor.armature_resistance": "its brushes wear",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "its tyre wears",
    "drive.backlash": "gears wear",
    "tophat.gain": "dirt gathers on it",
    "tophat.height": "its mount comes loose",
}
"""What may be behind a number that creeps, by cause."""
JUMP_REASONS: Mapping[str, str] = {
    "battery.internal_resistance": "another battery, or its contacts",
    "battery.open_circuit_voltage": "another charge, or another battery",
    "motor.back_emf_constant": "a motor was replaced",
    "motor.armature_resistance": "a motor was replaced",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "a wheel was replaced",
    "drive.backlash": "gears were replaced",
    "tophat.ambient_light": "another room, or other lamps",
    "tophat.gain": "another sensor, or dirt on it",
    "tophat.height": "its mount slipped",
    "tophat.noise": "its plug came loose",
}
"""The same of one that jumps."""
RECURRENCE_REASONS: Mapping[str, str] = {
    "battery.open_circuit_voltage": "another charge each time",
    "battery.internal_resistance": "several batteries in turn",
    "drive.slope": "other tables, or other directions",
    "friction.coulomb": "other floors",
}
"""The same of one that some recordings have and others not, in no order."""
CHANGES_TITLE = "What changed, in the order of the recordings above"
MAX_NAMES = 4
MIN_RECURRING = 3
"""Recordings with a cause from which it may be said to come and go."""
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")

MAX_NOTES = 8
"""Notes of which a fleet's report has the text; the JSON has all."""


def fleet_report(fleet: Fleet, seen: Mapping[str, CrossCheck] | None = None) -> str:
    """A line a recording, then common causes with their spread, the odd ones out, and what changed. seen:
    each recording with the model of the others, where one was made."""
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
    """The errors of a cross check, and what is still wrong."""
    return f"{each.before:.2f} -> {each.after:.2f} ({each.own:.2f}): {', '.join(each.still) or 'nothing'}"


def robot_suffix(fleet: Fleet, name: str) -> str:
    """The robot of a recording in brackets, where there are several and its name does not say it."""
    robot = fleet.robots[name]
    return "" if len(fleet.names) == 1 or robot in name else f" ({robot})"


def most_recordings_of_a_robot(fleet: Fleet) -> int:
    """How many recordings there are of the robot that has most."""
    return max(Counter(fleet.robots.values()).values())


def findings_text(diagnosis: Diagnosis) -> str:
    """What was found in a recording, or why nothing can be."""
    findings = [each.name for each in diagnosis.causes]
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
    """Each note once, with the recordings that have it; with those of other numbers, the first of these.
    What a recording's own line says is left out."""
    having: dict[str, dict[str, str]] = defaultdict(dict)
    for name, diagnosis in results.items():
        line = findings_text(diagnosis)
        for note in diagnosis.notes:
            if note.removeprefix("not identifiable: ") not in line:
                having[_NUMBER.sub("#", note)].setdefault(name, note)
    return [_note_line(notes, len(results)) for notes in having.values()]


def _note_line(notes: Mapping[str, str], count: int) -> str:
    """notes: by recording, alike but for numbers."""
    text = next(iter(notes.values()))
    same = [name for name, note in notes.items() if note == text]
    others = [name for name in notes if name not in same]
    where = "all" if len(same) == count else shorten_names(same)
    return f"{text} ({where}{f'; with other numbers: {shorten_names(others)}' if others else ''})"


def shorten_names(names: Sequence[str]) -> str:
    """The first of many names, and how many more there are: the JSON has all."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def change_lines(fleet: Fleet) -> list[str]:
    """A line for everything that jumps or creeps in the order of a robot's recordings."""
    return [
        (f"{course.robot}: " if len(fleet.names) > 1 else "") + _course_line(each, course)
        for each, course in fleet.courses
    ]


def _course_line(each: FleetCause | FleetNumber, course: Course) -> str:
    """Its name, with those of what may be it, since what changes is known then, and not which of them it is;
    then how it goes, and what may be behind it."""
    rivals = each.rivals if isinstance(each, FleetCause) else ()
    name = f"{each.name} (or {', '.join(rivals)})" if rivals else each.name
    first, *others = course.pieces
    goes = f"creeps from {first.start:.4g} to {first.end:.4g}" if first.creeps else ""
    for piece in others:
        begin = f"{goes}, jumps" if first.creeps and piece is others[0] else f"{goes}, and"
        goes = begin if goes else f"jumps from {first.end:.4g}"
        goes += f" to {piece.start:.4g} with {course.recordings[piece.first]}"
        goes += f" and creeps to {piece.end:.4g}" if piece.creeps else ""
    if not others:
        goes += " over the recordings"
    unit = f" ({each.unit})" if each.unit else ""
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
    alike = f"; not told from {', '.join(each.rivals)}" if each.rivals else ""
    share = f"{100 * each.share:.0f} %"
    if each.telling < count:
        share += f" of {each.telling} that can tell"
    odd = f"; far from the others: {odd}" if odd else ""
    line = f"{each.name}: {share} ({kind_with_reason_text(each, fleet)}), {size}{unit}{odd}{alike}"
    return "\n  ".join((line, *explanation_lines(each, fleet)))


def explanation_lines(each: FleetCause, fleet: Fleet) -> list[str]:
    """What a cause means and what to do about it, as it is now: as the recording has it whose number is in
    the middle, or of what is too small in some and too large in others one of either."""
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
    """How many name it of those that can tell, also those whose number is in another unit."""
    return f"{round(each.share * each.telling)} of {each.telling}"


def kind_text(each: FleetCause, fleet: Fleet, named: int | None = None) -> str:
    """Whether a cause is common, since or until when it was, or one robot's, or of single recordings: of more
    than `named` how many."""
    standing = each.standing
    if each.instead:
        return f"in the place of {each.instead}"
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
    if named is not None and len(each.recordings) > named:
        return f"{count_text(each)} recordings"
    few = len(each.recordings) <= max(1, len(fleet.results) // 5)
    return ("only " if few else "some: ") + shorten_names(each.recordings)


def _since_when(each: FleetCause, fleet: Fleet) -> str:
    """From which recording on a cause is there, or up to which it was, and whether some others have it."""
    standing, names = each.standing, [*fleet.results]
    at = names.index(standing.since) if standing.since else names.index(standing.until) + 1
    others = names[:at] if standing.since else names[at:]
    mostly = "" if {*others}.isdisjoint(each.recordings) else "mostly "
    return f"{mostly}since {standing.since}" if standing.since else f"{mostly}until {standing.until}"


def kind_with_reason_text(each: FleetCause, fleet: Fleet) -> str:
    """`kind_text`, with what may be behind it where some recordings have it and others not, in no order."""
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
    """The recordings and robots whose number is far from the others'."""
    return shorten_names(each.series.outliers)


def typical_value_text(each: FleetNumber) -> str:
    """The median; of a number that changed where it began and where it ended, of which it is neither; of
    several robots with some each the lowest and the highest of theirs."""
    levels, courses = each.series.levels, each.series.courses
    if 1 < len(levels) < len(each.recordings):
        return f"{min(levels.values()):.4g} to {max(levels.values()):.4g}"
    if not courses:
        return f"{each.median:.4g}"
    return f"{courses[0].pieces[0].start:.4g} -> {courses[0].pieces[-1].end:.4g}"
