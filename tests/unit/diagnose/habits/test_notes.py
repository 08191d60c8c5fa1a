"""What habits leave open of the numbers that are named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from diagnoses import cause
from raccoon.diagnose.habits.notes import less_sure
from raccoon.diagnose.result import ParameterResult
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.variants import Habits
from raccoon.sim.effects.chain import Chain


@pytest.mark.parametrize(
    ("firmware", "std"), [(None, 0.015), ("wombat-raccoon-17", 0.011), ("simulator", 0.003)], ids=str
)
def test_when_a_battery_is_read_leaves_its_resistance_open(firmware: str | None, std: float) -> None:
    """0.17 ohm was 0.184 or 0.197, each +- 0.003, by when in a row the reading was taken."""
    number = {"resistance": ParameterResult(0.184, 0.003, "ohm", 0.05)}
    found = cause("battery.internal_resistance", number, "")
    other = replace(found, id="friction.coulomb")
    known = None if firmware is None else FIRMWARES[firmware]
    (wider, same) = less_sure((found, other), Habits(Chain(), False, firmware=known))
    assert wider.parameters["resistance"].std == pytest.approx(std, abs=0.0006)
    assert same == other
