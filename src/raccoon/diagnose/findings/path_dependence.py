"""Causes that depend on the path driven: on the wheels' angles and the robot's position and heading. A gap
loses these, and each recording begins with others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.hypotheses.per_recording import PER_RECORDING_STDS
from raccoon.diagnose.result import CauseResult, Diagnosis, Rejected, Verdict

MIN_PART_S = 12.0
"""Length in s without a gap that is needed to distinguish causes."""
PATH_DEPENDENT = ("drive.wheel_eccentricity", "drive.slope")
PATH_DEPENDENT_UNKNOWNS = ("wheel angle", "position", "heading")
"""Effects, and covariates of unknown ones, that need the wheels' angles or the robot's position. With a gap
of 1 s in 40 an eccentric wheel was reported with another K_E, track width and inertia beside it."""
SLOPE_RIVAL = "friction.direction_dependent"
"""The cause that looks like a slope in drives that begin in the same direction on it."""
PER_RECORDING = tuple(id_ for id_, _, _ in PER_RECORDING_STDS)
"""Effects that differ from recording to recording, and cannot be a cause that several share."""
GAPS_REASON = "something here depends on the angles of the wheels and the robot, which are lost in the gaps"
DIFFERENT_STARTS_REASON = (
    "each recording began with other angles of the wheels and in another direction: diagnose them one by one"
)


def is_path_dependent(found: Diagnosis) -> bool:
    """Whether a result depends on the angle of a wheel or on the robot's position or heading, which integrate
    all motion, also in a gap."""
    named = any(each.id in PATH_DEPENDENT for each in found.causes)
    return named or any(each.startswith(PATH_DEPENDENT_UNKNOWNS) for each in found.unexplained.depends_on)


def is_too_short(seconds: float) -> bool:
    """Whether a part without a gap is too short to distinguish causes."""
    return seconds < MIN_PART_S


def not_judged_for_gaps(found: Diagnosis, seconds: float) -> Diagnosis:
    """The diagnosis without its causes, since a gap may have turned one into another."""
    reason = (
        f"not judged: {GAPS_REASON}, and the longest part without one has {seconds:.1f} s ({MIN_PART_S:g} s "
        "are needed)"
    )
    return _not_judged(found, reason)


def shareable_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The causes that several recordings can have in common."""
    return tuple(each for each in causes if each.id not in (*PATH_DEPENDENT, *PER_RECORDING))


def restricted_to_shareable(found: Diagnosis) -> Diagnosis:
    """The diagnosis of several recordings, with the causes that they cannot share among the rejected ones."""
    if is_path_dependent(found):
        return _not_judged(
            found, f"not judged: something depends on the path that was driven, and {DIFFERENT_STARTS_REASON}"
        )
    rejected = [Rejected(each, f"not identifiable: {DIFFERENT_STARTS_REASON}") for each in PATH_DEPENDENT]
    rejected += [
        Rejected(each, "not judged: each of several recordings has its own") for each in PER_RECORDING
    ]
    causes = tuple(_with_slope_as_rival(each) if each.id == SLOPE_RIVAL else each for each in found.causes)
    return replace(found, causes=causes, rejected=(*found.rejected, *rejected))


def _with_slope_as_rival(cause: CauseResult) -> CauseResult:
    """The cause with a slope, which is not tested with several recordings, as an equally likely rival."""
    others = tuple(each for each in cause.confounded_with if each != "drive.slope")
    return replace(cause, confounded_with=(*others, "drive.slope"), probability=min(cause.probability, 0.5))


def _not_judged(found: Diagnosis, reason: str) -> Diagnosis:
    return replace(
        found,
        verdict=Verdict.NOT_IDENTIFIABLE,
        causes=(),
        rejected=(*found.rejected, *(Rejected(each.name, reason) for each in found.causes)),
        unexplained=replace(found.unexplained, depends_on=()),
        model=None,
        notes=(*found.notes, reason),
        shapes=(),
    )
