"""The form of a wheel's slip: whether it follows acceleration without delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from raccoon.diagnose.habits.alternatives import (
    MIN_LOG_EVIDENCE_LEAD,
    log_evidence_lead,
    search_again,
    without_causes,
)
from raccoon.diagnose.habits.lags import GYRO_LATENCY, SLIP, note_rival
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits
from raccoon.diagnose.hypotheses.base_coordinates import LOW_PASS
from raccoon.diagnose.hypotheses.coordinates import FORM_PARAMETERS
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.refits import equal_lag
from raccoon.diagnose.select.set_scoring import overlaps_none
from raccoon.diagnose.select.state import Search


def try_immediate_slip(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test slip that follows acceleration without delay; the search with it if it leads. Compared with the
    lagging slip it looks like a gyro that is late, or also has a low-pass.

    A low-pass that was adopted under the lagging slip takes a part of the immediate one, of which it cannot
    give back all: of 14.5 ms, with a gyro without a chip, 11.1 +- 0.5 ms were left. So the immediate slip is
    also tested without it, unless the recording names its firmware.
    """
    point, causes = search.fit.point, search.problem.causes
    lags = [name for name in (GYRO_LATENCY, SLIP) if name in point.active]
    if not lags or SLIP not in causes:
        return search, habits
    without_lags = without_causes(point, lags)
    if not overlaps_none(SLIP, without_lags.active):  # one wheel's slip was named
        return search, habits
    at_once = {key: 1.0 for key in search.problem.neutral if key[::2] == (SLIP, FORM_PARAMETERS[SLIP])}
    slip = np.sum([equal_lag(search, name, SLIP) for name in lags], axis=0)
    low_pass = LOW_PASS / causes[SLIP].coordinates[0].value(1.0)
    removed = low_pass if habits.low_pass else -low_pass  # by the other form of the gyro's reading
    for other, size in ((habits, slip), (replace(habits, low_pass=not habits.low_pass), slip + removed)):
        if size <= 0.0 or (habits.firmware is not None and not other.low_pass and other is not habits):
            continue
        problem = trials.problem_of(other)
        problem = replace(problem, neutral=problem.neutral | at_once)
        lead = log_evidence_lead(search, problem, [without_lags.with_cause(SLIP, size)])
        if lead < MIN_LOG_EVIDENCE_LEAD:
            if lags == [GYRO_LATENCY] and other is habits:
                note_rival(search, GYRO_LATENCY, SLIP, -lead)
            continue
        second = search_again(search, problem)
        if second is not None and SLIP in second.fit.point.active:
            search, habits = second, other
    return search, habits
