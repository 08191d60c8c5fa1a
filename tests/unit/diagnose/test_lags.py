"""What may be left of lags that were named, where a gyro's chip makes a part of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from raccoon.diagnose.habits.lags import LATE_GYRO, SLIP, starts_with_a_chip
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.select.outlook import Search


def test_a_slip_a_little_larger_than_a_chip_s_lag_is_left_out_beside_a_late_gyro(problem: Problem) -> None:
    """Of 11.3 ms and a chip, 4.5 ms of slip were named: the chip paid a gate for 0.6 ms that were left."""
    slip, late = (problem.causes[each].coordinates[0] for each in (SLIP, LATE_GYRO))
    point = problem.nominal().with_cause(SLIP, np.array([0.0045 / slip.value(1.0)]))
    point = point.with_cause(LATE_GYRO, np.array([0.0113 / late.value(1.0)]))
    search = cast(Search, SimpleNamespace(fit=SimpleNamespace(point=point), problem=problem))
    names = [LATE_GYRO, SLIP]
    starts = starts_with_a_chip(search, names, names)
    assert {LATE_GYRO} in [set(each.active) for each in starts]
