"""Recordings that are silent about a cause: they are evidence neither for nor against it."""

from __future__ import annotations

from raccoon.diagnose.result import Diagnosis, Verdict

CANNOT_TELL_PREFIXES = (
    "not identifiable",
    "not visible",
    "not judged",
    "the recorded motion does not follow",
)
"""Beginnings of the reasons for which a recording is silent about a cause."""


def is_silent(name: str, diagnosis: Diagnosis) -> bool:
    """Whether a recording that does not name a cause is no evidence against it either: it cannot tell (a
    missing channel), is of another kind (of tophats, for a cause of the battery), or names a rival of the
    cause."""
    id_, _, where = name.partition("@")
    judged = [*(each.name for each in diagnosis.causes), *(each.id for each in diagnosis.rejected)]
    if diagnosis.verdict is Verdict.NOT_IDENTIFIABLE or _judged_group(name) not in map(_judged_group, judged):
        return True
    rivals = {
        (rival if "@" in rival or each.where != where else f"{rival}@{where}")
        for each in diagnosis.causes
        for rival in each.confounded_with
    }
    if name in rivals:
        return True
    return any(
        each.reason.startswith(CANNOT_TELL_PREFIXES) and _holds_at_place(each.reason, where)
        for each in diagnosis.rejected
        if each.id in (name, id_) or (each.id.endswith("*") and id_.startswith(each.id[:-1]))
    )


def _judged_group(name: str) -> str:
    """Group of causes that are judged together: battery, motor, drive, or one tophat."""
    id_, _, where = name.partition("@")
    group = id_.partition(".")[0]
    return f"{group}@{where}" if where.isdecimal() else group


def _holds_at_place(reason: str, where: str) -> bool:
    """Whether a reason applies at a place; it may be restricted to one side."""
    begin = "not identifiable at the "
    return not reason.startswith(begin) or reason.startswith(f"{begin}{where}:")
