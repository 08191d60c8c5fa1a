"""Inertial sensors: what they read for a motion, and the words they make of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

from raccoon.core.readings import Vector

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Rate = TypeVar("Rate", float, "NDArray[np.float64]")

GRAVITY = 9.80665  # m/s2
WORD_LIMIT = 32767  # of a signed 16-bit register


def gyro_reading(
    rate: float, scale: float = 1.0, bias: float = 0.0, drift: float = 0.0, age: float = 0.0
) -> float:
    """rad/s that a gyro reads: scale * rate + bias + drift * age (age in s since the bias was taken)."""
    return scale * rate + bias + drift * age


def rate_between(begin: Rate, end: Rate, mean: Rate, share: Rate) -> Rate:
    """A turn rate between two moments at which it is known, `share` of the way from one to the other: the
    parabola through both that turns as far as the robot did, at `mean` on average.

    A straight line loses what a rate does in between: 0.02 rad/s after each change of a command in rows of
    5 ms, and the moment at which a tooth meets its wheel.
    """
    return begin + share * (end - begin + 6.0 * (mean - 0.5 * (begin + end)) * (1.0 - share))


def specific_force(forward_acceleration: float, forward_speed: float, turn_rate: float) -> Vector:
    """m/s2 that an accelerometer in the middle of the axis reads on level ground.

    x: the change of speed; y: v omega, towards the centre of the turn (left, for a left turn); z: +g, since
    the floor holds the robot up.
    """
    return forward_acceleration, forward_speed * turn_rate, GRAVITY


def word(value: float, scale: float) -> int:
    """The register's word for a value in SI, saturated at 16 bits; scale: SI units a word."""
    rounded = math.floor(value / scale + 0.5)
    return min(max(rounded, -WORD_LIMIT - 1), WORD_LIMIT)
