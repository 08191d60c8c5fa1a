"""Variation between the matches of one robot, whose model.toml a diagnosis wrote."""

from __future__ import annotations

from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters
from raccoon.sweep.factors import Factor, default_factors, place_of

VARIES_BY_DAY = frozenset(
    {"battery.open_circuit_voltage", "drive.slope", "imu.gyro_bias", "tophat.ambient_light"}
)
"""Effects that differ in another match of the same robot: charge, table, zero and light."""


def factors_of_model(robot: RobotConfig, model: Parameters) -> tuple[Factor, ...]:
    """The usual factors. Those that the model has found are replaced by its values with their standard
    deviations."""
    found = {key for key in model.effects if key[0] not in VARIES_BY_DAY}
    kept = [
        each
        for each in default_factors(robot)
        if place_of(robot, each)[0] not in found and (each.effect, None) not in found
    ]
    for (effect, where), origin in model.origins.items():
        if (effect, where) in found:
            values = model.effects[(effect, where)]
            kept += [
                Factor(effect, name, values[name] - std, values[name] + std, normal=True, where=where)
                for name, std in origin.std.items()
            ]
    return tuple(kept)
