"""Lags that the moment of a reading in its row explains."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnoses import make_cause
from raccoon.diagnose.habits.notes import with_habit_uncertainty
from raccoon.diagnose.habits.read_times import without_read_times
from raccoon.diagnose.result import CauseResult, ParameterResult, Rejected
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain

UNNAMED = Habits(Chain(), False)


def lag(id_: str, name: str, seconds: float, *rivals: str) -> CauseResult:
    found = make_cause(id_, {name: ParameterResult(seconds, 0.0001, "s", 0.0)})
    return replace(found, confounded_with=rivals, change=1.9, unabsorbed=0.4)


def fault(id_: str) -> CauseResult:
    number = {"factor": ParameterResult(0.93, 0.005, "", 1.0)}
    return replace(make_cause(id_, number), change=9.0, unabsorbed=1.3)


@pytest.mark.parametrize(
    ("late", "named"),
    [
        (lag("imu.latency", "seconds", 0.0008, "drive.wheel_slip"), False),
        (lag("drive.wheel_slip", "time", 0.0008, "imu.latency"), False),
        (lag("actuation.latency", "seconds", 0.0021), False),
        (lag("actuation.latency", "seconds", 0.0027), True),  # surely later than any moment in the row
        (lag("imu.latency", "seconds", 0.0035), True),  # matters
        (lag("drive.wheel_slip", "time", 0.0008), True),  # is no latency
        (lag("bemf.filter_lag", "time_constant", 0.0008, "actuation.latency"), True),  # a filter matters
    ],
)
def test_a_lag_that_may_be_the_moment_of_a_reading_is_no_cause(late: CauseResult, named: bool) -> None:
    """A gyro that averages over 2 ms is 1 ms late: 0.8 +- 3.2 ms was named on fault-free robots, and beside
    each single cause."""
    (wide,) = with_habit_uncertainty((late,), UNNAMED)
    kept, rejected = without_read_times((wide,), (), UNNAMED)
    assert [each.name for each in kept] == ([late.name] if named else [])
    assert [each.id for each in rejected] == ([] if named else [late.id])
    assert all(" ms may be nothing but the moment" in each.reason for each in rejected)


@pytest.mark.parametrize(("others", "named"), [(0, False), (1, False), (2, True)])
def test_it_is_named_beside_several_causes_of_which_it_may_be_a_share(others: int, named: bool) -> None:
    faults = [fault(each) for each in ("motor.back_emf_constant", "drive.inertia")[:others]]
    wide = with_habit_uncertainty((lag("imu.latency", "seconds", 0.0008), *faults), UNNAMED)
    kept, _ = without_read_times(wide, (), UNNAMED)
    assert ("imu.latency" in [each.name for each in kept]) == named
    assert named or [each.rank for each in kept] == list(range(1, others + 1))


def test_the_moment_is_known_of_a_named_firmware() -> None:
    late, habits = lag("imu.latency", "seconds", 0.0008), replace(UNNAMED, firmware=FIRMWARES["simulator"])
    kept, rejected = without_read_times(with_habit_uncertainty((late,), habits), (), habits)
    assert (kept, rejected) == ((late,), ())


def test_its_alternative_is_rejected_for_the_same_reason() -> None:
    late = lag("imu.latency", "seconds", 0.0008, "drive.wheel_slip")
    said = "looks much like imu.latency and may be the true cause instead"
    known = (Rejected("drive.wheel_slip", said), Rejected("drive.backlash", "explains too little"))
    _, rejected = without_read_times(with_habit_uncertainty((late,), UNNAMED), known, UNNAMED)
    reasons = {each.id: each.reason for each in rejected}
    assert reasons["drive.wheel_slip"] == reasons["imu.latency"]
    assert reasons["drive.backlash"] == "explains too little"
