"""Many diagnoses as text: a line a recording, what they have in common, and what changed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain

from raccoon.diagnose.fleet import CANNOT_TELL, FleetCause, FleetNumber, fleet_numbers
from raccoon.diagnose.fleet_changes import FEWEST, Change, Form
from raccoon.diagnose.result import Diagnosis, Verdict

WORN: Mapping[str, str] = {
    "battery.internal_resistance": "a battery ages",
    "battery.open_circuit_voltage": "another charge, or another battery",
    "motor.back_emf_constant": "a motor was replaced, or its magnets suffered",
    "motor.armature_resistance": "a motor was replaced, or its brushes wear",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "a wheel was replaced or its tyre wears",
    "drive.backlash": "gears wear",
}
"""What is behind a change, by cause."""
CHANGED = "What changed, in the order of the recordings above"
NAMES_SAID = 4
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")

NOTES_SAID = 8
"""Notes of which a fleet's report has the text; the JSON has all."""


def fleet_report(results: Mapping[str, Diagnosis], causes: Sequence[FleetCause]) -> str:
    """A line a recording, then common causes with their spread, the odd ones out, and what changed."""
    lines = [f"{name}: {each.verdict}: {told(each)}" for name, each in results.items()]
    lines += ["", *(_cause_line(each, len(results)) for each in causes)] if causes else []
    numbers = fleet_numbers(results)
    if numbers:
        lines += ["", "Measured on the way (median, spread of one):"]
        lines += [_number_line(each, len(results)) for each in numbers]
    changes = change_lines(results, causes)
    if changes:
        lines += ["", f"{CHANGED}:", *(f"  {each}" for each in changes)]
    elif 1 < len(results) < FEWEST and causes:
        lines += ["", f"What changed and when is looked for in {FEWEST} recordings and more."]
    notes = note_lines(results)
    lines += ["", *(f"Note: {each}" for each in notes[:NOTES_SAID])] if notes else []
    if len(notes) > NOTES_SAID:
        lines.append(f"and {len(notes) - NOTES_SAID} notes more: --json writes them all")
    return "\n".join(lines)


def told(diagnosis: Diagnosis) -> str:
    """What was found in a recording, or why nothing can be."""
    found = [each.name for each in diagnosis.causes]
    found += [f"something that depends on {each}" for each in diagnosis.unexplained.depends_on]
    said = ", ".join(found)
    if not said and diagnosis.verdict is Verdict.NOT_IDENTIFIABLE:
        said = _why_not(diagnosis)
    broken = "".join(f"; {each.channel}: {each.fault}" for each in diagnosis.sensor_faults)
    return (said or "-") + broken


def _why_not(diagnosis: Diagnosis) -> str:
    reasons = (each.reason for each in diagnosis.rejected if each.reason.startswith(CANNOT_TELL))
    return next(chain(reasons, diagnosis.notes), "").removeprefix("not identifiable: ")


def note_lines(results: Mapping[str, Diagnosis]) -> list[str]:
    """Each note once, with the recordings that have it; with those of other numbers, the first of these.
    What a recording's own line says is left out."""
    having: dict[str, dict[str, str]] = defaultdict(dict)
    for name, diagnosis in results.items():
        line = told(diagnosis)
        for note in diagnosis.notes:
            if note.removeprefix("not identifiable: ") not in line:
                having[_NUMBER.sub("#", note)].setdefault(name, note)
    return [_note_line(notes, len(results)) for notes in having.values()]


def _note_line(notes: Mapping[str, str], count: int) -> str:
    """notes: by recording, alike but for numbers."""
    text = next(iter(notes.values()))
    same = [name for name, note in notes.items() if note == text]
    others = [name for name in notes if name not in same]
    where = "all" if len(same) == count else _shortened(same)
    return f"{text} ({where}{f'; with other numbers: {_shortened(others)}' if others else ''})"


def _shortened(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMES_SAID} more" if len(names) > NAMES_SAID else ""
    return ", ".join(names[:NAMES_SAID]) + more


def change_lines(results: Mapping[str, Diagnosis], causes: Sequence[FleetCause]) -> list[str]:
    """A line for everything that jumps or creeps in the order of the recordings."""
    every: list[FleetCause | FleetNumber] = [*causes, *fleet_numbers(results)]
    names = list(results)
    return [
        _change_line(_one_of(each), each.unit, each.change, WORN.get(each.name.partition("@")[0]), names)
        for each in every
        if each.change
    ]


def _one_of(each: FleetCause | FleetNumber) -> str:
    """Its name, with those of what may be it: what changes is known then, and not which of them it is."""
    rivals = each.rivals if isinstance(each, FleetCause) else ()
    return f"{each.name} (or {', '.join(rivals)})" if rivals else each.name


def _cause_line(each: FleetCause, count: int) -> str:
    if each.common:
        kind = "common"
    elif len(each.recordings) <= max(1, count // 5):
        kind = "only " + ", ".join(each.recordings)
    else:
        kind = "some: " + ", ".join(each.recordings)
    low, high = (f"{end(each.values):.4g}" for end in (min, max))
    size = low if low == high else f"{low} to {high}"
    odd = f"; far from the others: {', '.join(each.outliers)}" if each.outliers else ""
    unit = f" {each.unit}" if each.unit else ""
    alike = f"; not told from {', '.join(each.rivals)}" if each.rivals else ""
    share = f"{100 * each.share:.0f} %"
    if each.telling < count:
        share += f" of {each.telling} that can tell"
    return f"{each.name}: {share} ({kind}), {size}{unit}{odd}{alike}"


def _number_line(each: FleetNumber, count: int) -> str:
    odd = f"; far from the others: {', '.join(each.outliers)}" if each.outliers else ""
    part = "" if len(each.recordings) == count else f"; in {len(each.recordings)} of {count}"
    return f"  {each.name:28s} {usual_text(each):>10s} +- {each.spread:.2g} {each.unit}{part}{odd}"


def usual_text(each: FleetNumber) -> str:
    """The median; of a number that changed the one before and the one after, of which it is neither."""
    if each.change is None:
        return f"{each.median:.4g}"
    return f"{each.change.before:.4g} -> {each.change.after:.4g}"


def _change_line(name: str, unit: str, change: Change, why: str | None, recordings: Sequence[str]) -> str:
    behind = f" ({why}?)" if why else ""
    pair = f"{change.before:.4g} to {change.after:.4g} {unit}".strip()
    if change.form is Form.STEP:
        return f"{name} jumps from {pair} with {recordings[change.first]}{behind}"
    return f"{name} creeps from {pair} over the recordings{behind}"
