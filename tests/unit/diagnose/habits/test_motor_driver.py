"""What a driver, or who simulates one, takes from the battery and makes of small commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.habits.chains import alternative_chains, known_chain_of
from raccoon.diagnose.habits.motor_driver import try_deadband_shapes, try_whole_currents
from raccoon.diagnose.habits.notes import habit_notes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.search import start_selection
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from simulated_drives import record_simulated_drive
from unit.diagnose.searches import standing

ROBOT = RobotConfig()
GIVING: dict[tuple[str, str | None], dict[str, float]] = {
    ("friction.presliding", None): {"compliance": 0.001, "damping": 0.3}
}
USUAL = Habits(Chain.firmware(), brake=False)


@pytest.mark.parametrize("whole", [False, True])
def test_what_the_battery_carries_is_asked_for_where_something_is_named(whole: bool) -> None:
    """Half the sag of a slow drive was taken for another resistance, beside six other causes."""
    chain = replace(Chain.firmware(), whole=whole)
    columns = record_simulated_drive(Parameters(ROBOT, GIVING, chain), 6.0)
    among = ("battery.", "motor.", "friction.coulomb")
    search, trials = standing(columns, USUAL, {"battery.internal_resistance": 0.3}, among)
    search, habits = try_whole_currents(search, USUAL, trials.running(start_selection))
    assert habits == replace(USUAL, chain=chain)
    assert bool(search.fit.point.active) is not whole


@pytest.mark.parametrize("end", ["threshold", "cut"])
def test_how_a_deadband_ends_is_asked_for_beside_what_is_like_one(end: str) -> None:
    """One of 0.1 that ends at once was one of 0.015, beside three frictions."""
    chain = replace(Chain.firmware(), threshold=end == "threshold", cut=end == "cut")
    robot = Parameters(ROBOT, GIVING | {("actuation.deadband", None): {"duty": 0.14}}, chain)
    among = ("actuation.", "friction.", "motor.", "drive.")
    search, trials = standing(record_simulated_drive(robot, 5.0), USUAL, {"friction.coulomb": 0.3}, among)
    search, habits = try_deadband_shapes(search, USUAL, trials.running(start_selection))
    assert habits == replace(USUAL, chain=chain)
    assert list(search.fit.point.active) == ["actuation.deadband"]


def test_a_deadband_that_is_none_is_not_asked_for() -> None:
    search, trials = standing(
        record_simulated_drive(Parameters(ROBOT, GIVING), 3.0), USUAL, {"imu.gyro_bias": 0.3}
    )
    assert try_deadband_shapes(search, USUAL, trials.running(start_selection)) == (search, USUAL)
    assert trials.rejected == set()


def test_it_stays_with_another_filter_and_is_said() -> None:
    chain = replace(Chain.firmware(), whole=True)
    assert known_chain_of(chain) == Chain.firmware()
    assert all(each.whole for each in alternative_chains(chain))
    assert Chain.firmware() not in alternative_chains(Chain.firmware())
    (note,) = habit_notes(
        replace(USUAL, chain=chain), (), FitUncertainty(neutral_settings(ROBOT), (), np.zeros((0, 0)))
    )
    assert note.startswith("the battery is simulated as supplying the full current of both motors")
