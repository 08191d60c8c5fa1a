"""Motors that are the other way round: their readings turn, what a reading is at standstill does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import NOISE

TURNED = RobotConfig(motors={0: MotorConfig(inverted=True)})
CALIBRATED = replace(TURNED, motors={0: MotorConfig(inverted=True, bemf_offset=Measured(20.0, 1.0))})
TIME = 0.005 * np.arange(600)


@pytest.mark.parametrize("robot", [TURNED, CALIBRATED], ids=["hidden", "calibrated"])
def test_an_offset_is_in_counts_of_the_column(robot: RobotConfig) -> None:
    """As in the simulator and in robot.toml: it was one of the wheel, so its sign was wrong, a calibrated
    offset was a fault of twice its size, and the model that was written drove worse than none."""
    duty = np.where(TIME % 1.0 < 0.6, 0.6, 0.0)
    named = Parameters.from_robot(TURNED).with_effect("bemf.offset", "left", counts=20.0)
    run = rollout(named, Commands.of_wheels(TIME, duty, -duty, False), channels=tuple(NOISE))
    columns = {name: run[name][0] for name in NOISE}
    columns |= {"t": TIME, "motor.0.duty": -duty, "motor.1.duty": -duty}
    assert columns["motor.0.bemf"][0] == pytest.approx(20.0)
    log = log_from_columns(columns, robot)
    settings = neutral_settings(robot)
    if robot is TURNED:
        settings["bemf.offset", "left", "counts"] = 20.0
    simulated = PlantRollout(log, robot, Habits(Chain(), brake=False), plain=True).samples([settings])[0]
    for values, channel in zip(simulated, log.channels, strict=True):
        off = np.abs(values - channel.values).max()
        assert off < 1e-3 * np.ptp(channel.values)
