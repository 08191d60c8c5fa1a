"""The prior of the back-EMF filter by the recording's device, where robot.toml has none of its own."""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.config import BemfModel, RobotConfig
from raccoon.core.readings import SIMULATOR, Device
from raccoon.diagnose.rollout.firmware import firmware_of
from raccoon.model.bemf import counter_lag

LAG_STD = 0.003
"""Standard deviation, s. A device's lag is counted in its own samples, some with a median among them and some
not: between it and the time constant of the simulated filter are half a sample and one of about 5 ms."""
KNOWN_FIRMWARE_LAG_STD = 0.0005
"""The same where it is known which samples a median saw: the difference of a filter at 4.3 or 5.5 ms from one
at 5 ms, and the error of the firmware's loop rate."""
CYCLE_S = 0.005
"""s between two back-EMF samples of the simulated controller."""
MIN_TIME_CONSTANT_S = 0.001
"""s; a shorter filter does nothing in a simulation with steps of 1 ms."""


def with_device_filter(device: Device, robot: RobotConfig) -> RobotConfig:
    """The robot with the device's filter as its prior, where its own is only the default.

    device: of the recording. A controller that filters more or less than usual is no defect of the robot, and
    must not be named as one. Nothing changes where the device does not know its lag, where robot.toml gives a
    filter, and where the device's lag is that of robot.toml, as the simulator's is at any rate of its rows.
    """
    configured, lag = robot.model.bemf.filter_time_constant, device.bemf_lag
    if lag is None or configured != BemfModel().filter_time_constant:
        return robot
    if device.name.startswith(SIMULATOR.name) or abs(lag - counter_lag(configured.value, CYCLE_S)) < 1e-6:
        return robot
    firmware = firmware_of(device)
    if firmware is None or not firmware.wombat:
        value = max(lag, MIN_TIME_CONSTANT_S)
        prior = replace(configured, value=value, std=min(LAG_STD, 0.25 * value))
    else:
        value = _time_constant(lag - CYCLE_S * firmware.chain.median)
        prior = replace(configured, value=value, std=KNOWN_FIRMWARE_LAG_STD)
    return replace(
        robot, model=replace(robot.model, bemf=replace(robot.model.bemf, filter_time_constant=prior))
    )


def _time_constant(lag: float) -> float:
    """Time constant, s, of the filter whose sums lag by so many s; see `counter_lag`."""
    return CYCLE_S / math.log1p(CYCLE_S / lag)
