"""Several recordings that may not share a battery: its resistance is then fitted for each, and is no
cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.hypotheses.coordinates import Cause, Settings
from raccoon.diagnose.hypotheses.per_recording import BATTERY_RESISTANCE, battery_resistances
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

MIN_RESISTANCE_RATIO, MIN_RESISTANCE_DIFFERENCE_OHM = 1.4, 0.015
"""Ratio and difference (ohm) of the largest to the smallest resistance from which they are those of different
batteries. For one battery in three drives of 10 s the ratio was within 1.1."""
SEPARATE_BATTERIES_NOTE = "the recordings do not share a battery: its resistance is "
NOT_SHARED_REASON = "not judged: the recordings do not share a battery"


def batteries_may_differ(found: Diagnosis) -> bool:
    """Whether the result of several recordings together may be due to different batteries."""
    named = any(each.id == BATTERY_RESISTANCE[0] for each in found.causes)
    return named or found.verdict in (Verdict.UNKNOWN, Verdict.PARTLY)


def with_own_batteries(log: Log) -> Log:
    """The log with a battery for each recording."""
    return replace(log, separate_batteries=True)


def without_shared_resistance(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The causes that recordings with different batteries can have in common."""
    return tuple(each for each in causes if each.id != BATTERY_RESISTANCE[0])


def separate_battery_notes(settings: Settings, log: Log) -> tuple[str, ...]:
    """A note if the batteries of several recordings differ; empty if they share one."""
    if not log.separate_batteries:
        return ()
    found = battery_resistances(settings, len(log.runs))
    if (
        max(found) < MIN_RESISTANCE_RATIO * min(found)
        or max(found) < min(found) + MIN_RESISTANCE_DIFFERENCE_OHM
    ):
        return ()
    listed = ", ".join(f"{each:.3f} ohm in recording {number}" for number, each in enumerate(found, 1))
    return (
        f"{SEPARATE_BATTERIES_NOTE}{listed}; where it is high, take a fresh battery, and clean its contacts",
    )


def has_separate_batteries(own: Diagnosis) -> bool:
    """Whether a diagnosis with a battery for each recording found that they differ."""
    return any(note.startswith(SEPARATE_BATTERIES_NOTE) for note in own.notes)


def with_resistance_not_judged(own: Diagnosis) -> Diagnosis:
    """The diagnosis with the battery's resistance among the causes that were not judged."""
    return replace(own, rejected=(*own.rejected, Rejected(BATTERY_RESISTANCE[0], NOT_SHARED_REASON)))
