"""Names of the drive filter's states, and its settings.

The state is what the robot cannot measure directly: its pose, its motion, and the slowly drifting parameters
between motion and readings. No code addresses a state by a bare number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import IntEnum

from raccoon.core.errors import ConfigError


class State(IntEnum):
    """Index of each state in the filter's vector.

    VELOCITY: m/s, as read by the wheels at their nominal scale. TURN_RATE: rad/s, true.
    LEFT_OFFSET, RIGHT_OFFSET: readings at rest, rad/s. GYRO_BIAS: rad/s.
    WAY: true distance over distance read. WHEEL_TURN: turn read by the wheels over the true turn.
    BALANCE: a motion that both wheels together read as 1 is read as 1 - BALANCE by the left one and as 1 +
    BALANCE by the right one.
    GYRO_SCALE: reading over truth. GYRO_DELAY: s by which the gyro is later than the wheels.

    WAY, BALANCE and WHEEL_TURN are the two wheel scales (`wheel_scales`) and the track width, transformed to
    three numbers that are observable in different ways: driving straight shows BALANCE alone, a turn
    WHEEL_TURN alone, and WAY only through its correlation with these two, or by tape.
    """

    X = 0
    Y = 1
    HEADING = 2
    VELOCITY = 3
    TURN_RATE = 4
    GYRO_BIAS = 5
    LEFT_OFFSET = 6
    RIGHT_OFFSET = 7
    WAY = 8
    BALANCE = 9
    WHEEL_TURN = 10
    GYRO_SCALE = 11
    GYRO_DELAY = 12


SIZE = len(State)
MIN_VELOCITY, MIN_TURN = 0.02, 0.1
"""m/s above which BALANCE is updated, and rad/s above which WHEEL_TURN and GYRO_SCALE are. A slower motion is
hardly more than noise. The Jacobian of a scale uses the motion of the previous step; if its noise is
correlated with that of this step, the product looks like a scale, always of the same sign."""


def wheel_scales(way: float, balance: float) -> tuple[float, float]:
    """Reading over truth of the left and of the right wheel."""
    return (1.0 - balance) / way, (1.0 + balance) / way


@dataclass(frozen=True, slots=True)
class OdometrySettings:
    """Noise of the sensors and drift of their errors. Every value is a standard deviation unless stated
    otherwise.

    Raises ConfigError for a value that is not a number of 0 or more.

    bemf_noise_counts: of one back-EMF reading before the board's filter.
    gyro_noise: rad/s of one gyro reading, of which a hundred a second are independent.
    slip_noise: m of wheel travel after one metre; grows with the square root of the travel.
    acceleration, turn_acceleration: random walk of velocity and turn rate, (m/s)/sqrt(s) and (rad/s)/sqrt(s).
    gyro_bias_walk, offset_walk_counts, scale_walk: random walk in one second, rad/s, counts, 1; grows with
    sqrt(time).
    gyro_bias: rad/s, smallest prior. uncalibrated_offset_counts, uncalibrated_scale: priors of a motor
    without calibration in robot.toml. calibrated_scale: smallest prior of a calibrated one.
    standstill_velocity (m/s), standstill_turn_rate (rad/s): of standstill as a measurement.
    uncalibrated_track: smallest relative prior of a track width that nobody fitted: wheels touch the floor
    somewhere within their width.
    uncalibrated_gyro_scale: relative prior of a gyro's scale that nobody measured: chips are specified to 3
    %, and a controller tilted by 5 degrees turns 0.4 % less about its upright axis.
    runout: variation of a wheel's radius over a revolution, relative.
    timing: s by which readings may be early or late in any case.
    gyro_delay: s, of the delay from a turn to its reading, relative to the wheels', at the start; the filter
    learns it in turns.
    """

    bemf_noise_counts: float = 7.0
    gyro_noise: float = 0.0016
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
    gyro_delay: float = 0.015
    runout: float = 0.005
    uncalibrated_track: float = 0.02
    uncalibrated_gyro_scale: float = 0.005

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"{each.name} is {value}: allowed are numbers from 0")
        if min(self.bemf_noise_counts, self.gyro_noise, self.acceleration, self.turn_acceleration) <= 0.0:
            raise ConfigError(
                "bemf_noise_counts, gyro_noise, acceleration, turn_acceleration: must be above 0"
            )
