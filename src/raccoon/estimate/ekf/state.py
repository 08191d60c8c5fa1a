"""The names of the drive filter's states, its settings and its prior.

The state is what the robot cannot measure directly: where it is, how it moves, and the slowly drifting
numbers between motion and readings. No code addresses a state by a bare number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import IntEnum

from raccoon.core.errors import ConfigError


class State(IntEnum):
    """Index of each state in the filter's vector.

    Scales are reading over truth (1 is nominal); offsets are readings at rest in rad/s.
    """

    X = 0
    Y = 1
    HEADING = 2
    VELOCITY = 3
    TURN_RATE = 4
    GYRO_BIAS = 5
    LEFT_OFFSET = 6
    RIGHT_OFFSET = 7
    LEFT_SCALE = 8
    RIGHT_SCALE = 9
    GYRO_SCALE = 10
    TRACK_SCALE = 11


SIZE = len(State)


@dataclass(frozen=True, slots=True)
class OdometrySettings:
    """How noisy the sensors are and how fast their errors wander. Every value is a standard deviation
    unless said.

    Raises ConfigError for a value that is not a number of 0 or more.

    bemf_noise_counts: of one back-EMF reading before the board's filter.
    gyro_noise: rad/s of one gyro reading.
    slip_noise: m of wheel travel after one metre; grows with the square root of the travel.
    acceleration, turn_acceleration: how much velocity and turn rate change, (m/s)/sqrt(s) and
    (rad/s)/sqrt(s).
    gyro_bias_walk, offset_walk, scale_walk: wandering in one second, rad/s, counts, 1; grows with sqrt(time).
    gyro_bias: rad/s, smallest prior. uncalibrated_offset_counts, uncalibrated_scale: priors of a motor that
    robot.toml holds no calibration of. calibrated_scale: smallest prior of one that is calibrated.
    standstill_velocity (m/s), standstill_turn_rate (rad/s): what "stands still" means as a measurement.
    timing: s by which a wheel's reading may be early or late against the gyro's.
    imu_latency: s from a turn to its reading, against the wheels' (a delay, not a deviation).
    """

    bemf_noise_counts: float = 7.0
    gyro_noise: float = 0.0012
    slip_noise: float = 0.0005
    acceleration: float = 3.0
    turn_acceleration: float = 20.0
    gyro_bias_walk: float = 1e-5
    offset_walk_counts: float = 0.02
    scale_walk: float = 0.0005
    gyro_bias: float = 0.005
    uncalibrated_offset_counts: float = 20.0
    uncalibrated_scale: float = 0.05
    calibrated_scale: float = 0.005
    standstill_velocity: float = 2e-4
    standstill_turn_rate: float = 2e-4
    timing: float = 0.005
    imu_latency: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"{each.name} is {value}: allowed are numbers from 0")
        if self.imu_latency > 0.5:
            raise ConfigError(f"imu_latency is {self.imu_latency} s: allowed are 0 to 0.5 s")
        if min(self.bemf_noise_counts, self.gyro_noise, self.acceleration, self.turn_acceleration) <= 0.0:
            raise ConfigError(
                "bemf_noise_counts, gyro_noise, acceleration, turn_acceleration: must be above 0"
            )
