"""The covariance stays symmetric and positive definite, whatever is read.

RACCOON_EKF_STEPS sets how many random steps are taken (a million were, see docs/odometry.md).
"""

import os

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.prior import prior, process_noise
from raccoon.estimate.ekf.filter import DriveFilter, covariance_of, mean_of
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.drive import DriveGeometry

STEPS = int(os.environ.get("RACCOON_EKF_STEPS", "10000"))


def fresh() -> DriveFilter:
    robot, chosen = RobotConfig(), OdometrySettings()
    mean, covariance = prior(robot, chosen, SIMULATOR)
    return DriveFilter(mean, covariance, DriveGeometry.from_robot(robot), process_noise(robot, chosen, 0.003))


def assert_sound(drive: DriveFilter) -> None:
    P = covariance_of(drive.flat)
    assert np.array_equal(P, P.T)
    scale = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0.0
    assert np.all(np.isfinite(mean_of(drive.flat)))


def random_step(drive: DriveFilter, random: np.random.Generator) -> None:
    """A step of a driving robot with any sensor set, noise over six decades, and now and then a wild
    reading.
    """
    kind = random.integers(0, 10)
    dt = float(10 ** random.uniform(-3, -0.5))
    wild = 30.0 if random.random() < 0.01 else 1.0
    left, right, rate = (wild * random.normal(0.0, [4.0, 4.0, 1.0])).tolist()
    *variances, wobble = (10 ** random.uniform(-6, 0, 4)).tolist()
    if kind < 6:
        drive.step(dt, (left, right, rate), tuple(variances), 10.0 * rate, wobble)
    elif kind < 8:
        drive.step(dt, (left, right), tuple(variances[:2]), 10.0 * rate, wobble)
    elif kind < 9:
        drive.apply_standstill(1e-8, 1e-8)
    else:
        drive.predict(dt)


def test_random_steps_never_lose_symmetry_or_definiteness() -> None:
    random, drive = np.random.default_rng(0), fresh()
    for number in range(STEPS):
        random_step(drive, random)
        if number % 100 == 0:
            assert_sound(drive)
    assert_sound(drive)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_short_sequence_leaves_a_sound_belief(seed: int) -> None:
    random, drive = np.random.default_rng(seed), fresh()
    for _ in range(20):
        random_step(drive, random)
        assert_sound(drive)
