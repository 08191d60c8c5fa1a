"""Lags that the moment of a reading in its row explains: no causes, but numbers of the controller."""

from __future__ import annotations

from dataclasses import replace

from raccoon.diagnose.findings.validation import MIN_DEVIATIONS
from raccoon.diagnose.habits.notes import reading_latency
from raccoon.diagnose.result import CauseResult, Rejected
from raccoon.diagnose.rollout.plant_rollout import Habits

MAX_OTHER_CAUSES = 1
"""Causes that matter beside which such a lag is not named. Of a robot with more faults it may as well be a
share of one: of fifteen causes that are all present, lags of 1 to 3 ms are."""


def without_read_times(
    causes: tuple[CauseResult, ...], rejected: tuple[Rejected, ...], habits: Habits
) -> tuple[tuple[CauseResult, ...], tuple[Rejected, ...]]:
    """The causes, with the uncertainty of the habits, without lags that do not matter and may be nothing but
    the unknown moment in a row at which a reading is taken; and the rejected causes with these.

    A gyro that averages over the 2 ms before its reading is 1 ms late: readings show that clearly, but
    0.8 +- 3.2 ms is no fault of a robot. The model keeps the number.
    """
    if habits.firmware is not None or sum(not each.is_negligible for each in causes) > MAX_OTHER_CAUSES:
        return causes, rejected
    dropped = {each.name: _reason(each) for each in causes if _may_be_read_time(each)}
    rivals = {
        rival: dropped[each.name] for each in causes if each.name in dropped for rival in each.confounded_with
    }
    kept = (each for each in causes if each.name not in dropped)
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(kept, start=1))
    others = (replace(each, reason=rivals.get(each.id, each.reason)) for each in rejected)
    return ranked, (*others, *(Rejected(name, reason) for name, reason in dropped.items()))


def _may_be_read_time(cause: CauseResult) -> bool:
    if not cause.negligible_reason or reading_latency(cause) is None:
        return False
    (number,) = cause.parameters.values()
    return abs(number.value - number.nominal) < MIN_DEVIATIONS * number.std


def _reason(cause: CauseResult) -> str:
    (number,) = cause.parameters.values()
    late, std = 1e3 * (number.value - number.nominal), 1e3 * number.std
    return (
        f"{late:.1f} +- {std:.1f} ms may be nothing but the moment in a row at which the reading is taken, "
        "which is not known"
    )
