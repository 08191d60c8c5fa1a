"""What slow motions tell of the scales: nothing."""

from itertools import pairwise

import numpy as np
import pytest

from raccoon import open_robot, straight
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.prior import prior, process_noise
from raccoon.estimate.ekf.filter import DriveFilter, covariance_index, variance_index
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.drive import DriveGeometry
from raccoon.robot.emulated import open_emulated
from raccoon.sim.world.table import World


def driven(velocity: float, turn_rate: float, wheel_turn: float = 1.0) -> DriveFilter:
    """The filter of an uncalibrated robot after 2 s of rest and 10 s of this motion, m/s and rad/s.

    The noise of left wheel and gyro is half that of the step before, as where a gyro is read once a step and
    its rate runs straight from reading to reading. The right wheel's is new each time.
    """
    robot, settings, random = RobotConfig(), OdometrySettings(), np.random.default_rng(0)
    mean, covariance = prior(robot, settings, SIMULATOR)
    geometry = DriveGeometry.from_robot(robot)
    drive = DriveFilter(mean, covariance, geometry, process_noise(robot, settings, 0.003))
    side = 0.5 * geometry.track_width * wheel_turn * turn_rate
    means = np.array(
        [(velocity - side) / geometry.wheel_radius, (velocity + side) / geometry.wheel_radius, turn_rate]
    )
    stds = np.array([0.03, 0.03, 0.002])
    noise = stds * random.normal(size=(601, 3))
    for step, (before, now) in enumerate(pairwise(noise)):
        moves = step >= 100
        read = moves * means + (before + now) * (0.5, 0.0, 0.5) + now * (0.0, 1.0, 0.0)
        drive.step(0.02, tuple(read.tolist()), tuple((stds**2).tolist()), 0.0)
        if not moves:
            drive.apply_standstill(4e-8, 4e-8)
    return drive


def test_noise_that_is_like_that_of_the_step_before_is_no_scale() -> None:
    for velocity in (0.0, 0.2):
        flat = driven(velocity, 0.0).flat
        balance_std = flat[variance_index(State.BALANCE)] ** 0.5
        assert flat[State.BALANCE] == pytest.approx(0.0, abs=min(1e-3, 4.0 * balance_std))
        assert (flat[State.WAY], flat[State.WHEEL_TURN], flat[State.GYRO_SCALE]) == pytest.approx(
            (1.0, 1.0, 1.0), abs=1e-3
        )


def test_a_turn_on_the_spot_tells_the_turn_of_the_wheels_and_not_their_balance() -> None:
    flat = driven(0.0, 1.0, wheel_turn=0.97).flat
    wheels, gyro = variance_index(State.WHEEL_TURN), variance_index(State.GYRO_SCALE)
    together = covariance_index(State.WHEEL_TURN, State.GYRO_SCALE)
    assert (flat[wheels] + flat[gyro] - 2.0 * flat[together]) ** 0.5 < 0.002, (
        "of the turns that the gyro reads"
    )
    assert flat[State.WHEEL_TURN] == pytest.approx(0.97, abs=0.002)
    assert flat[State.BALANCE] == pytest.approx(0.0, abs=1e-3)


def test_starts_and_stops_of_an_uncalibrated_robot_are_no_wrong_scale() -> None:
    """Behind RaccoonOS, whose gyro is read once in 20 ms."""
    with open_robot(RobotConfig(), port=open_emulated(RobotConfig(), 17, world=World.empty())) as robot:
        for _ in range(2):
            robot.run(straight(0.04))
        assert sum(robot.odometry.wheel_scales) / 2.0 == pytest.approx(1.0, abs=1e-3)
