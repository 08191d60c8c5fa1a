"""Causes to hide: each id of the catalogue, how it enters the independent plant, and how large it is
drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from blind.plant import NEUTRAL

Values = dict[str, float]
Draw = Callable[[np.random.Generator, float, str], tuple[Values, Values]]


@dataclass(frozen=True)
class Hidden:
    """One cause in a recording. values: by the catalogue's parameter names; plant: what changes in the
    plant."""

    id: str
    where: str | None
    values: Mapping[str, float]
    plant: Mapping[str, float] = field(repr=False)

    @property
    def name(self) -> str:
        return self.id if self.where is None else f"{self.id}@{self.where}"


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high) * rng.choice([-1.0, 1.0]))


def _shift(parameter: str, plant: str, low: float, high: float, signed: bool = False) -> Draw:
    def draw(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
        change = size * (_signed(rng, low, high) if signed else float(rng.uniform(low, high)))
        name = plant.format(s=where[:1])
        value = NEUTRAL[name] + change
        return {parameter: value}, {name: value}

    return draw


def _factor(plants: tuple[str, ...], low: float, high: float) -> Draw:
    def draw(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
        factor = 1.0 + size * _signed(rng, low, high)
        names = [name.format(s=where[:1]) for name in plants]
        return {"factor": factor}, {name: NEUTRAL[name] * factor for name in names}

    return draw


def _heating(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    gain, tau = size * rng.uniform(0.25, 0.9), rng.uniform(8.0, 25.0)
    return {"gain": gain, "time_constant": tau}, {"heat_gain": gain, "heat_tau": tau}


BACKGROUND = 0.2
"""Size up to which a current limit fades with it; one of 0.4 of its size and less would never be reached."""


def _current_limit(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    limit = rng.uniform(0.9, 1.9) / (0.4 + 0.6 * size if size > BACKGROUND else max(size, 1e-3))
    return {"limit": limit}, {"current_limit": limit}


def _stiction(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    torque, speed = size * rng.uniform(0.03, 0.1), rng.uniform(0.25, 0.8)
    return {"torque": torque, "speed": speed}, {"stiction": torque, "stiction_speed": speed}


def _direction(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    coulomb = size * _signed(rng, 0.08, 0.3)
    viscous = size * _signed(rng, 0.3, 0.8) if rng.random() < 0.5 else 0.0
    values = {"asymmetry": coulomb, "viscous_asymmetry": viscous}
    return values, {"dir_coulomb": coulomb, "dir_viscous": viscous}


def _slope(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    torque, toward = size * rng.uniform(0.015, 0.05), rng.uniform(-np.pi, np.pi)
    along_x, along_y = float(torque * np.cos(toward)), float(torque * np.sin(toward))
    return {"along_x": along_x, "along_y": along_y}, {"slope_x": along_x, "slope_y": along_y}


def _eccentric(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    amplitude, phase = size * rng.uniform(0.02, 0.06), rng.uniform(-np.pi, np.pi)
    side = where[:1]
    return {"amplitude": amplitude, "phase": phase}, {f"ecc_{side}": amplitude, f"ecc_phase_{side}": phase}


def _filter_lag(rng: np.random.Generator, size: float, where: str) -> tuple[Values, Values]:
    longer = rng.random() < 0.6
    change = size * (rng.uniform(0.008, 0.03) if longer else -rng.uniform(0.007, 0.013))
    value = NEUTRAL["filter_tau"] + float(change)
    return {"time_constant": value}, {"filter_tau": value}


SIDES = ("left", "right")
CAUSES: dict[str, tuple[Draw, tuple[str, ...]]] = {
    "battery.open_circuit_voltage": (_shift("voltage", "voc", 0.25, 0.8, signed=True), ()),
    "battery.internal_resistance": (_shift("resistance", "rint", 0.06, 0.25), ()),
    "battery.discharge": (_shift("volts_per_coulomb", "discharge", 0.006, 0.03), ()),
    "motor.armature_resistance": (_factor(("resistance_{s}",), 0.12, 0.3), SIDES),
    "motor.back_emf_constant": (_factor(("ke_{s}",), 0.05, 0.12), SIDES),
    "motor.heating": (_heating, ()),
    "motor.current_limit": (_current_limit, ()),
    "friction.coulomb": (_shift("torque", "coulomb", 0.03, 0.08, signed=True), ()),
    "friction.viscous": (_shift("coefficient", "viscous", 0.005, 0.02), ()),
    "friction.stiction": (_stiction, ()),
    "friction.load_dependent": (_shift("coefficient", "load_friction", 0.06, 0.25), ()),
    "friction.direction_dependent": (_direction, ()),
    "friction.quadratic": (_shift("coefficient", "quadratic", 0.0008, 0.003), ()),
    "drive.backlash": (_shift("angle", "backlash", 0.04, 0.16), ()),
    "drive.wheel_slip": (_shift("time", "slip", 0.012, 0.05), ()),
    "drive.turn_scrub": (_shift("torque", "scrub", 0.02, 0.08), ()),
    "drive.wheel_radius": (_factor(("radius_{s}",), 0.03, 0.08), SIDES),
    "drive.track_width": (_factor(("track",), 0.05, 0.12), ()),
    "drive.inertia": (_factor(("inertia_straight", "inertia_turn"), 0.15, 0.4), ()),
    "drive.slope": (_slope, ()),
    "drive.wheel_eccentricity": (_eccentric, SIDES),
    "actuation.deadband": (_shift("duty", "deadband", 0.03, 0.1), ()),
    "actuation.latency": (_shift("seconds", "latency", 0.012, 0.06), ()),
    "bemf.offset": (_shift("counts", "bemf_offset_{s}", 8.0, 60.0, signed=True), SIDES),
    "bemf.scale": (_factor(("bemf_scale_{s}",), 0.03, 0.1), SIDES),
    "bemf.dead_zone": (_shift("counts", "dead_zone", 30.0, 80.0), ()),
    "bemf.filter_lag": (_filter_lag, ()),
    "imu.gyro_bias": (_shift("rate", "gyro_bias", 0.004, 0.03, signed=True), ()),
    "imu.gyro_scale": (_factor(("gyro_scale",), 0.05, 0.12), ()),
    "imu.gyro_drift": (_shift("rate_per_second", "gyro_drift", 0.0003, 0.002, signed=True), ()),
    "imu.latency": (_shift("seconds", "imu_latency", 0.01, 0.04), ()),
}
"""Catalogue id: how it is drawn, and the sides it can be on (none: it acts on the whole robot)."""

UNKNOWN: dict[str, tuple[str, Values]] = {
    "cogging": ("wheel angle", {"cogging_l": 0.06}),
    "rub": ("wheel angle (friction)", {"rub_r": 0.06}),
    "payload": ("time", {"payload": 0.6, "payload_time": 15.0}),
    "patch": ("position", {"patch": 0.5, "patch_length": 0.2}),
    "gyro_speed": ("gyro", {"gyro_speed": 0.25}),
    "gyro_side": ("gyro over turn rate", {"gyro_side": 0.03}),
}
"""Causes in no catalogue: what they depend on, and their full-size parameters."""

TWINS = (
    {"imu.gyro_scale", "drive.track_width"},
    {"drive.wheel_radius", "imu.gyro_scale"},
)
"""Pairs that no recording without a reference can tell apart."""


def draw(cause: str, rng: np.random.Generator, size: float = 1.0) -> Hidden:
    """Hide `cause` with its size drawn and multiplied by `size`."""
    maker, sides = CAUSES[cause]
    where = str(rng.choice(sides)) if sides else None
    values, plant = maker(rng, size, where or "")
    return Hidden(cause, where, values, plant)


def draw_unknown(kind: str, rng: np.random.Generator, size: float = 1.0) -> Hidden:
    """Hide a cause that is in no catalogue; its `where` is what it depends on."""
    depends_on, full = UNKNOWN[kind]
    spread = float(rng.uniform(0.8, 1.3)) * size
    strength = next(iter(full))
    plant = {**full, strength: full[strength] * spread}
    return Hidden("unknown", depends_on, {kind: plant[strength]}, plant)
