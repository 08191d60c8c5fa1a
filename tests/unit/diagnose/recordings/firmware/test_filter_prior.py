"""A controller that filters its back-EMF otherwise than robot.toml's default is no defect of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.readings import SI_WORDS, SIMULATOR
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.firmware.filter_prior import with_device_filter
from raccoon.diagnose.result import Verdict
from raccoon.model.bemf import counter_lag
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

ROBOT = RobotConfig()
STOCK = replace(SI_WORDS, bemf_lag=3.0 / 235.0)
STOCK_TIME_CONSTANT = 0.0148
"""s: of a filter that takes a quarter of each of 235 samples a second."""


def filtered(time_constant: float) -> RobotConfig:
    bemf = replace(ROBOT.model.bemf, filter_time_constant=Measured(time_constant, 0.0005))
    return replace(ROBOT, model=replace(ROBOT.model, bemf=bemf))


@pytest.fixture(scope="module")
def of_stock_firmware() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(2)
    duty = exciting(rng, 6.0)
    time = 0.005 * np.arange(len(duty))
    names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    commands = Commands.of_wheels(time, duty[:, 0], duty[:, 1], False)
    robot = Parameters(filtered(STOCK_TIME_CONSTANT), {}, Chain.firmware())
    run = rollout([robot], commands, channels=names, longest_step=0.001)
    noise = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.009, "battery.voltage": 0.02}
    columns = {name: run[name][0] + noise[name] * rng.standard_normal(len(time)) for name in names}
    return {"t": time, "motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1], **columns}


@pytest.mark.usefixtures("few_causes")
def test_the_devices_lag_is_the_prior(of_stock_firmware: dict[str, np.ndarray]) -> None:
    assert [each.id for each in diagnose_recording(of_stock_firmware, ROBOT).causes] == ["bemf.filter_lag"]
    said = diagnose_recording(of_stock_firmware, ROBOT, device=STOCK)
    assert said.causes == ()
    assert said.verdict is Verdict.ADEQUATE


def test_robot_toml_comes_first_and_a_simulator_changes_nothing() -> None:
    given = filtered(0.03)
    assert with_device_filter(STOCK, given) is given
    assert with_device_filter(SI_WORDS, ROBOT) is ROBOT
    own = counter_lag(ROBOT.model.bemf.filter_time_constant.value, 0.005)
    assert with_device_filter(replace(SI_WORDS, bemf_lag=own), ROBOT) is ROBOT
    assert with_device_filter(replace(SIMULATOR, bemf_lag=0.0205), ROBOT) is ROBOT  # in rows of 500 Hz


def test_no_filter_at_all_stays_a_filter_that_can_be_simulated() -> None:
    told = with_device_filter(replace(SI_WORDS, bemf_lag=0.0), ROBOT).model.bemf.filter_time_constant
    assert 0.0 < 3.5 * told.std < told.value <= 0.001
