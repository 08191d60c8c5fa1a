"""Numbers that a team wrote into robot.toml by hand say nothing of how well they are known."""

from dataclasses import replace
from pathlib import Path

import pytest

from raccoon import RobotConfig, load_robot
from raccoon.core.config import Measured, MotorConfig
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.prior import prior
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.bemf import counts_scale
from raccoon.sweep.factors import default_factors


def deviation(robot: RobotConfig, state: State) -> float:
    """Of the state at the start."""
    _, covariance = prior(robot, OdometrySettings(), SIMULATOR)
    return float(covariance[state, state] ** 0.5)


def written(folder: Path, text: str) -> RobotConfig:
    """A robot.toml with these lines."""
    file = folder / "robot.toml"
    file.write_text(text)
    return load_robot(file)


def test_a_track_width_by_a_ruler_is_known_no_better_than_one_that_is_not_given(tmp_path: Path) -> None:
    """It counted as known to 0.01 %: a metre around a corner with a track 2 % off was 7 deviations wrong."""
    given = written(tmp_path, "[model.drive]\ntrack_width = 0.155\n")
    assert deviation(given, State.WHEEL_TURN) == pytest.approx(deviation(RobotConfig(), State.WHEEL_TURN))


def test_a_track_width_that_was_fitted_is_known_as_well_as_it_says(tmp_path: Path) -> None:
    scale = counts_scale(RobotConfig(), "left", SIMULATOR)
    ticks = f"[motor.0]\nradians_per_tick = {scale}\n[motor.1]\nradians_per_tick = {scale}\n"
    fitted = written(tmp_path, f"{ticks}[model.drive]\ntrack_width = {{ value = 0.155, std = 0.00031 }}\n")
    against_gyro = 0.002**2 + 0.005**2 / 2
    assert deviation(fitted, State.WHEEL_TURN) == pytest.approx((against_gyro + 0.005**2) ** 0.5, rel=0.01)


@pytest.mark.parametrize(
    ("scale", "std"),
    [
        ("1", 0.005),
        ("1.01", 0.00505),
        ("{ value = 1, std = 0.001 }", 0.005),
        ("{ value = 1.01, std = 0.001 }", 0.001),
        ("{ value = 1, std = 0.001, date = 2026-03-01 }", 0.001),
        ("{ value = 1, std = 0.02 }", 0.02),
    ],
)
def test_a_gyro_scale_that_nobody_measured_is_known_to_half_a_percent(
    tmp_path: Path, scale: str, std: float
) -> None:
    """At 0.1 % a gyro that is 1 % off was 7 deviations wrong after three quarter turns."""
    given = written(tmp_path, f"[model.imu]\ngyro_scale = {scale}\n")
    assert deviation(given, State.GYRO_SCALE) == pytest.approx(std)


def test_an_offset_at_rest_is_known_as_well_as_that_of_the_model(tmp_path: Path) -> None:
    """An offset as the doctor says to write it was taken for exact: 4 counts more crept away at 0.1 mm/s."""
    given = written(tmp_path, "[motor.0]\nbemf_offset = 12\n")
    count = counts_scale(given, "left", SIMULATOR)
    assert deviation(given, State.LEFT_OFFSET) == pytest.approx(1.0 * count)
    assert deviation(given, State.RIGHT_OFFSET) == pytest.approx(20.0 * count)


def test_an_encoder_has_no_offset() -> None:
    encoder = MotorConfig(bemf_offset=Measured(0.0))
    assert deviation(replace(RobotConfig(), motors={0: encoder}), State.LEFT_OFFSET) == 0.0


def test_a_sweep_varies_them_by_that(tmp_path: Path) -> None:
    """It played every match with exactly what robot.toml says."""
    scale = counts_scale(RobotConfig(), "left", SIMULATOR)
    given = written(tmp_path, f"[motor.0]\nradians_per_tick = {scale}\nbemf_offset = 12\n")
    found = {each.name: each for each in default_factors(given)}
    ticks, offset = found["motor.back_emf_constant.factor@left"], found["bemf.offset.counts@left"]
    assert (ticks.low, ticks.high) == pytest.approx((0.995, 1.005))
    assert (offset.low, offset.high) == (11.0, 13.0)
