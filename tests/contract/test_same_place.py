"""One program on three firmwares: Robot, port, bytes, emulated controller and simulated robot."""

import math
from dataclasses import replace

import pytest

from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, RobotConfig
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.motions import straight, turn
from raccoon.robot.robot import Robot
from raccoon.sim.parameters import Parameters

FILTER_SECONDS: dict[Firmware, float] = {"stock": 0.0148, 17: 0.0247, 21: 0.0247}
"""Of each firmware's back-EMF filter: weight 1/4 at 235 Hz, and 1/5 at 181 Hz."""


def config_for(firmware: Firmware) -> RobotConfig:
    config = RobotConfig()
    bemf = replace(config.model.bemf, filter_time_constant=Measured(FILTER_SECONDS[firmware], 0.0005))
    return replace(config, model=replace(config.model, bemf=bemf))


def mission(robot: Robot) -> None:
    robot.run(straight(0.5))
    robot.run(turn(math.pi / 2))


def end_of(firmware: Firmware, seed: int) -> tuple[float, float, float]:
    config = config_for(firmware)
    clock = SteppedClock()
    plant = SimulatedPlant(Parameters.from_robot(config))
    emulator = Emulator(plant, firmware, clock=clock, seed=seed)
    port = WombatPort(emulator, clock=clock, reset_line=emulator)
    with Robot(port, config) as robot:
        mission(robot)
    assert not port.fault_counts
    assert not emulator.motors_running
    return plant.pose


@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_mission_ends_at_the_same_place(seed: int) -> None:
    ends = [end_of(firmware, seed) for firmware in FILTER_SECONDS]
    for x, y, heading in ends:
        assert math.hypot(x - 0.5, y) < 0.003
        assert heading == pytest.approx(math.pi / 2, abs=math.radians(0.5))
        for other_x, other_y, _ in ends:
            assert math.hypot(x - other_x, y - other_y) < 0.002
