"""What the recording's device says of its back-EMF filter, where robot.toml says nothing of its own."""

from __future__ import annotations

from dataclasses import replace

from raccoon.core.config import BemfModel, RobotConfig
from raccoon.core.readings import Device
from raccoon.model.bemf import counter_lag

LAG_STD = 0.003
"""S. A device's lag is counted in its own samples, some with a median among them and some not: half a sample
and one of about 5 ms are between it and the time constant of the simulated filter."""
SHORTEST = 0.001
"""S, a filter of less does nothing in a simulation of steps of 1 ms."""


def with_lag_of(device: Device, robot: RobotConfig, cycle: float = 0.005) -> RobotConfig:
    """The robot with the device's filter as its prior, where its own is only the default.

    device: of the recording. cycle: s between two back-EMF samples of the simulated controller. A controller
    that filters more or less than usual is no defect of the robot, and must not be named as one. Nothing
    changes where the device does not know its lag, where robot.toml gives a filter, and where the device's
    lag is that of robot.toml (a recording of the simulator).
    """
    own, lag = robot.model.bemf.filter_time_constant, device.bemf_lag
    if lag is None or own != BemfModel().filter_time_constant:
        return robot
    if abs(lag - counter_lag(own.value, cycle)) < 1e-6:
        return robot
    value = max(lag, SHORTEST)
    told = replace(own, value=value, std=min(LAG_STD, 0.25 * value))
    return replace(
        robot, model=replace(robot.model, bemf=replace(robot.model.bemf, filter_time_constant=told))
    )
