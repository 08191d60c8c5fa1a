"""Inertial sensors: their readings in a motion, and the words of these."""

from __future__ import annotations

import math

from raccoon.core.readings import GRAVITY, Vector

WORD_LIMIT = 32767  # of a signed 16-bit register


def gyro_reading(
    rate: float, scale: float = 1.0, bias: float = 0.0, drift: float = 0.0, age: float = 0.0
) -> float:
    """Reading of a gyro, rad/s: scale * rate + bias + drift * age (age in s since the bias was measured)."""
    return scale * rate + bias + drift * age


def specific_force(
    forward_acceleration: float, forward_speed: float, turn_rate: float, lean: float = 0.0
) -> Vector:
    """Specific force, m/s2, that an accelerometer in the middle of the axis reads.

    x: the change of speed plus lean, the part of g along the forward axis of a robot whose nose is up
    (negative: down); y: v omega, towards the centre of the turn (left, for a left turn); z: the rest of +g.
    """
    upright = GRAVITY if lean == 0.0 else math.sqrt(max(0.0, GRAVITY * GRAVITY - lean * lean))
    return forward_acceleration + lean, forward_speed * turn_rate, upright


def word(value: float, scale: float) -> int:
    """The register's word for a value in SI, saturated at 16 bits; scale: SI units per word."""
    rounded = math.floor(value / scale + 0.5)
    return min(max(rounded, -WORD_LIMIT - 1), WORD_LIMIT)
