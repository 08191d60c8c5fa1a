"""Model errors: by how much each effect of a robot differs in form from the equation of the catalogue.

No floor and no gear is as even as an equation. The numbers were measured on robots of other equations;
docs/diagnosis.md says on which.
"""

from __future__ import annotations

import math

from raccoon.diagnose.hypotheses.coordinates import lookup_by_prefix

_USUAL_SHARE = 0.07
"""Share of a deviation of all other effects, see `relative_form_error`."""
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
"""Share of the width of all other causes, see `min_form_error`."""
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
    """Standard deviation of an estimated deviation due to the model's form, as a share of the deviation."""
    return lookup_by_prefix(_SHARES, id_, _USUAL_SHARE)


def min_form_error(id_: str, causes: int = 1) -> float:
    """The same error's lower limit, as a share of the cause's width, however small the deviation is.

    Of a dead zone it is 0.3 counts: readings are whole counts, which show no better where it ends. A deadband
    beside other causes was off by 0.0014 of the duty (31 robots) whatever its size, since friction near
    standstill has a similar response. Play of 0.01 rad and less was off by 0.0005 rad.

    causes: how many are named. The errors of their forms add in squares.
    """
    return lookup_by_prefix(_LEAST, id_, _USUAL_LEAST) * math.sqrt(causes)


def form_weight(name: str) -> float:
    """Inexactness of the response to a cause, relative to a usual cause's.

    It is not the error of its number: a late reading is inexact in nothing but its time, while a track width,
    however well it is known, acts through the floor.
    """
    return lookup_by_prefix(_WEIGHTS, name, 1.0)


def form_error_factor(name: str) -> float:
    """Factor on the general model error in the direction of an effect; errors of sensors have nearly none."""
    return lookup_by_prefix(_FACTORS, name, 1.0)
