"""Remarks: each once, however its numbers change, and of each part."""

import pytest

from raccoon import RobotConfig
from raccoon.robot.remarks import add_remark
from raccoon.robot.robot_state import RobotState
from standing_port import StandingPort


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ("x is 0.12 m off, 3 % (+- 1.5e-05)", "x is -4 m off, 25 % (+- 0.2)", 1),
        ("tophat line1 is not read", "tophat line2 is not read", 2),
        ("no motion at arm_1 (motor port 2)", "no motion at arm_1 (motor port 3)", 2),
        ("analog 0: too bright", "analog 1: too bright", 2),
    ],
    ids=["numbers", "names", "ports", "analog ports"],
)
def test_a_remark_is_made_once_of_each_part(first: str, second: str, told: int) -> None:
    robot = RobotState(StandingPort(), RobotConfig())
    for each in (first, second, first, second):
        add_remark(robot, each)
    assert len(robot.drive.remarks) == told
