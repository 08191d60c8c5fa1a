"""What robot.toml's calibrated counters say about the robot to be simulated.

A tick of one firmware is worth up to 181 of another's, and teams use their calibrated robot.toml in the
simulator. A plausible difference of `radians_per_tick` from the nominal one is taken for the motor's K_E. A
larger one, which no motor has, belongs to another firmware's counter, and the simulated controller counts in
its ticks.
"""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device
from raccoon.model.bemf import counts_scale, is_plausible_k_e_share
from raccoon.sim.effects.parameters import SIDES, Parameters


def simulated_device(robot: RobotConfig) -> Device:
    """The simulator's device, with the ticks of robot.toml."""
    factors = [calibrated_factor(robot, side, SIMULATOR) for side in SIDES if _calibrated(robot, side)]
    middle = math.exp(sum(map(math.log, factors)) / len(factors)) if factors else 1.0
    if is_plausible_k_e_share(middle):
        return SIMULATOR
    return replace(SIMULATOR, position_counts_seconds=1.0 / middle)


def calibrated_factor(robot: RobotConfig, side: str, device: Device) -> float:
    """K_E by the calibrated ticks of a side's motor, relative to that of `[model]`; 1 if it is not
    calibrated. device: whose ticks they are."""
    model = getattr(robot.model, side).back_emf_constant.value
    return float(device.bemf_volts / counts_scale(robot, side, device) / model)


def calibrated_robot(robot: RobotConfig, device: Device) -> Parameters:
    """The robot of robot.toml with its calibrated motors, behind this device."""
    parameters = Parameters.from_robot(robot)
    for side in SIDES:
        factor = calibrated_factor(robot, side, device)
        if _calibrated(robot, side) and is_plausible_k_e_share(factor):
            parameters = parameters.with_effect("motor.back_emf_constant", side, factor=factor)
    return parameters


def _calibrated(robot: RobotConfig, side: str) -> bool:
    return robot.wheel_motor(side).radians_per_tick is not None
