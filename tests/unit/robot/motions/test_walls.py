"""Walls behind the emulated controllers: squaring up (on the simulator's own port: test_lines), running into
one."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from raccoon import (
    Action,
    MotionResult,
    after_distance,
    align_on_wall,
    arc,
    bumped,
    calibrate_drive,
    calibrate_tophats,
    drive,
    drive_to,
    follow_path,
    open_robot,
    seq,
    straight,
    turn,
    wait,
)
from raccoon.cli.main import main
from raccoon.core.config import BodyConfig, RobotConfig, TophatConfig
from raccoon.core.errors import CalibrationError, MotionTimeout
from raccoon.core.port import Port
from raccoon.core.readings import Device, Status
from raccoon.estimate.drive.estimate import HELD
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.robot.robot import Robot
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Box, Ramp, Wall, World


def remembered(monkeypatch: pytest.MonkeyPatch) -> list[SimulatedPlant]:
    """The plants of the emulated robots that are opened from now on."""
    plants: list[SimulatedPlant] = []

    def made(parameters: Parameters, world: World | None, device: Device) -> SimulatedPlant:
        plants.append(SimulatedPlant(parameters, world, device))
        return plants[-1]

    monkeypatch.setattr("raccoon.robot.emulated.SimulatedPlant", made)
    return plants


def opened(config: RobotConfig, firmware: Firmware | None, world: World) -> Port:
    """The robot on a table behind an emulated firmware; None: on the simulator's own port."""
    if firmware is None:
        return SimPort(Parameters.from_robot(config), world)
    return open_emulated(config, firmware, world=world)


def ahead(distance: float) -> World:
    """A wall that a robot drives into square, that far ahead of its origin."""
    return World(walls=(Wall((distance, -1.0), (distance, 1.0)),))


@pytest.mark.parametrize(
    ("firmware", "sign", "given"),
    [("stock", -1.0, False), (21, 1.0, True)],
)
def test_a_robot_squares_up_to_a_wall_and_its_odometry_knows(
    firmware: Firmware, sign: float, given: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plants = remembered(monkeypatch)
    askew = math.radians(30.0)
    middle = 0.18 * sign * math.cos(askew), 0.18 * sign * math.sin(askew)
    along = -math.sin(askew), math.cos(askew)
    start, end = ((middle[0] + k * along[0], middle[1] + k * along[1]) for k in (-1.0, 1.0))
    config = RobotConfig()
    port = open_emulated(config, firmware, world=World(walls=(Wall(start, end),)))
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
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


@pytest.mark.parametrize(("firmware", "speed"), [("stock", -0.15), (21, 0.15)])
def test_a_robot_that_runs_into_a_wall_is_bumped(
    firmware: Firmware, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    plants = remembered(monkeypatch)
    config = RobotConfig()
    reach = 0.12 + config.body.front
    with open_robot(
        config, port=open_emulated(config, firmware, world=ahead(math.copysign(reach, speed)))
    ) as robot:
        robot.run(wait(0.4))
        robot.run(drive(speed).until(bumped()).timeout(0.12 / abs(speed) + 1.0))
        assert abs(plants[0].pose[0]) == pytest.approx(0.12, abs=0.002)
        assert abs(robot.estimate.x) < 0.12 + 0.3 * abs(speed)


def test_a_robot_whose_wheels_spin_at_a_wall_knows_how_little_it_knows() -> None:
    config = RobotConfig()
    world = ahead(0.1 + config.body.front)
    with open_robot(config, port=opened(config, None, world)) as robot:
        robot.run(wait(0.4))
        with pytest.raises(MotionTimeout):
            robot.run(drive(0.15).timeout(2.5))
        here = robot.estimate
        assert HELD in here.reasons
        assert here.status is not Status.OK
        assert 0.1 < here.x - 0.1 < 2.0 * here.x_std
        assert here.y_std < 0.005
        assert here.heading_std < math.radians(1.0)
        robot.run(wait(0.3))
        assert robot.odometry.observe_line((0.1, 0.0), 0.5 * math.pi, sensor=(0.0, 0.0), std=0.003).accepted
        assert robot.estimate.x == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize(
    ("firmware", "motion"),
    [
        (None, drive_to(0.3, 0.0)),
        ("stock", straight(-0.3)),
        (21, follow_path([(0.3, 0.0)])),
    ],
    ids=str,
)
def test_a_motion_that_ends_at_a_wall_says_that_it_did_not_arrive(
    firmware: Firmware | None, motion: Action[MotionResult], caplog: pytest.LogCaptureFixture
) -> None:
    """Its wheels came to the goal: what tells is how much of the way they carried what tyres grip with."""
    config = RobotConfig()
    reach = 0.1 + config.body.front
    world = World(walls=(*ahead(reach).walls, *ahead(-reach).walls))
    with open_robot(config, port=opened(config, firmware, world)) as robot:
        robot.run(wait(0.4))
        result = robot.run(motion)
        assert not result.arrived
        assert result.held == pytest.approx(0.2, abs=0.015)
        assert "before its goal" in caplog.text
        away = robot.run(straight(math.copysign(0.05, -robot.pose.x)))  # of what held before nothing counts
        assert away.arrived


def test_a_light_robot_with_little_grip_did_not_arrive_either() -> None:
    config = RobotConfig(body=BodyConfig(mass=2.5, grip=0.65))
    with open_robot(config, port=opened(config, None, ahead(0.1 + config.body.front))) as robot:
        robot.run(wait(0.6))
        result = robot.run(straight(0.3))
        assert result.held == pytest.approx(0.2, abs=0.015)
        assert robot.estimate.x_std > 0.15


def test_a_path_whose_corner_lies_behind_a_wall_is_given_up_at_the_wall() -> None:
    """Not after twice the time of the whole path, spinning its wheels: 38 s of a match of 120."""
    config = RobotConfig()
    with open_robot(config, port=opened(config, None, ahead(0.1 + config.body.front))) as robot:
        robot.run(wait(0.4))
        begin = robot.time
        with pytest.raises(MotionTimeout, match="path not done"):
            robot.run(follow_path([(0.3, 0.0), (0.3, 0.6), (0.0, 0.6), (0.0, 1.2)]))
        assert robot.time - begin < 6.0


def test_a_drive_over_lines_that_a_wall_holds_says_so() -> None:
    """The pose is 23 cm off by it, and that there is no line is no wonder."""
    config = RobotConfig(tophats={"left": TophatConfig(0, 0.1, 0.03), "right": TophatConfig(1, 0.1, -0.03)})
    with open_robot(config, port=opened(config, None, ahead(0.25))) as robot:
        robot.run(wait(0.5))
        with pytest.raises(CalibrationError, match=r"stood at a wall for 0\.2[2-4] m of it$"):
            calibrate_tophats(robot, 0.4)
        assert any("drive may have ended 0.2" in each for each in robot.drive.remarks.values())


def test_a_motion_that_nothing_holds_arrived() -> None:
    config = RobotConfig()
    with open_robot(config, port=opened(config, 21, ahead(0.3 + config.body.front))) as robot:
        robot.run(wait(0.4))
        for motion in (straight(0.2), turn(math.radians(60.0)), straight(-0.05), straight(0.02)):
            result = robot.run(motion)
            assert result.arrived
            assert result.held == 0.0


def test_a_robot_that_is_bumped_at_once_backs_off_and_comes_again() -> None:
    config = RobotConfig()
    with open_robot(
        config, port=open_emulated(config, "stock", world=ahead(0.05 + config.body.front))
    ) as robot:
        robot.run(wait(0.4))
        for _ in range(2):
            robot.run(drive(0.1).until(bumped()).timeout(2.0))
            robot.run(straight(-0.06))
            assert HELD not in robot.estimate.reasons
        robot.run(turn(math.radians(90.0)))
        assert HELD not in robot.estimate.reasons


def test_a_carpet_and_a_ramp_are_no_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    plants = remembered(monkeypatch)
    config = RobotConfig()
    floor = Parameters.from_robot(config)
    carpet = floor.with_effect("friction.coulomb", torque=2.0 * config.model.friction.coulomb.value)
    uphill = floor.with_effect("drive.slope", along_x=-0.088, along_y=0.0)  # 10 degrees
    with open_robot(config, port=open_emulated(config, 21)) as robot:
        robot.run(wait(0.3))
        for part in (floor, carpet, uphill, floor):
            plants[0].become(part)
            robot.run(wait(0.4))  # it is set down on another slope, and feels its weight there
            with pytest.raises(MotionTimeout):
                robot.run(drive(0.15).until(bumped()).timeout(0.8))
            robot.run(straight(-0.05))


def test_the_ridge_of_a_ramp_is_no_bump() -> None:
    """At 0.2 m/s its accelerometer feels twice the slope within half a second: only the gyro tells why."""
    config = RobotConfig()
    up, down = Box((0.2, -5.0), (0.5, 5.0)), Box((0.5, -5.0), (0.8, 5.0))
    world = World(ramps=(Ramp(up, -0.088), Ramp(down, 0.088)))  # 10 degrees
    with open_robot(config, port=opened(config, None, world)) as robot:
        robot.run(wait(0.6))
        robot.run(drive(0.19).until(bumped() | after_distance(0.9)))
        assert robot.estimate.x > 0.88


def test_going_on_from_a_rest_on_a_ramp_is_no_bump() -> None:
    """Its weight was learnt while it drove up, and not forgotten when it stood."""
    config = RobotConfig()
    world = World(ramps=(Ramp(Box((0.1, -5.0), (5.0, 5.0)), -0.088),))  # 10 degrees
    with open_robot(config, port=opened(config, None, world)) as robot:
        robot.run(wait(0.5))
        for pause, way in ((0.0, 0.4), (0.1, 0.1), (0.4, 0.1), (0.7, 0.1)):
            robot.run(wait(pause))
            begin = robot.estimate.distance
            robot.run(drive(0.15).until(bumped() | after_distance(way)))
            assert robot.estimate.distance - begin > 0.99 * way, pause


def test_wheels_that_spun_at_a_wall_calibrate_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """However honest the tape is."""
    config = RobotConfig()
    file, toml = tmp_path / "run.jsonl.gz", tmp_path / "robot.toml"
    toml.write_text("", encoding="utf-8")
    with (
        open_robot(config, port=opened(config, None, ahead(0.3)), record=file) as robot,
        pytest.raises(CalibrationError, match="the wheels may have spun for"),
    ):
        calibrate_drive(robot, lambda: 0.22, distance=0.45)
    assert main(["calibrate", "drive", str(file), "--robot", str(toml), "--straight", "0.22"]) != 0
    assert "the wheels may have spun for" in capsys.readouterr().err


def test_a_free_way_calibrates_and_a_tape_read_wrong_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, toml = tmp_path / "run.jsonl.gz", tmp_path / "robot.toml"
    toml.write_text("", encoding="utf-8")
    with open_robot(RobotConfig(), port=opened(RobotConfig(), None, World()), record=file) as robot:
        calibrate_drive(robot, lambda: 0.5)
        (remark,) = robot.drive.remarks.values()
        assert "read the tape again" in remark
    straight_drive = ["calibrate", "drive", str(file), "--robot", str(toml), "--straight"]
    assert main([*straight_drive, "0.6"]) == 0
    assert "look here" not in capsys.readouterr().out
    assert main([*straight_drive, "0.5"]) == 0
    assert "read the tape again" in capsys.readouterr().out


AT_THE_BORDER: dict[str, Callable[[], Action[Any]]] = {
    "path": lambda: follow_path([(0.5, 0.45), (0.7, 0.5)]),
    "arc": lambda: arc(0.25, math.radians(-90.0)),
    "drive": lambda: drive(0.15, -0.6).timeout(8.0),
}


@pytest.mark.parametrize("name", AT_THE_BORDER)
def test_after_wheels_that_spun_at_the_border_the_next_motion_drives_its_distance(name: str) -> None:
    config, begin = RobotConfig(), (0.5, 0.2, math.radians(90.0))
    port = SimPort(Parameters.from_robot(config), World.default(), seed=1, start=begin)
    with open_robot(config, port=port) as robot:
        robot.odometry.reset(*begin)
        robot.run(seq(wait(0.5), straight(0.1)))
        with pytest.raises(MotionTimeout):
            robot.run(AT_THE_BORDER[name]())
        assert any("as at a wall: end the motion there" in each for each in robot.drive.remarks.values()) is (
            name == "drive"  # which has no goal that it would miss
        )
        assert robot.odometry.wheel_scales == pytest.approx((1.0, 1.0), abs=0.01)
        assert robot.estimate is not None
        assert abs(robot.estimate.velocity) < 0.3
        for _ in range(2):
            before = truth_of(robot)
            robot.run(straight(-0.15))
            after = truth_of(robot)
            assert math.dist(before, after) == pytest.approx(0.15, abs=0.005)


def truth_of(robot: Robot) -> tuple[float, float]:
    """m, where a simulated robot is."""
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    return robot.inputs.truth.x, robot.inputs.truth.y
