"""One blind robot over five days: what was done to it, when, and what the other days foresee of one."""

from __future__ import annotations

from functools import partial

import pytest

from blind.generator import make
from blind.hidden import Hidden
from blind.plant import NEUTRAL
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.fleet.common_model import common_model, make_cross_check
from raccoon.diagnose.fleet.summary import fleet_of
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from simulated_drives import BLIND_CONTROLLER

WEAK = Hidden("motor.back_emf_constant", "right", {"factor": 0.9}, {"ke_r": 0.9 * NEUTRAL["ke_r"]})
AGED = Hidden("battery.internal_resistance", None, {"resistance": 0.2}, {"rint": 0.2})
known = partial(diagnose, firmware=BLIND_CONTROLLER)
ASKED = [each for each in drive_causes() if each.id in (WEAK.id, "motor.armature_resistance", AGED.id)]
"""What may be wrong with this robot: what many have in common does not depend on what else is looked for."""


def test_another_battery_and_a_motor_that_is_weak_all_the_time() -> None:
    hidden = [[WEAK], [WEAK], [WEAK, AGED], [WEAK, AGED], [WEAK, AGED]]
    drives = [make(810 + day, each, seconds=3.0, robot=3).columns for day, each in enumerate(hidden)]
    fleet = fleet_of(
        {f"day{day}": known(each, RobotConfig(), causes=ASKED) for day, each in enumerate(drives)}
    )
    found = {each.name: each for each in fleet.causes}
    assert set(found) == {"motor.back_emf_constant@right", "battery.internal_resistance"}
    assert found["motor.back_emf_constant@right"].common
    assert found["motor.back_emf_constant@right"].series.courses == ()
    (course,) = found["battery.internal_resistance"].series.courses
    assert [each.first for each in course.pieces] == [0, 2]
    model = common_model(fleet, "day4")
    assert model is not None
    assert model.value("motor.back_emf_constant", "factor", "right") == pytest.approx(0.9, abs=0.02)
    seen = make_cross_check(fleet.results["day4"], known(drives[4], model.robot, causes=ASKED, model=model))
    assert seen.still == ()
    assert seen.before**2 - seen.after**2 > 0.9 * (seen.before**2 - seen.own**2)
