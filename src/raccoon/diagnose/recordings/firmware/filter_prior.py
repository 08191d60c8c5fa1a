"""Prior of the back-EMF filter by the recording's device, if robot.toml has none of its own."""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.config import BemfModel, RobotConfig
from raccoon.core.readings import SIMULATOR, Device
from raccoon.diagnose.rollout.firmware import firmware_of
from raccoon.model.bemf import counter_lag

LAG_STD = 0.003
"""Standard deviation of the filter's time constant, s. A device's lag is counted in its own samples, some
with a median among them and some not: it differs from the time constant of the simulated filter by half a
sample and one of about 5 ms."""
KNOWN_FIRMWARE_LAG_STD = 0.0005
"""The same, s, if it is known which samples a median saw: the difference of a filter at 4.3 or 5.5 ms from
one at 5 ms, and the error of the firmware's loop rate."""
CYCLE_S = 0.005
"""Time between two back-EMF samples of the simulated controller, s."""
MIN_TIME_CONSTANT_S = 0.001
"""Shortest time constant, s; a shorter one has no effect in a simulation with steps of 1 ms."""


def with_device_filter(device: Device, robot: RobotConfig) -> RobotConfig:
    """The robot with the device's filter as its prior, if its own is only the default.

    device: of the recording. A controller that filters more or less than usual is no defect of the robot and
    must not be named as one. Nothing changes if the device's lag is unknown, if robot.toml gives a filter, or
    if the device's lag is that of robot.toml, as the simulator's is at any rate of its rows.
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
    """Time constant, s, of the filter whose sums have this lag (s); see `counter_lag`."""
    return CYCLE_S / math.log1p(CYCLE_S / lag)
