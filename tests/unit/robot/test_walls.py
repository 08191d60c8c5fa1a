"""Squaring up to a wall behind the emulated controllers (the simulator's own port: test_lines)."""

from __future__ import annotations

import math

import pytest

from raccoon import align_on_wall, open_robot, wait
from raccoon.core.config import RobotConfig
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.sim.parameters import Parameters
from raccoon.sim.world import Wall, World


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("firmware", ["stock", 21])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_robot_squares_up_to_a_wall_and_its_odometry_knows(
    firmware: Firmware, sign: float, given: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plants = []

    def remembered(parameters: Parameters, world: World | None) -> SimulatedPlant:
        plants.append(SimulatedPlant(parameters, world))
        return plants[-1]

    monkeypatch.setattr("raccoon.robot.emulated.SimulatedPlant", remembered)
    askew = math.radians(10.0)
    middle = 0.2 * sign * math.cos(askew), 0.2 * sign * math.sin(askew)
    along = -math.sin(askew), math.cos(askew)
    start, end = ((middle[0] + k * along[0], middle[1] + k * along[1]) for k in (-1.0, 1.0))
    config = RobotConfig()
    port = open_emulated(config, firmware, world=World(walls=(Wall(start, end),)))
    with open_robot(config, port=port) as robot:
        robot.run(wait(1.0))
        result = robot.run(align_on_wall(0.08 * sign, heading=askew if given else None))
        robot.run(wait(0.2))
        (plant,) = plants
        assert plant.pose[2] == pytest.approx(askew, abs=math.radians(0.2))
        # What wheels do at a wall costs the odometry as much as a slip (docs/odometry.md).
        assert robot.estimate.heading == pytest.approx(plant.pose[2], abs=math.radians(0.3))
        assert result.heading == pytest.approx(0.0, abs=math.radians(0.3))  # before it was told
        # A turn that a wall begins and ends between two readings of the gyro: it says how well it is known.
        assert abs(robot.estimate.heading - plant.pose[2]) < 2.5 * robot.estimate.heading_std
        assert robot.estimate.heading_std < math.radians(0.25)
