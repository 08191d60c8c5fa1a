"""Several recordings that may not share a battery: its resistance is each one's own then, and no cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.hypotheses.coordinates import Cause, Settings
from raccoon.diagnose.hypotheses.per_recording import RESISTANCE, resistances
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

DIFFER, DIFFER_OHM = 1.4, 0.015
"""Times the smallest resistance, and ohm beyond it, of the largest, from which they are of several batteries.
Of one battery in three drives of 10 s they were within 1.1."""
TOLD = "the recordings do not share a battery: its resistance is "
OWN = "not judged: the recordings do not share a battery"


def may_differ(found: Diagnosis) -> bool:
    """Whether what was found in several recordings together may be that they have several batteries."""
    named = any(each.id == RESISTANCE[0] for each in found.causes)
    return named or found.verdict in (Verdict.UNKNOWN, Verdict.PARTLY)


def with_own(log: Log) -> Log:
    """The log with a battery for each recording."""
    return replace(log, own_batteries=True)


def without_shared(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The causes that such recordings can have in common."""
    return tuple(each for each in causes if each.id != RESISTANCE[0])


def batteries_told(settings: Settings, log: Log) -> tuple[str, ...]:
    """That the batteries of several recordings differ, where they do and may."""
    if not log.own_batteries:
        return ()
    found = resistances(settings, len(log.runs))
    if max(found) < DIFFER * min(found) or max(found) < min(found) + DIFFER_OHM:
        return ()
    listed = ", ".join(f"{each:.3f} ohm in recording {number}" for number, each in enumerate(found, 1))
    return (f"{TOLD}{listed}; where it is much, take a fresh battery, and clean its contacts",)


def differ(own: Diagnosis) -> bool:
    """Whether the batteries differ in what was found of recordings with batteries of their own."""
    return any(note.startswith(TOLD) for note in own.notes)


def judged_apart(own: Diagnosis) -> Diagnosis:
    """It, with what the recordings do not have in common among what is not named."""
    return replace(own, rejected=(*own.rejected, Rejected(RESISTANCE[0], OWN)))
