"""A verdict in one sentence: what a whole recording says, and how much it could have said."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import chain

from raccoon.diagnose.fleet.silent_recordings import CANNOT_TELL_PREFIXES
from raccoon.diagnose.reports.plain_names import PLAIN_NAMES
from raccoon.diagnose.reports.unknown_text import depends_text
from raccoon.diagnose.result import STOOD, Diagnosis, Verdict

VERDICTS: Mapping[Verdict, str] = {
    Verdict.EXPLAINED: "The simulation is wrong, and this is why:",
    Verdict.PARTLY: "The simulation is wrong; these causes explain a part of the error:",
    Verdict.UNKNOWN: "The simulation is wrong in a way that no known cause describes.",
    Verdict.ADEQUATE: "The simulation fits this recording: nothing that matters is wrong.",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot tell.",
}
FITS_WHERE_ANSWERED = "Where its motors answered, the simulation fits this recording."
NOT_VISIBLE_PREFIX = "not visible"
"""How the reason of a cause begins that would not show at its usual size."""
MIN_HIDDEN_CAUSES = 5
"""Number of such causes, of 31, from which a recording that shows nothing says little. One that was driven as
the checkup hides one or two."""
USUAL_CAUSES = (
    "motor.back_emf_constant",
    "motor.armature_resistance",
    "drive.inertia",
    "drive.wheel_radius",
    "friction.coulomb",
    "imu.gyro_scale",
    "battery.internal_resistance",
)
"""What most teams ask for; from which size on each would show tells how far a recording sees."""
_SHOWS_FROM = re.compile(r"; would show from about (.*) on")


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict as a sentence; of what is unknown what it depends on. That nothing is wrong is not said
    where next to nothing would have shown, nor of a robot whose motors did not answer."""
    depends_on = depends_text(diagnosis.unexplained.depends_on)
    if diagnosis.verdict is Verdict.UNKNOWN and depends_on:
        return f"{VERDICTS[Verdict.UNKNOWN].removesuffix('.')}: it depends on {depends_on}."
    if diagnosis.verdict is not Verdict.ADEQUATE:
        return VERDICTS[diagnosis.verdict]
    if any(each.fault == STOOD for each in diagnosis.sensor_faults):
        return FITS_WHERE_ANSWERED
    hidden = sum(each.reason.startswith(NOT_VISIBLE_PREFIX) for each in diagnosis.rejected)
    if hidden >= MIN_HIDDEN_CAUSES:
        return (
            "The simulation fits this recording, but that says little: of "
            f"{len(diagnosis.rejected)} causes {hidden} would not show in it at their usual size."
        )
    return VERDICTS[Verdict.ADEQUATE]


def visible_sizes_text(diagnosis: Diagnosis) -> str:
    """Of a recording in which nothing was found, from which size on the most usual causes would have shown;
    "" where that is not known."""
    if diagnosis.verdict is not Verdict.ADEQUATE or diagnosis.causes:
        return ""
    reasons = {each.id: each.reason for each in diagnosis.rejected}
    sizes = [(PLAIN_NAMES[id_], _SHOWS_FROM.search(reasons.get(id_, ""))) for id_ in USUAL_CAUSES]
    said = [f"{name} {found[1]}" for name, found in sizes if found]
    return f"Errors from this size on would have shown: {', '.join(said)}." if said else ""


def reason_it_cannot_tell(diagnosis: Diagnosis) -> str:
    """Why a recording cannot tell, in the words of the first reason or note; "" where none says it."""
    reasons = (each.reason for each in diagnosis.rejected if each.reason.startswith(CANNOT_TELL_PREFIXES))
    return next(chain(reasons, diagnosis.notes), "").removeprefix("not identifiable: ")
