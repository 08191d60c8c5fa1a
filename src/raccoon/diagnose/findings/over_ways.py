"""What adds up along the way: the angles of wheels, where a robot is and where it points. A gap loses them,
and each recording begins with others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.hypotheses.per_recording import DIFFERS
from raccoon.diagnose.result import CauseResult, Diagnosis, Rejected, Verdict

LONG_PART = 12.0
"""s without a gap in which causes can be told apart."""
OVER_WAYS = ("drive.wheel_eccentricity", "drive.slope")
UNKNOWN_OVER_WAYS = ("wheel angle", "position", "heading")
"""Effects, and what unknown ones may depend on, that need the wheels' angles or the robot's place. With a gap
of 1 s in 40 an eccentric wheel became another K_E, track width and inertia beside itself."""
LIKE_A_SLOPE = "friction.direction_dependent"
"""What a table that is not level is, to drives that begin in the same direction on it."""
OF_EACH = tuple(id_ for id_, _, _ in DIFFERS)
"""What each recording has of its own, and is no cause of several."""
ADDS_UP = "the gaps lose where the wheels and the robot point, on which something here depends"
BEGUN = (
    "each of several recordings began with other angles of the wheels and in another direction: diagnose "
    "them one by one"
)


def adds_up(found: Diagnosis) -> bool:
    """Whether what was found depends on the angle of a wheel or on where the robot is: both add up all that
    was driven, also in a gap."""
    named = any(each.id in OVER_WAYS for each in found.causes)
    return named or any(each.startswith(UNKNOWN_OVER_WAYS) for each in found.unexplained.depends_on)


def too_short(seconds: float) -> bool:
    """Whether a part without a gap tells causes apart no more."""
    return seconds < LONG_PART


def lost_count(found: Diagnosis, seconds: float) -> Diagnosis:
    """A diagnosis without causes, where each may be what a gap made of another."""
    reason = f"not judged: {ADDS_UP}, and the longest part without one has {seconds:.1f} s of {LONG_PART:g} s"
    return _not_judged(found, reason)


def tried_of_several(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The causes that several recordings can have in common."""
    return tuple(each for each in causes if each.id not in (*OVER_WAYS, *OF_EACH))


def of_several(found: Diagnosis) -> Diagnosis:
    """The diagnosis of several recordings, with what they cannot have in common among what is rejected."""
    if adds_up(found):
        return _not_judged(found, f"not judged: something depends on the way that was driven, and {BEGUN}")
    rejected = [Rejected(each, f"not identifiable: {BEGUN}") for each in OVER_WAYS]
    rejected += [Rejected(each, "not judged: each of several recordings has its own") for each in OF_EACH]
    causes = tuple(_or_a_slope(each) if each.id == LIKE_A_SLOPE else each for each in found.causes)
    return replace(found, causes=causes, rejected=(*found.rejected, *rejected))


def _or_a_slope(cause: CauseResult) -> CauseResult:
    """Named with the slope, as likely, that several recordings are not asked for."""
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
