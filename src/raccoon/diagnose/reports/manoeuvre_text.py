"""Manoeuvres in words, for a team, and the one that shows an effect best."""

from __future__ import annotations

from collections.abc import Mapping

MANOEUVRES: Mapping[str, str] = {
    "reversals": "full power forwards and back, 0.7 s each way, for 15 s on a free floor (raccoon excite "
    '--manoeuvre "back and forth"): heating, current limit and resistance',
    "creep": "slow ramps from standstill to 30 % and back, both ways: stiction, deadband, dead zone, "
    "dry friction",
    "spin": "spins to both sides with quick reversals: backlash, slip, scrub, gyro scale and latency, "
    "track width",
    "straight": "long straight legs at full speed, both ways: wheel radius, quadratic and viscous "
    "friction, discharge",
    "turns": "ten counted full turns to each side, from line to line: gyro scale against track width "
    "and wheel radius",
    "still": "stand still for 10 s at the start and at the end: gyro bias, drift and back-EMF offsets",
    "steps": "random power steps between -100 and 100 % for 20 s: latency, inertia, resistance and K_E",
    "square": "the same drive in two headings at right angles: slope against direction-dependent friction",
}
"""Safe manoeuvres in words, by key."""

_SHOWN_BY: Mapping[str, str] = {
    "motor.heating": "reversals", "motor.current_limit": "reversals", "motor.armature_resistance": "steps",
    "motor.back_emf_constant": "steps", "friction.stiction": "creep", "friction.coulomb": "creep",
    "friction.viscous": "straight", "friction.quadratic": "straight", "friction.load_dependent": "steps",
    "friction.direction_dependent": "square", "drive.slope": "square", "drive.backlash": "spin",
    "drive.wheel_slip": "spin", "drive.turn_scrub": "spin", "drive.wheel_radius": "straight",
    "drive.track_width": "turns", "imu.gyro_scale": "turns", "drive.inertia": "steps",
    "drive.wheel_eccentricity": "straight", "actuation.deadband": "creep", "actuation.latency": "steps",
    "bemf.dead_zone": "creep", "bemf.filter_lag": "steps", "bemf.offset": "still", "bemf.scale": "straight",
    "imu.gyro_bias": "still", "imu.gyro_drift": "still", "imu.latency": "spin",
    "battery.internal_resistance": "steps", "battery.discharge": "straight",
    "battery.open_circuit_voltage": "straight",
}  # fmt: skip


def manoeuvre_for(id: str) -> str | None:  # noqa: A002
    """The manoeuvre that shows an effect best, in words; None for an effect without one."""
    key = _SHOWN_BY.get(id)
    return None if key is None else MANOEUVRES[key]
