"""Why a parameter may differ between recordings: what a team can check."""

from __future__ import annotations

from collections.abc import Mapping

CREEP_REASONS: Mapping[str, str] = {
    "battery.internal_resistance": "a battery ages",
    "battery.open_circuit_voltage": "a battery runs down",
    "motor.back_emf_constant": "its magnets weaken",
    "motor.armature_resistance": "its brushes wear",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "its tyre wears",
    "drive.backlash": "gears wear",
    "tophat.gain": "dirt gathers on it",
    "tophat.height": "its mount comes loose",
}
"""Possible reasons of a drifting parameter, by cause."""
JUMP_REASONS: Mapping[str, str] = {
    "battery.internal_resistance": "another battery, or its contacts",
    "battery.open_circuit_voltage": "another charge, or another battery",
    "motor.back_emf_constant": "a motor was replaced",
    "motor.armature_resistance": "a motor was replaced",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "a wheel was replaced",
    "drive.backlash": "gears were replaced",
    "tophat.ambient_light": "another room, or other lamps",
    "tophat.gain": "another sensor, or dirt on it",
    "tophat.height": "its mount slipped",
    "tophat.noise": "its plug came loose",
}
"""Possible reasons of a jumping parameter, by cause."""
RECURRENCE_REASONS: Mapping[str, str] = {
    "battery.open_circuit_voltage": "another charge each time",
    "battery.internal_resistance": "several batteries in turn",
    "drive.slope": "other tables, or other directions",
    "friction.coulomb": "other floors",
}
"""Possible reasons of a cause that comes and goes between recordings, by cause."""
