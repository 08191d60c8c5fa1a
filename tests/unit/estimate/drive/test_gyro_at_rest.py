"""The bias of a gyro, from what it reads while the robot stands: right to what is said."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.readings import SIMULATOR, STOP, Inputs
from raccoon.estimate.drive.odometry import Odometry
from shared_data import data_path

RECORDED = 0.0016
"""rad/s, of the readings of the recorded gyro."""
STILL = (0, 0, 0, 0)


def surprises(rates: NDArray[np.float64], hertz: float, pieces: int) -> NDArray[np.float64]:
    """By how many of its deviations the bias is off that each piece of 0.4 s at rest teaches, against the
    mean of the piece and of five times as much before and after it.
    """
    off, count = [], round(0.4 * hertz)
    for begin in np.linspace(5 * count, len(rates) - 6 * count, pieces).astype(int):
        odometry = Odometry(RobotConfig())
        for at in range(count):
            gyro = (0.0, 0.0, float(rates[begin + at]) / SIMULATOR.gyro_rad_s)
            odometry.update(Inputs(at / hertz, SIMULATOR, bemf=STILL, position=STILL, gyro=gyro), STOP)
        learnt = odometry.estimate
        around = float(rates[begin - 5 * count : begin + 6 * count].mean())
        off.append((learnt.gyro_bias - around) / learnt.gyro_bias_std)
    return np.array(off)


def test_the_bias_of_a_recorded_gyro_is_as_sure_as_it_says() -> None:
    """An MPU-6050 at rest, 100 readings a second."""
    path = data_path("gyro-static") / "mpu6050-static-100hz.csv"
    rates = np.loadtxt(path, skiprows=5, delimiter=",", usecols=5, max_rows=8000) * math.radians(1.0) / 131.0
    off = surprises(rates - rates.mean(), 100.0, 40)
    assert np.sqrt(np.mean(off**2)) < 1.1
    assert np.abs(off).max() < 3.0


@pytest.mark.parametrize("hertz", [50.0, 200.0])
def test_readings_that_a_chip_has_smoothed_are_no_surer_for_being_many(hertz: float) -> None:
    """Noise of the recorded gyro's density behind two poles that make 41 Hz, as firmwares set the chip."""
    random, fine, pole = np.random.default_rng(4), 2000.0, 0.0025
    white = random.normal(0.0, RECORDED * math.sqrt(fine / 100.0), 160_000)
    share = -math.expm1(-1.0 / (fine * pole))
    for _ in range(2):
        level, smooth = 0.0, []
        for each in white.tolist():
            level += share * (each - level)
            smooth.append(level)
        white = np.array(smooth)
    off = surprises(white[:: round(fine / hertz)], hertz, 50)
    assert np.sqrt(np.mean(off**2)) < 1.1
    assert np.abs(off).max() < 3.0


def test_wheels_in_a_dead_zone_stand_though_robot_toml_has_an_offset_that_it_hides() -> None:
    """A board that reads 0 below 40 counts: 0 is no motion of -30 counts, and the gyro reads its bias."""
    board = replace(SIMULATOR, bemf_dead_zone=40.0)
    known = MotorConfig(bemf_offset=Measured(30.0, 1.0))
    odometry, bias = Odometry(replace(RobotConfig(), motors={0: known, 1: known})), 0.01
    rates = np.random.default_rng(1).normal(bias, RECORDED, 160)
    for cycle, rate in enumerate(rates.tolist()):
        gyro = (0.0, 0.0, rate / board.gyro_rad_s)
        learnt = odometry.update(Inputs(0.005 * cycle, board, bemf=STILL, position=STILL, gyro=gyro), STOP)
    assert learnt.gyro_bias == pytest.approx(bias, abs=4.0 * learnt.gyro_bias_std)
    assert learnt.gyro_bias_std < 0.001
