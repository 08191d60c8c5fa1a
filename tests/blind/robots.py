"""Other robots than that of robot.toml's defaults: the independent plant with their numbers, and their
robot.toml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

from blind.generator import BASE_SPREAD, Noise
from blind.hidden import Hidden
from blind.plant import NEUTRAL
from raccoon.core.config import Measured, RobotConfig

ROBOTS: Mapping[str, Mapping[str, float]] = {
    "small": {"resistance": 2.5, "ke": 0.7, "coulomb": 0.08, "viscous": 0.002, "inertia_straight": 0.004,
              "inertia_turn": 0.0025, "radius": 0.021, "track": 0.11},
    "heavy": {"voc": 7.2, "resistance": 1.5, "coulomb": 0.3, "viscous": 0.006, "inertia_straight": 0.06,
              "inertia_turn": 0.05, "radius": 0.05, "track": 0.28},
    "strong": {"voc": 8.2, "resistance": 3.0, "ke": 1.3, "coulomb": 0.12, "viscous": 0.003,
               "inertia_straight": 0.012, "inertia_turn": 0.006, "radius": 0.03, "track": 0.14},
    "smooth": {"voc": 6.6, "coulomb": 0.04, "viscous": 0.012, "inertia_straight": 0.03,
               "inertia_turn": 0.02, "track": 0.18},
}  # fmt: skip
"""From 21 mm wheels to 50, from 4 to 60 g m2, from 0.04 to 0.3 N m of friction; both wheels alike."""
USUAL = dict(NEUTRAL)
TORQUES = ("coulomb", "stiction", "scrub", "slope_x", "slope_y")


@contextmanager
def other_robot(name: str) -> Iterator[RobotConfig]:
    """The independent plant as another robot, known as well in proportion as the usual one, and its
    robot.toml."""
    spread = dict(BASE_SPREAD)
    for key, value in ROBOTS[name].items():
        for each in [key] if key in NEUTRAL else [f"{key}_l", f"{key}_r"]:
            NEUTRAL[each] = value
            BASE_SPREAD[each] = spread[each] * value / USUAL[each]
    try:
        yield _described()
    finally:
        NEUTRAL.update(USUAL)
        BASE_SPREAD.update(spread)


def _described() -> RobotConfig:
    robot = RobotConfig()
    model = robot.model

    def measured(plant: str) -> Measured:
        return Measured(NEUTRAL[plant], BASE_SPREAD[plant])

    motor = replace(
        model.left, armature_resistance=measured("resistance_l"), back_emf_constant=measured("ke_l")
    )
    drive = replace(
        model.drive,
        inertia_straight=measured("inertia_straight"),
        inertia_turn=measured("inertia_turn"),
        wheel_radius=measured("radius_l"),
        track_width=measured("track"),
    )
    return replace(
        robot,
        model=replace(
            model,
            battery=replace(model.battery, open_circuit_voltage=measured("voc")),
            left=motor,
            right=motor,
            friction=replace(model.friction, coulomb=measured("coulomb"), viscous=measured("viscous")),
            drive=drive,
        ),
    )


def fitting(hidden: Hidden) -> Hidden:
    """A cause that was drawn for the usual robot, as large in proportion to the present one's friction and
    speed."""
    torque = NEUTRAL["coulomb"] / USUAL["coulomb"]
    speed = (NEUTRAL["voc"] / NEUTRAL["ke_l"]) / (USUAL["voc"] / USUAL["ke_l"])
    share = dict.fromkeys(TORQUES, torque) | {"viscous": torque / speed, "quadratic": torque / speed**2}
    if not share.keys() & hidden.plant.keys():
        return hidden
    plant = {
        key: NEUTRAL[key] + share.get(key, 1.0) * (value - NEUTRAL[key])
        for key, value in hidden.plant.items()
    }
    return replace(hidden, values=dict(zip(hidden.values, plant.values(), strict=True)), plant=plant)


def noise_of() -> Noise:
    """The pushes of a floor, as large in proportion to the present robot's friction."""
    return Noise(torque=Noise().torque * NEUTRAL["coulomb"] / USUAL["coulomb"])
