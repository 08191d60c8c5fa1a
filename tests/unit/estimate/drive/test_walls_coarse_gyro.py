"""A gyro that is read every 20 ms, as RaccoonOS does: it misses when a wall turns a robot, and even that."""

import math

import pytest

from drive_traces import drive
from raccoon import deg, open_robot, race, turn, wait
from raccoon import drive as go
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.readings import SIMULATOR, Inputs
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.readings import DriveReadings
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import open_emulated
from raccoon.sim.world.table import Wall, World

FIRMWARE: Firmware = 17


def wall(askew: float, distance: float) -> World:
    """One across the way ahead, m away, rad askew."""
    x, y = distance * math.cos(askew), distance * math.sin(askew)
    along = math.sin(askew), -math.cos(askew)
    return World(walls=(Wall((x + along[0], y + along[1]), (x - along[0], y - along[1])),))


def test_a_robot_that_a_wall_turns_between_two_readings_is_unsure_of_its_heading() -> None:
    """It turned by 1 degree, of which the gyro read a tenth, and claimed to know it to a tenth."""
    port = open_emulated(RobotConfig(), FIRMWARE, seed=1000, world=wall(deg(1.0), 0.15))
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(wait(0.8))
        robot.run(race(go(0.19), wait(1.2)))
        found = robot.estimate
        truth = port._link._board._plant.pose  # type: ignore[attr-defined]
    assert abs(found.heading - truth[2]) < 2.5 * found.heading_std
    assert found.heading_std < deg(1.2)


def test_a_turn_on_a_free_floor_is_as_sure_as_ever() -> None:
    config = parse_robot({"model": {"imu": {"gyro_scale": {"value": 1.0, "std": 0.0005}}}})
    with open_robot(config, port=open_emulated(config, FIRMWARE)) as robot:
        robot.run(wait(0.8))
        robot.run(turn(deg(90.0)))
        assert robot.estimate.heading_std < deg(0.2)


def sharp(every: int, jump: float) -> float:
    """rad that are in doubt by a turn rate which jumps by rad/s from one reading to the next, ms apart."""
    readings = DriveReadings(RobotConfig())
    for cycle in range(9):
        rate = jump / SIMULATOR.gyro_rad_s if cycle > 4 else 0.0
        readings.take(Inputs(0.001 * every * cycle, SIMULATOR, gyro=(0.0, float(cycle % 2), rate)))
    return readings.pending.gyro_sharp_turn


@pytest.mark.parametrize("every", [5, 20])
def test_a_rate_that_jumps_is_dated_no_better_than_readings_come(every: int) -> None:
    assert sharp(every, 1.2) == pytest.approx((1.2 - 0.03 * every) * 0.001 * every)
    assert sharp(every, 0.02 * every) == 0.0  # as fast as motions turn


def test_what_was_not_seen_is_in_doubt_once_for_each_thing_that_is_run_into() -> None:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(1.0, 0.0, 0.0), (1.0, 0.2, 0.0)], gyro_every=4):
        odometry.update(inputs, command)
    touch, found = odometry._stepper.contact, []
    for step in range(100):
        touch._is_in_contact = step in (10, 11, 20, 80)
        found.append(touch.unseen_turn_std(0.02, 0.02))
    assert [step for step, each in enumerate(found) if each > 0.0] == [10, 80]
    # One corner stands, the other wheel goes on: 0.2 m/s over half a track for 20 ms is the most.
    assert 0.1 < found[10] / (0.2 / 0.08 * 0.02) < 0.5
    touch._is_in_contact, touch._seconds_since_contact = True, 1.0
    assert touch.unseen_turn_std(0.02, 0.005) == 0.0
