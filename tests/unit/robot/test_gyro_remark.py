"""A gyro's scale that walls show to be another one than robot.toml's is said."""

import math

import pytest

from raccoon import open_robot, turn, wait
from raccoon.core.config import RobotConfig
from robots import simulated_port


@pytest.mark.parametrize(("factor", "said"), [(1.02, True), (1.0, False)])
def test_walls_that_show_another_scale_of_the_gyro_name_it(factor: float, said: bool) -> None:
    port = simulated_port(config=RobotConfig(), effects={"imu.gyro_scale": {"factor": factor}})
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(wait(0.5))
        for _ in range(4):
            robot.run(turn(math.pi))
            assert robot.inputs is not None
            assert robot.inputs.truth is not None
            assert robot.odometry.observe_heading(robot.inputs.truth.heading, math.radians(0.7)).accepted
        robot.run(turn(0.1))
        found = [each for each in robot.drive.remarks.values() if "the gyro reads" in each]
    assert len(found) == said
    assert not said or "correct gyro_scale" in found[0]
