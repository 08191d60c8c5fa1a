"""A match, and a wall, on a robot that shares no code with the package. benchmarks/matches.py draws many."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from blind.table import HEADING, LEFT, RIGHT, Eye, Floor, Numbers, TableRobot, X, Y, curve
from raccoon import (
    Robot,
    align_on_wall,
    deg,
    follow_line,
    open_robot,
    run_match,
    seq,
    straight,
    wait,
    wait_for_light,
    when,
)
from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.estimate.tophat import calibrate

CONFIG = replace(RobotConfig(), tophats={"front": TophatConfig(0, 0.11, 0.0)})
LIGHT = Numbers(mass=1.9, grip=0.75, coulomb_l=0.166, coulomb_r=0.25, ke_l=1.107, ke_r=1.04, voc=6.4)
"""A robot whose tyres carry 5.6 N each, with two motors that differ as the paper's do."""


@pytest.mark.parametrize(("speed", "askew"), [(0.08, 4.0), (-0.08, -30.0), (0.15, 0.0)])
def test_a_light_robot_squares_up_to_a_wall(speed: float, askew: float) -> None:
    """Its tyres hold less than the motors press with: the wheels spin, and come to stand all the same."""
    port = TableRobot(LIGHT, Floor(walls=((0.25, 0.0, -1.0, 0.0), (-0.25, 0.0, 1.0, 0.0))), seed=4)
    port.place(0.0, 0.0, deg(askew))
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.6))
        robot.odometry.reset(heading=deg(askew))
        robot.run(align_on_wall(speed, heading=0.0))
        robot.run(wait(0.2))
        here = robot.estimate
    assert port.state[HEADING] == pytest.approx(0.0, abs=deg(0.3))
    assert port.state[X] == pytest.approx(math.copysign(0.16, speed), abs=0.002)
    assert port.state[[LEFT, RIGHT]] == pytest.approx(0.0, abs=0.01)
    assert abs(here.x - port.state[X]) < 3.0 * here.x_std


def test_a_match_follows_a_line_around_a_bend_and_ends_with_the_motors_off() -> None:
    bend = 0.25
    floor = Floor(
        (
            (0.1, 0.0, 0.5, 0.0, 0.025),
            *curve(0.5, bend, bend, -math.pi / 2, 0.0, 0.025),
            (0.75, 0.25, 0.75, 2.0, 0.025),
        ),
        patches=((0.3, -0.2, 0.45, -0.02, 0.4),),
        lamp=2.5,
    )
    port = TableRobot(LIGHT, floor, [Eye(0, 0.112, 0.001, 700.0, 3100.0, 8.0, 30.0)], seed=6)
    drawn = np.random.default_rng(2).normal(0.0, 8.0, 200)
    levels = [*(700.0 + drawn), *(3100.0 + drawn)]
    beside: list[float] = []

    def see(_: Robot) -> bool:
        x, y = port.eye_at(port.eyes[0])
        right = -y if x < 0.5 else (math.hypot(x - 0.5, y - bend) - bend if y < bend else x - 0.75)
        beside.append(right - 0.025)
        return False

    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.6))
        robot.tophat("front").calibrate(calibrate(levels))
        program = seq(straight(0.1), follow_line("front", "right", 0.15).until(when(see)))
        report = run_match(robot, program, start=wait_for_light(5), seconds=9.0)
        begun = robot.time - report.seconds
    assert begun == pytest.approx(2.5, abs=0.2)
    assert report.seconds == pytest.approx(9.0, abs=0.01)
    assert not any(port.written.duty)
    for _ in range(100):
        port.read()
    assert port.state[[LEFT, RIGHT]] == pytest.approx(0.0, abs=1e-3)
    assert port.state[Y] > 0.3  # around the bend
    assert np.abs(beside[400:]).max() < 0.003
