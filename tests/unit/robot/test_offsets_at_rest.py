"""Motors that read motion at rest: an offset that nobody told of is learnt, one that contradicts is said."""

import math
from dataclasses import replace

import pytest

from raccoon import Robot, RobotConfig, straight
from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, MotorConfig
from raccoon.core.readings import Fault, Status
from raccoon.estimate.drive.estimate import AT_REST
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.remarks import OFFSET
from raccoon.sim.effects.parameters import Parameters


def emulated(firmware: Firmware, config: RobotConfig, counts: float = 55.0) -> tuple[Robot, SimulatedPlant]:
    """A robot whose left motor reads so many counts too much."""
    clock, plant = SteppedClock(), SimulatedPlant(Parameters.from_robot(config))
    emulator = Emulator(plant, firmware, clock=clock, seed=3)
    emulator.faults.bemf_offset = (counts, 0.0, 0.0, 0.0)
    return Robot(WombatPort(emulator, clock=clock), config), plant


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_an_offset_that_was_learnt_at_rest_is_no_doubt(firmware: Firmware) -> None:
    robot, plant = emulated(firmware, RobotConfig())
    with robot:
        for _ in range(200):
            faults = robot.tick().faults
        assert Fault.BEMF_INVALID in faults  # of the controller, as the doctor would say
        result = robot.run(straight(0.1))
        assert robot.estimate.status is Status.OK
        assert not result.remarks
        assert robot.pose.x == pytest.approx(plant.pose[0], abs=0.002)
        assert robot.pose.heading == pytest.approx(plant.pose[2], abs=math.radians(0.2))


def test_an_offset_that_robot_toml_excludes_is_said() -> None:
    known = MotorConfig(bemf_offset=Measured(0.0, 1.0))
    robot, _ = emulated(17, replace(RobotConfig(), motors={0: known, 1: known}))
    with robot:
        for _ in range(200):
            robot.tick()
        result = robot.run(straight(0.1))
        assert robot.estimate.status is Status.UNCERTAIN
        assert AT_REST in robot.estimate.reasons
        assert OFFSET in result.remarks
        assert OFFSET in robot.drive.remarks.values()


def test_a_known_offset_that_a_dead_zone_hides_at_rest_turns_nothing() -> None:
    """It was taken for a wheel that creeps backwards, and the gyro was wrong by what that turns: 2.4 degrees."""
    motors = {port: MotorConfig(bemf_offset=Measured(counts, 1.0)) for port, counts in ((0, 30.0), (1, 0.0))}
    robot, plant = emulated("stock", replace(RobotConfig(), motors=motors), 30.0)
    with robot:
        for _ in range(200):
            assert robot.tick().bemf[0] in (None, 0.0)
        robot.run(straight(0.1))
        assert robot.estimate.status is Status.OK
        assert robot.pose.heading == pytest.approx(plant.pose[2], abs=math.radians(0.2))
