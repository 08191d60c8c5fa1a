"""The verdict in one sentence: what a whole recording shows, and how much it could have shown."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import chain

from raccoon.diagnose.fleet.other_robots import far_constants_text
from raccoon.diagnose.fleet.silent_recordings import CANNOT_TELL_PREFIXES
from raccoon.diagnose.reports.plain_names import PLAIN_NAMES, capitalise
from raccoon.diagnose.reports.unknown_text import depends_text
from raccoon.diagnose.result import SAME_ROBOT, STOOD, Diagnosis, Verdict

VERDICTS: Mapping[Verdict, str] = {
    Verdict.EXPLAINED: "The simulation is wrong, and this is why:",
    Verdict.PARTLY: "The simulation is wrong; these causes explain a part of the error:",
    Verdict.UNKNOWN: "The simulation is wrong in a way that no known cause describes.",
    Verdict.ADEQUATE: "The simulation fits this recording: nothing that matters is wrong.",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot tell.",
}
FITS_WHERE_ANSWERED = "Where its motors turned, the simulation fits this recording."
NOT_VISIBLE_PREFIX = "not visible"
"""Beginning of the reason of a cause that would not show at its usual size."""
MIN_HIDDEN_CAUSES = 5
"""Number of such causes, of 31, from which a recording without findings says little. A drive like the checkup
hides one or two."""
USUAL_CAUSES = (
    "motor.back_emf_constant",
    "motor.armature_resistance",
    "drive.inertia",
    "drive.wheel_radius",
    "friction.coulomb",
    "imu.gyro_scale",
    "battery.internal_resistance",
)
"""Causes that teams ask for most; the sizes above which they would show tell how sensitive a recording is."""
_SHOWS_FROM = re.compile(r"; would show from about (.*) on")


def verdict_text(diagnosis: Diagnosis) -> str:
    """The verdict as a sentence, for an unknown effect with what it depends on. It does not say that nothing
    is wrong if hardly any cause would have shown or a motor did not respond."""
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


def other_robot_question(diagnosis: Diagnosis) -> str:
    """What to ask before anything is done about the causes, where they are what another robot would have, or
    where the other recording, on which they are judged, seems to be another robot's; "" elsewhere."""
    if far := far_constants_text(diagnosis):
        return (
            f"Is this recording of the robot of robot.toml ({far})? If not, name that robot's (--robot); if "
            "it is, measure these first."
        )
    return capitalise(next((each for each in diagnosis.notes if each.endswith(SAME_ROBOT)), ""))


def visible_sizes_text(diagnosis: Diagnosis) -> str:
    """For a recording without findings, the sizes above which the most usual causes would have shown; "" if
    unknown."""
    if diagnosis.verdict is not Verdict.ADEQUATE or diagnosis.causes:
        return ""
    reasons = {each.id: each.reason for each in diagnosis.rejected}
    sizes = [(PLAIN_NAMES[id_], _SHOWS_FROM.search(reasons.get(id_, ""))) for id_ in USUAL_CAUSES]
    said = [f"{name} {found[1]}" for name, found in sizes if found]
    return f"Errors from this size on would have shown: {', '.join(said)}." if said else ""


def reason_it_cannot_tell(diagnosis: Diagnosis) -> str:
    """Why a recording cannot tell, by the first such reason or note; "" without one."""
    reasons = (each.reason for each in diagnosis.rejected if each.reason.startswith(CANNOT_TELL_PREFIXES))
    return next(chain(reasons, diagnosis.notes), "").removeprefix("not identifiable: ")
