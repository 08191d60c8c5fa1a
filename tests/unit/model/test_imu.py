"""What inertial sensors read, and the words they make of it."""

import math

import pytest

from raccoon.core.readings import GRAVITY, SIMULATOR
from raccoon.model.imu import gyro_reading, specific_force, word


def test_a_gyro_reads_scale_bias_and_drift() -> None:
    assert gyro_reading(2.0) == 2.0
    assert gyro_reading(2.0, scale=1.1, bias=0.01, drift=0.001, age=10.0) == pytest.approx(2.22)


def test_at_rest_an_accelerometer_reads_gravity_up() -> None:
    assert specific_force(0.0, 0.0, 0.0) == (0.0, 0.0, GRAVITY)


@pytest.mark.parametrize("pitch", [0.17, -0.17])
def test_a_robot_whose_nose_is_up_feels_a_part_of_gravity_ahead(pitch: float) -> None:
    felt = specific_force(0.0, 0.0, 0.0, lean=GRAVITY * math.sin(pitch))
    assert felt == pytest.approx((GRAVITY * math.sin(pitch), 0.0, GRAVITY * math.cos(pitch)))


def test_in_a_left_turn_the_floor_pushes_to_the_left() -> None:
    assert specific_force(0.0, 0.2, 1.5)[1] == pytest.approx(0.3)
    assert specific_force(0.5, 0.2, 0.0)[0] == 0.5


@pytest.mark.parametrize(
    ("value", "expected"), [(0.0, 0), (1.4, 1), (1.6, 2), (-1.6, -2), (1e9, 32767), (-1e9, -32768)]
)
def test_words_are_rounded_and_saturate(value: float, expected: int) -> None:
    assert word(value, 1.0) == expected


def test_a_word_and_back_is_within_half_a_word() -> None:
    scale = SIMULATOR.gyro_rad_s
    assert word(1.2345, scale) * scale == pytest.approx(1.2345, abs=scale / 2)
