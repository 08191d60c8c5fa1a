"""How well a robot knows its place after it has pressed against a wall, where its wheels turned on."""

import math

import pytest

from raccoon import RobotConfig, align_on_wall, open_robot, turn, wait
from raccoon.core.clock import SteppedClock
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.table import Wall, World


@pytest.mark.parametrize(
    ("firmware", "speed", "askew"),
    [
        ("stock", -0.06, 0.0),
        (21, -0.15, 0.0),
        ("stock", -0.15, 8.0),
        (21, -0.1, 8.0),
    ],
)
def test_wheels_that_slip_at_a_wall_leave_the_place_in_doubt(
    firmware: Firmware, speed: float, askew: float
) -> None:
    config, clock = RobotConfig(), SteppedClock()
    plant = SimulatedPlant(Parameters.from_robot(config), World(walls=(Wall((-0.13, -1.0), (-0.13, 1.0)),)))
    port = WombatPort(Emulator(plant, firmware, clock=clock), clock=clock)
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(turn(math.radians(askew)))
        robot.run(align_on_wall(speed))
        here = robot.estimate
        off = math.hypot(here.x - plant.pose[0], here.y - plant.pose[1])
        std = math.hypot(here.x_std, here.y_std)
        assert off < 3.0 * std
        assert std < max(3.0 * off, 0.015)  # and not in more than it must be


def test_a_turn_that_starts_at_a_wall_leaves_the_place_in_doubt() -> None:
    """A corner of the robot pushes it 37 mm back from the wall, and both wheels slip for it."""
    config, clock = RobotConfig(), SteppedClock()
    plant = SimulatedPlant(Parameters.from_robot(config), World(walls=(Wall((0.095, -1.0), (0.095, 1.0)),)))
    port = WombatPort(Emulator(plant, clock=clock), clock=clock)
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.3))
        robot.run(turn(math.radians(90.0)))
        here = robot.estimate
    off = math.hypot(here.x - plant.pose[0], here.y - plant.pose[1])
    assert 0.02 < off < 2.0 * math.hypot(here.x_std, here.y_std)
