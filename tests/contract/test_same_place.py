"""One program on three firmwares: Robot, port, bytes, emulated controller and simulated robot."""

import math
from collections.abc import Callable
from itertools import combinations

import pytest

from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.motions.goals import straight, turn
from raccoon.robot.robot import Robot
from raccoon.sim.effects.parameters import Parameters

FIRMWARES: list[Firmware] = ["stock", 17, 21]
CONFIG = RobotConfig()
"""One robot.toml for all of them: what differs between firmwares, the ports know."""


Mission = Callable[[Robot], None]


def corner(robot: Robot) -> None:
    """Rests as before a match, which tells the gyro's bias, then drives around a corner."""
    for _ in range(250):
        robot.tick()
    for motion in (straight(0.2), turn(math.pi / 2), straight(0.15)):
        robot.run(motion)


def end_of(mission: Mission, firmware: Firmware, seed: int) -> tuple[float, float, float]:
    clock = SteppedClock()
    plant = SimulatedPlant(Parameters.from_robot(CONFIG))
    emulator = Emulator(plant, firmware, clock=clock, seed=seed)
    port = WombatPort(emulator, clock=clock, reset_line=emulator)
    with Robot(port, CONFIG) as robot:
        mission(robot)
    assert not port.fault_counts
    assert not emulator.motors_running
    return plant.pose


def test_the_same_mission_ends_at_the_same_place() -> None:
    ends = [end_of(corner, firmware, seed=0) for firmware in FIRMWARES]
    for x, y, heading in ends:
        assert math.dist((x, y), (0.2, 0.15)) < 0.003
        assert math.degrees(heading) == pytest.approx(90.0, abs=0.5)
    for one, other in combinations(ends, 2):
        assert math.dist(one[:2], other[:2]) < 0.002
