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
from raccoon.robot.remarks import OFFSET_REMARK
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


def wrong(counts: float = 0.0) -> RobotConfig:
    """A robot.toml of another controller, whose motors had other offsets."""
    known = MotorConfig(bemf_offset=Measured(counts, 1.0))
    return replace(RobotConfig(), motors={0: known, 1: known})


def test_an_offset_that_robot_toml_excludes_is_said_where_the_robot_does_not_rest_for_long() -> None:
    robot, _ = emulated(17, wrong())
    with robot:
        for _ in range(90):
            robot.tick()
        result = robot.run(straight(0.1))
        assert robot.estimate.status is Status.UNCERTAIN
        assert AT_REST in robot.estimate.reasons
        assert OFFSET_REMARK in result.remarks
        assert OFFSET_REMARK in robot.drive.remarks.values()


@pytest.mark.parametrize(
    ("firmware", "counts", "known"), [("stock", 55.0, 0.0), (21, -90.0, 0.0), ("stock", 75.0, -75.0)]
)
def test_an_offset_that_robot_toml_excludes_is_learnt_in_a_longer_rest(
    firmware: Firmware, counts: float, known: float
) -> None:
    """The heading was 10 to 20 degrees off after the first motion, and further after each. Where robot.toml
    has the wrong sign, the robot crept on, sure of its place."""
    robot, plant = emulated(firmware, wrong(known), counts)
    with robot:
        for _ in range(300):
            robot.tick()
            resting = robot.estimate
            assert abs(resting.x - plant.pose[0]) < 3.0 * resting.x_std
        robot.run(straight(0.1))
        here = robot.estimate
        assert here.status is Status.OK
        assert abs(here.heading - plant.pose[2]) < min(3.0 * here.heading_std, math.radians(3.0))


def test_a_known_offset_that_a_dead_zone_hides_at_rest_turns_nothing() -> None:
    """It was taken for a wheel that creeps back, and the gyro was wrong by what that turns: 2.4 degrees."""
    motors = {port: MotorConfig(bemf_offset=Measured(counts, 1.0)) for port, counts in ((0, 30.0), (1, 0.0))}
    robot, plant = emulated("stock", replace(RobotConfig(), motors=motors), 30.0)
    with robot:
        for _ in range(200):
            assert robot.tick().bemf[0] in (None, 0.0)
        robot.run(straight(0.1))
        assert robot.estimate.status is Status.OK
        assert robot.pose.heading == pytest.approx(plant.pose[2], abs=math.radians(0.2))


def test_an_offset_that_goes_again_is_forgotten() -> None:
    """As one that was learnt while somebody pushed the robot slowly."""
    clock, config = SteppedClock(), RobotConfig()
    emulator = Emulator(SimulatedPlant(Parameters.from_robot(config)), 17, clock=clock, seed=3)
    emulator.faults.bemf_offset = (-55.0, -55.0, 0.0, 0.0)
    with Robot(WombatPort(emulator, clock=clock), config) as robot:
        for _ in range(200):
            robot.tick()
        assert robot.estimate.left_speed == pytest.approx(0.0, abs=0.02)
        emulator.faults.bemf_offset = (0.0, 0.0, 0.0, 0.0)
        for _ in range(300):
            robot.tick()
        assert robot.estimate.left_speed == pytest.approx(0.0, abs=0.02)
        assert robot.estimate.right_speed == pytest.approx(0.0, abs=0.02)
