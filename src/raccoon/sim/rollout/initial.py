"""The initial states of a rollout: robots at rest, or with values that the caller gives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import ConfigError
from raccoon.sim.effects.parameters import SIDES
from raccoon.sim.effects.physical import states_at_rest
from raccoon.sim.plant.quantities import Plant, State

Floats = NDArray[np.float64]
Initial = State | Mapping[str, ArrayLike]


def initial_states(plant: Floats, initial: Initial | None) -> Floats:
    """The initial states, (robots, fields of State): at rest, with the values in `initial` replaced.

    Where a wheel's speed is given, the fields that follow from it (rolling speed, filtered back-EMF, speeds
    of the robot) are set to match unless they are given. Raises ConfigError for unknown fields, wrong shapes
    and numbers that are not finite.
    """
    states = states_at_rest(plant)
    if isinstance(initial, State):
        initial = initial._asdict()
    given = dict(initial or {})
    for name in given:
        if name not in State._fields:
            raise ConfigError(f"initial: there is no field {name}; allowed are {', '.join(State._fields)}")
    given = {name: _initial_value(name, value, len(states)) for name, value in given.items()}
    column = {name: index for index, name in enumerate(State._fields)}
    if "heading" in given:
        given.setdefault("heading_cos", np.cos(given["heading"]))
        given.setdefault("heading_sin", np.sin(given["heading"]))
    for side in SIDES:
        if f"speed_{side}" in given:
            _settle(given, side, plant)
    if given:
        _move_on(given, plant)
    for name, value in given.items():
        states[:, column[name]] = value
    return states


def _initial_value(name: str, value: ArrayLike, robots: int) -> Floats:
    values = np.asarray(value, dtype=np.float64)
    if values.shape not in ((), (1,), (robots,)):
        raise ConfigError(f"initial: {name} has the shape {values.shape}: allowed are one number or {robots}")
    if not np.all(np.isfinite(values)):
        raise ConfigError(f"initial: {name} is {value!r}: allowed are finite numbers")
    return values


def _settle(given: dict[str, ArrayLike], side: str, plant: Floats) -> None:
    at = Plant._fields.index
    speed = np.asarray(given[f"speed_{side}"], dtype=np.float64)
    counts = plant[:, at(f"counts_{side}")] * speed + plant[:, at(f"offset_{side}")]
    for field in ("wheel", "rolling", "sampled"):
        given.setdefault(f"{field}_{side}", speed)
    for field in ("recent", "older", "filtered"):
        given.setdefault(f"{field}_{side}", counts)
    filtered = np.asarray(given[f"filtered_{side}"], dtype=np.float64)
    seen = np.abs(filtered) > plant[:, at(f"dead_zone_{side}")]
    given.setdefault(f"bemf_{side}", np.where(seen, filtered, 0.0))


def _move_on(given: dict[str, ArrayLike], plant: Floats) -> None:
    """Set the robot's forward speed and yaw rate, and those of its gyro, from the rolling speeds of its
    wheels, unless they are given."""
    left, right = (
        plant[:, Plant._fields.index(f"radius_{side}")] * np.asarray(given.get(f"rolling_{side}", 0.0))
        for side in SIDES
    )
    given.setdefault("forward_speed", 0.5 * (left + right))
    given.setdefault("yaw_rate", (right - left) * plant[:, Plant._fields.index("per_track")])
    for field in ("gyro_followed", "gyro_rate"):
        given.setdefault(field, given["yaw_rate"])
