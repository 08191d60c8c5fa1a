"""Plain names of causes in a word or two."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

PLAIN_NAMES: Mapping[str, str] = {
    "battery.open_circuit_voltage": "battery voltage",
    "battery.internal_resistance": "battery resistance",
    "battery.discharge": "a battery that runs down",
    "motor.armature_resistance": "winding resistance",
    "motor.back_emf_constant": "K_E",
    "motor.heating": "hot windings",
    "motor.current_limit": "a limit of the current",
    "friction.coulomb": "dry friction",
    "friction.viscous": "friction that grows with speed",
    "friction.stiction": "sticking",
    "friction.load_dependent": "a gear that loses torque",
    "friction.direction_dependent": "friction that differs by direction",
    "friction.quadratic": "drag that grows with the square of the speed",
    "friction.presliding": "friction that gives before it slides",
    "drive.backlash": "play in the gears",
    "drive.wheel_slip": "slipping wheels",
    "drive.turn_scrub": "scrub in turns",
    "drive.wheel_radius": "wheel radius",
    "drive.track_width": "track width",
    "drive.inertia": "inertia",
    "drive.slope": "a slope",
    "drive.wheel_eccentricity": "a wheel that is not round",
    "actuation.deadband": "commands that do nothing",
    "actuation.latency": "late commands",
    "bemf.offset": "back-EMF at standstill",
    "bemf.scale": "scale of the back-EMF",
    "bemf.dead_zone": "a dead zone of the back-EMF",
    "bemf.filter_lag": "smoothing of the back-EMF",
    "imu.gyro_bias": "gyro bias",
    "imu.gyro_scale": "gyro scale",
    "imu.gyro_drift": "gyro drift",
    "imu.latency": "a late gyro",
    "imu.low_pass": "a gyro that smooths",
    "tophat.ambient_light": "light on a tophat",
    "tophat.gain": "gain of a tophat",
    "tophat.height": "height of a tophat",
    "tophat.noise": "noise of a tophat",
}
"""Plain names by id of the effect."""


def plain_name(name: str) -> str:
    """id@where in words, such as: dry friction (left). A team's own effect keeps its id."""
    id_, _, where = name.partition("@")
    place = f"port {where}" if where.isdecimal() else where
    return PLAIN_NAMES.get(id_, id_) + (f" ({place})" if place else "")


def plain_names(names: Iterable[str]) -> str:
    """The plain names of causes, separated by commas."""
    return ", ".join(map(plain_name, names))


def name_with_id(name: str) -> str:
    """The plain name of a cause with its id, which the JSON and the options have: Wheel radius (left)
    [drive.wheel_radius@left]."""
    plain = capitalise(plain_name(name))
    return plain if plain == name else f"{plain} [{name}]"


_PLACES = {
    "motor": {None: "the motors", "left": "the left motor", "right": "the right motor"},
    "bemf": {None: "the motors", "left": "the left motor", "right": "the right motor"},
    None: {None: "both wheels", "left": "the left wheel", "right": "the right wheel"},
}


def place_name(id: str, where: str | None) -> str:  # noqa: A002
    """Place of an effect in words: the left motor, both wheels, port 3."""
    places = _PLACES.get(id.partition(".")[0], _PLACES[None])
    return places.get(where) or f"port {where}"


def capitalise(text: str) -> str:
    """The text with a capital first letter, unless it starts with a column, a file or the id of a team's own
    effect."""
    return text if "." in text.partition(" ")[0] else text[:1].upper() + text[1:]
