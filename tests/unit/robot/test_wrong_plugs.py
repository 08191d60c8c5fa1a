"""A robot that is wired otherwise than robot.toml says stops soon, and says what is wrong."""

from dataclasses import replace

import pytest

from raccoon import (
    Action,
    MotionTimeout,
    RobotConfig,
    after_time,
    deg,
    drive,
    follow_line,
    motors,
    open_robot,
    straight,
    turn,
    wait,
)
from raccoon.core.config import DriveConfig, MotorConfig
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Status
from raccoon.estimate.tophat import calibrate
from raccoon.robot.emulated import open_emulated
from raccoon.robot.motions.goals import MotionResult
from raccoon.sim.world.table import World
from robots import CONFIG, InterceptingPort, simulated_port

TURNED = MotorConfig(inverted=True)
LEFT = (
    "as if the left motor (port 0) were plugged in the other way round: turn its plug round, "
    "or write inverted ="
)
OTHER_WAY = "turns in the opposite direction to its wheels: left and right are exchanged"
STUCK = "the wheels turn but the robot does not: one motor is plugged in the other way round, or the robot"


def wired(config: RobotConfig, behind: str) -> Port:
    """A robot whose cables are as this robot.toml has them."""
    if behind == "simulator":
        return simulated_port(config=config, world=World.empty())
    return open_emulated(config, "stock" if behind == "stock" else 21, world=World.empty())


@pytest.mark.parametrize(
    ("cables", "motion", "said", "behind"),
    [
        (RobotConfig(motors={0: TURNED}), straight(0.3), LEFT + " true under [motor.0]", "simulator"),
        (RobotConfig(motors={0: TURNED}), straight(0.3), LEFT + " true under [motor.0]", "RaccoonOS"),
        (RobotConfig(motors={0: TURNED}), turn(deg(90)), STUCK, "stock"),
        (RobotConfig(motors={0: TURNED, 1: TURNED}), turn(deg(90)), OTHER_WAY, "stock"),
        (RobotConfig(drive=DriveConfig(left=1, right=0)), turn(deg(90)), OTHER_WAY, "RaccoonOS"),
    ],
)
def test_a_motion_ends_soon_and_says_what_is_wrong(
    cables: RobotConfig, motion: Action[MotionResult], said: str, behind: str
) -> None:
    """It went on for twice its time, and blamed the battery and slip."""
    with open_robot(RobotConfig(), port=wired(cables, behind)) as robot:
        robot.run(wait(0.5))
        begin = robot.time
        with pytest.raises(MotionTimeout) as error:
            robot.run(motion)
        assert said in str(error.value)
        assert "battery" not in str(error.value)
        assert robot.time - begin < 1.0
        assert robot.outputs.duty == (0.0,) * 4


def test_a_gyro_that_is_upside_down_is_told_from_wheels_that_are_exchanged() -> None:
    def turned(inputs: Inputs) -> Inputs:
        (gyro_x, gyro_y, gyro_z), (x, y, z) = inputs.gyro or (0.0, 0.0, 0.0), inputs.accel or (0.0, 0.0, 0.0)
        return replace(inputs, gyro=(gyro_x, -gyro_y, -gyro_z), accel=(x, -y, -z))

    upside_down = InterceptingPort(wired(RobotConfig(), "simulator"), seen=turned)
    exchanged = wired(RobotConfig(drive=DriveConfig(left=1, right=0)), "simulator")
    for port, said, unsaid in (
        (upside_down, "upside down", "exchanged"),
        (exchanged, "exchanged", "upside down"),
    ):
        with open_robot(RobotConfig(), port=port) as robot:
            robot.run(wait(0.5))
            with pytest.raises(MotionTimeout, match=said) as error:
                robot.run(turn(deg(90)))
            assert unsaid not in str(error.value)


def test_straight_ahead_it_is_said_once_the_heading_is_corrected_the_wrong_way() -> None:
    """At first the gyro sees nothing of two motors that are both the other way round."""
    cables = RobotConfig(motors={0: TURNED, 1: TURNED})
    with open_robot(RobotConfig(), port=wired(cables, "simulator")) as robot:
        robot.run(wait(0.5))
        begin = robot.time
        with pytest.raises(MotionTimeout, match=OTHER_WAY):
            robot.run(straight(0.3))
        assert robot.time - begin < 5.0


@pytest.mark.parametrize("behind", ["simulator", "stock"])
def test_a_drive_without_a_goal_ends_as_soon(behind: str) -> None:
    """It held its heading the wrong way and spun faster and faster, and the timeout blamed a fuse.
    The sign that is to be written is the other one than is written."""
    config = RobotConfig(motors={0: TURNED})
    with open_robot(config, port=wired(RobotConfig(), behind)) as robot:
        robot.run(wait(0.5))
        begin = robot.time
        with pytest.raises(MotionTimeout, match=r"^drive 0\.1 m/s: the robot turns as if") as error:
            robot.run(drive(0.1).until(after_time(5.0)))
        assert LEFT + " false under [motor.0]" in str(error.value)
        assert robot.time - begin < 1.0
        assert robot.outputs.duty == (0.0,) * 4
        assert robot.estimate.status is Status.INVALID


def test_a_line_is_not_looked_for_with_motors_the_wrong_way_round() -> None:
    port = wired(RobotConfig(motors={0: TURNED}), "simulator")
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(
                calibrate([400.0 + i % 5 for i in range(200)] + [2900.0 + i % 9 for i in range(200)])
            )
        robot.run(wait(0.5))
        begin = robot.time
        with pytest.raises(MotionTimeout, match="plugged in the other way round"):
            robot.run(follow_line("left"))
        assert robot.time - begin < 3.0
        assert robot.outputs.duty == (0.0,) * 4


def test_plain_duties_go_on_and_the_log_says_it(caplog: pytest.LogCaptureFixture) -> None:
    """They are under no control that could run away, and may be what finds out which motor is which."""
    with open_robot(RobotConfig(), port=wired(RobotConfig(motors={0: TURNED}), "simulator")) as robot:
        robot.run(wait(0.5))
        robot.run(motors(0.5, 0.5).until(after_time(1.5)))
    assert [record.message for record in caplog.records if LEFT + " true under [motor.0]" in record.message]
