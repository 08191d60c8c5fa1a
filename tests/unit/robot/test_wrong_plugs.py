"""A robot that is wired otherwise than robot.toml says stops soon, and says what is wrong."""

import pytest

from raccoon import (
    Action,
    MotionTimeout,
    RobotConfig,
    after_time,
    deg,
    drive,
    open_robot,
    straight,
    turn,
    wait,
)
from raccoon.core.config import DriveConfig, MotorConfig
from raccoon.core.port import Port
from raccoon.core.readings import Status
from raccoon.robot.emulated import open_emulated
from raccoon.robot.motions import MotionResult
from raccoon.sim.world import World
from robots import simulated

TURNED = MotorConfig(inverted=True)
LEFT = "as if the left motor (port 0) were plugged in the other way round: turn its plug, or write inverted ="
OTHER_WAY = "turns the other way than its wheels say: left and right are exchanged"
STUCK = "the wheels turn, and the robot does not: one motor is plugged in the other way round, or the robot"


def wired(config: RobotConfig, behind: str) -> Port:
    """A robot whose cables are as this robot.toml has them."""
    if behind == "simulator":
        return simulated(config=config, world=World.empty())
    return open_emulated(config, "stock" if behind == "stock" else 21, world=World.empty())


@pytest.mark.parametrize("behind", ["simulator", "stock", "RaccoonOS"])
@pytest.mark.parametrize(
    ("cables", "motion", "said"),
    [
        (RobotConfig(motors={0: TURNED}), straight(0.3), LEFT + " true under [motor.0]"),
        (RobotConfig(motors={0: TURNED}), turn(deg(90)), STUCK),
        (RobotConfig(motors={0: TURNED, 1: TURNED}), turn(deg(90)), OTHER_WAY),
        (RobotConfig(drive=DriveConfig(left=1, right=0)), turn(deg(90)), OTHER_WAY),
    ],
    ids=["one, straight", "one, turn", "both", "exchanged"],
)
def test_a_motion_ends_soon_and_says_what_is_wrong(
    cables: RobotConfig, motion: Action[MotionResult], said: str, behind: str
) -> None:
    """It went on for twice its time, and blamed the battery and slip."""
    with open_robot(RobotConfig(), port=wired(cables, behind)) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        with pytest.raises(MotionTimeout) as error:
            robot.run(motion)
        assert said in str(error.value)
        assert "battery" not in str(error.value)
        assert robot.time - begin < 1.0
        assert robot.outputs.duty == (0.0,) * 4


@pytest.mark.parametrize("behind", ["simulator", "stock"])
def test_straight_ahead_it_is_said_once_the_heading_is_corrected_the_wrong_way(behind: str) -> None:
    """At first the gyro sees nothing of two motors that are both the other way round."""
    cables = RobotConfig(motors={0: TURNED, 1: TURNED})
    with open_robot(RobotConfig(), port=wired(cables, behind)) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        with pytest.raises(MotionTimeout, match=OTHER_WAY):
            robot.run(straight(0.3))
        assert robot.time - begin < 5.0


def test_a_drive_without_a_goal_says_it_in_the_log_and_calls_its_pose_invalid(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The sign that is to be written is the other one than is written."""
    config = RobotConfig(motors={0: TURNED})
    with open_robot(config, port=wired(RobotConfig(), "simulator")) as robot:
        robot.run(wait(1.0))
        robot.run(drive(0.1).until(after_time(1.0)))
        assert robot.estimate.status is Status.INVALID
    assert [record.message for record in caplog.records if LEFT + " false under [motor.0]" in record.message]
