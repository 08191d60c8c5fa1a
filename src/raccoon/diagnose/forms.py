"""How far the form of each effect is from a robot's: no floor and no gear is as even as an equation.

The numbers were found on robots of other equations; docs/diagnosis.md says on which.
"""

from __future__ import annotations

from raccoon.diagnose.hypotheses import by_name

USUAL_SHARE = 0.07
_SHARES = {
    "battery.open_circuit_voltage": 0.01, "actuation.latency": 0.01, "drive.wheel_eccentricity": 0.01,
    "imu.gyro_drift": 0.01, "battery.": 0.02, "bemf.filter_lag": 0.02, "bemf.offset": 0.02,
    "imu.gyro_bias": 0.02, "actuation.deadband": 0.03, "imu.latency": 0.04, "bemf.scale": 0.05,
    "drive.wheel_slip": 0.05, "drive.turn_scrub": 0.05, "motor.armature_resistance": 0.07, "motor.": 0.1,
    "friction.stiction": 0.1, "friction.quadratic": 0.1, "drive.inertia": 0.1, "drive.track_width": 0.1,
    "drive.wheel_radius": 0.15,
}  # fmt: skip
_FACTORS = {
    "friction.direction_dependent": 2.0, "drive.slope": 2.0, "battery.": 0.5, "imu.gyro_": 0.5,
    "bemf.offset": 0.5, "drive.wheel_eccentricity": 0.5, "drive.track_width": 0.5,
}  # fmt: skip


def form_error(id_: str) -> float:
    """Share of a deviation by which it is off, one standard deviation."""
    return by_name(_SHARES, id_, USUAL_SHARE)


def form_factor(name: str) -> float:
    """What the error that any model has in the direction of an effect is multiplied by; a reading's own error
    is known nearly exactly."""
    return by_name(_FACTORS, name, 1.0)
