"""What habits leave open of the numbers that are named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnoses import cause
from raccoon.diagnose.habits.notes import less_sure
from raccoon.diagnose.result import ParameterResult
from raccoon.diagnose.rollout.variants import Habits
from raccoon.sim.effects.chain import Chain


def test_a_filtered_battery_leaves_its_resistance_open() -> None:
    """0.17 ohm was 0.184 or 0.197, each +- 0.003, by when in a row the reading was taken."""
    number = {"resistance": ParameterResult(0.184, 0.003, "ohm", 0.05)}
    found = cause("battery.internal_resistance", number, "")
    other = replace(found, id="friction.coulomb")
    slow, quick = (Habits(Chain(battery_time_constant=each), False) for each in (0.1, 0.02))
    (wider, same) = less_sure((found, other), slow)
    assert wider.parameters["resistance"].std == pytest.approx(0.015, abs=0.001)
    assert same == other
    assert less_sure((found, other), quick) == (found, other)
