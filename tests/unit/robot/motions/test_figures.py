"""The figures that the motions are asked for, held on robots of the benchmark (which has the percentiles)."""

import math
import sys
from importlib import import_module
from pathlib import Path

import pytest

from raccoon.core.config import RobotConfig

sys.path.insert(0, str(Path(__file__).parents[4] / "benchmarks"))  # its files find each other there
motion_robots, motion_steps, motions = map(import_module, ("motion_robots", "motion_steps", "motions"))


def test_a_robot_of_unequal_motors_keeps_every_figure() -> None:
    battery = 6.1
    case = motion_robots.Case(battery, 0, 2, 0)
    found = motions.measure(motions.Job(case, every=(battery,), some=(battery,), steps=()))
    (straight,), (turn,), (square,) = (found.of(name) for name in ("straight", "turn", "square"))
    assert straight.along <= 0.003
    assert straight.across <= 0.005
    assert straight.heading_deg <= 0.3
    assert turn.heading_deg <= 0.5
    assert turn.seconds <= 1.3 * motions.turn_time_optimal(RobotConfig())
    assert math.hypot(square.along, square.across) <= 0.010
    assert square.heading_deg <= 1.0
    for name in motions.SMALL:
        (small,) = found.of(name)
        assert small.along <= 0.0015
        assert small.seconds <= 1.0


@pytest.mark.parametrize("battery", [5.8, 7.2])
@pytest.mark.parametrize(("left", "right"), [(0, 2), (1, 0)])
def test_a_step_of_speed_settles_without_overshoot(battery: float, left: int, right: int) -> None:
    settled, overshoot = motion_steps.step_response(battery, left, right, RobotConfig(), 3)
    assert settled <= motion_steps.SETTLE_LIMIT
    assert overshoot <= 0.05


def test_nothing_oscillates_with_any_of_the_motors() -> None:
    phase_deg, gain_db = motion_steps.worst_margins(RobotConfig())
    assert phase_deg >= 45.0
    assert gain_db >= 6.0


def test_every_pairing_and_every_battery_has_its_turn() -> None:
    work = list(motions.jobs(3))
    assert len({job.case.robot for job in work}) == 27
    assert all(job.every == motion_robots.BATTERIES for job in work)
    crossed = {(job.case.left, job.case.right, *job.some) for job in work}
    assert len(crossed) == 27
    assert all(job.some[0] != job.case.battery for job in work)  # the match has another battery
