"""How far the form of each effect is from a robot's: no floor and no gear is as even as an equation.

The numbers were found on robots of other equations; docs/diagnosis.md says on which.
"""

from __future__ import annotations

import math

from raccoon.diagnose.hypotheses.coordinates import lookup_by_prefix

_USUAL_SHARE = 0.07
"""Of a deviation, see `relative_form_error`."""
_SHARES = {
    "imu.gyro_bias": 0.0, "battery.open_circuit_voltage": 0.0, "bemf.filter_lag": 0.001,
    "actuation.latency": 0.003, "drive.wheel_eccentricity": 0.003, "imu.gyro_drift": 0.003,
    "imu.latency": 0.004, "battery.discharge": 0.004, "bemf.offset": 0.004,
    "battery.internal_resistance": 0.011, "drive.wheel_slip": 0.013, "drive.track_width": 0.017,
    "friction.load_dependent": 0.018, "bemf.dead_zone": 0.02, "actuation.deadband": 0.025,
    "bemf.scale": 0.025, "drive.turn_scrub": 0.035, "drive.inertia": 0.04, "motor.back_emf_constant": 0.04,
    "motor.armature_resistance": 0.05, "drive.backlash": 0.06, "friction.quadratic": 0.07,
    "friction.viscous": 0.07, "motor.heating": 0.07, "friction.coulomb": 0.09, "friction.stiction": 0.1,
    "drive.wheel_radius": 0.1, "motor.current_limit": 0.1,
}  # fmt: skip
_USUAL_LEAST = 0.004
"""Of a cause's width, see `min_form_error`."""
_LEAST = {"bemf.dead_zone": 0.015, "actuation.deadband": 0.01, "drive.backlash": 0.0025}
_FACTORS = {
    "friction.direction_dependent": 2.0, "drive.slope": 2.0, "battery.": 0.5, "imu.gyro_": 0.5,
    "bemf.offset": 0.5, "drive.wheel_eccentricity": 0.5, "drive.track_width": 0.5,
}  # fmt: skip
_WEIGHTS = {
    "battery.open_circuit_voltage": 0.14, "actuation.latency": 0.14, "drive.wheel_eccentricity": 0.14,
    "imu.gyro_drift": 0.14, "battery.": 0.3, "bemf.filter_lag": 0.3, "bemf.offset": 0.3,
    "imu.gyro_bias": 0.3, "actuation.deadband": 0.4, "imu.latency": 0.6, "bemf.scale": 0.7,
    "drive.wheel_slip": 0.7, "drive.turn_scrub": 0.7, "motor.armature_resistance": 1.0, "motor.": 1.4,
    "friction.stiction": 1.4, "friction.quadratic": 1.4, "drive.inertia": 1.4, "drive.track_width": 1.4,
    "drive.wheel_radius": 2.1,
}  # fmt: skip


def relative_form_error(id_: str) -> float:
    """Share of a deviation by which its number is off, one standard deviation."""
    return lookup_by_prefix(_SHARES, id_, _USUAL_SHARE)


def min_form_error(id_: str, causes: int = 1) -> float:
    """Part of a cause's width by which its number is off, however small it is. Of a dead zone that is 0.3
    counts, as readings are whole ones and say no more of where it ends. Beside others a deadband was off by
    0.0014 of the duty (31 robots), whatever its size: friction near standstill does much the same. Play of a
    hundredth of a radian and less was off by 0.0005.

    causes: how many are named. What is inexact of each adds to the error of the others, in squares.
    """
    return lookup_by_prefix(_LEAST, id_, _USUAL_LEAST) * math.sqrt(causes)


def form_weight(name: str) -> float:
    """How much of the response to a cause is inexact, over a usual one's. That is not its number's error: a
    late reading is wrong by nothing but its time, and a wider track, however well known, turns on a floor."""
    return lookup_by_prefix(_WEIGHTS, name, 1.0)


def form_error_factor(name: str) -> float:
    """What the error that any model has in the direction of an effect is multiplied by; a reading's own error
    is known nearly exactly."""
    return lookup_by_prefix(_FACTORS, name, 1.0)
