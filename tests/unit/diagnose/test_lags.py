"""Lags that were named or taken for habits: where a gyro's chip makes a part of them, or none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import Hidden, draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.habits.controller import FREE_RUNNING, drive_problem
from raccoon.diagnose.habits.lags import LATE_GYRO, SLIP, as_lags_of_the_robot, starts_with_a_chip
from raccoon.diagnose.habits.others import Under, started
from raccoon.diagnose.log import log_from_columns
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.rollout import Habits
from raccoon.diagnose.select.outlook import Search, look_around
from raccoon.diagnose.unknown import probes_for
from raccoon.sim.chain import Chain

ROBOT, CAUSES = RobotConfig(), drive_causes()


def test_a_slip_a_little_larger_than_a_chip_s_lag_is_left_out_beside_a_late_gyro(problem: Problem) -> None:
    """Of 11.3 ms and a chip, 4.5 ms of slip were named: the chip paid a gate for 0.6 ms that were left."""
    slip, late = (problem.causes[each].coordinates[0] for each in (SLIP, LATE_GYRO))
    point = problem.nominal().with_cause(SLIP, np.array([0.0045 / slip.value(1.0)]))
    point = point.with_cause(LATE_GYRO, np.array([0.0113 / late.value(1.0)]))
    search = cast(Search, SimpleNamespace(fit=SimpleNamespace(point=point), problem=problem))
    names = [LATE_GYRO, SLIP]
    starts = starts_with_a_chip(search, names, names)
    assert {LATE_GYRO} in [set(each.active) for each in starts]


SLIPS = Hidden(SLIP, None, {"time": 0.005}, {"slip": 0.005})
OTHERS = ("motor.back_emf_constant", "friction.viscous", "battery.internal_resistance")


def smoothed(first: Hidden, chain: Chain, others: tuple[str, ...]) -> tuple[Search, Habits, Under]:
    """A robot of which `first` lags beside others of its faults, where these were named and the lag was
    taken for a gyro that smooths under this chain, as it is while nothing else has been found.
    """
    hidden = [draw(each, np.random.default_rng(8)) for each in others]
    log = log_from_columns(make(8, [first, *hidden], seconds=10.0).columns, ROBOT)
    habits = Habits(chain, brake=False, low_pass=True)
    under = Under(lambda each: drive_problem(log, ROBOT, CAUSES, each, None))
    problem = under(habits)
    begin = started(problem)
    point = problem.nominal()
    for each in hidden:
        (coordinate,) = problem.causes[each.name].coordinates
        (value,) = each.values.values()
        one = coordinate.value(1.0)
        at = np.log(value) / np.log(one) if coordinate.factor else value / one
        point = point.with_cause(each.name, np.array([at]))
    there = fit_point(problem, begin.whitener, point)
    return look_around(problem, probes_for(problem), there.point, begin.whitener), habits, under


@pytest.mark.parametrize("chain", [Chain.firmware(), FREE_RUNNING])
def test_a_slip_that_was_taken_for_other_readings_is_named_once_much_else_is_wrong(chain: Chain) -> None:
    """Of 17 slips beside many causes 12 were left to a chip, which was taken while little else was known."""
    search, habits, under = smoothed(SLIPS, chain, OTHERS)
    found, now = as_lags_of_the_robot(search, habits, under)
    assert not now.low_pass
    assert not now.chain.free_running
    assert found.fit.point.active.keys() == {SLIP, *search.fit.point.active}
    size = found.fit.point.active[SLIP][0] * found.problem.causes[SLIP].coordinates[0].value(1.0)
    assert size == pytest.approx(0.005, abs=0.0006)


def test_beside_two_causes_it_stays_the_chip_s() -> None:
    search, habits, under = smoothed(SLIPS, Chain.firmware(), OTHERS[:2])
    assert as_lags_of_the_robot(search, habits, under) == (search, habits)


def test_a_controller_with_a_clock_of_its_own_keeps_it_beside_many_causes() -> None:
    own = Hidden("unknown", None, {}, {"own_cycle": 0.0053, "gyro_smooth": 0.0039, "imu_latency": 0.0025})
    search, habits, under = smoothed(own, FREE_RUNNING, OTHERS)
    assert as_lags_of_the_robot(search, habits, under) == (search, habits)
