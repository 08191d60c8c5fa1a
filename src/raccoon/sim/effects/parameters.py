"""A simulated robot's numbers: the nominal model of a RobotConfig plus the effects that are switched on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import Effect, Place, effect
from raccoon.sim.effects.provenance import UNKNOWN, Origin, Provenance

SIDES = ("left", "right")
Key = tuple[str, str | None]
"""Effect id and place: left, right, a port number, or None for everywhere."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """The numbers of a simulated robot. Immutable; every change returns a new object. Can be pickled, for
    runs in other processes.

    robot: ports, wiring and the nominal model. effects: what is switched on, by id and place. chain: how the
    controller samples and filters. origins and provenance: where numbers come from; they do not count in
    comparisons. An effect that is changed loses its origin.
    """

    robot: RobotConfig = field(default_factory=RobotConfig)
    effects: Mapping[Key, Mapping[str, float]] = field(default_factory=dict)
    chain: Chain = field(default_factory=Chain)
    origins: Mapping[Key, Origin] = field(default_factory=dict, compare=False)
    provenance: Provenance = field(default=UNKNOWN, compare=False)

    @classmethod
    def from_robot(cls, config: RobotConfig) -> Parameters:
        """The nominal robot: every effect off."""
        return cls(robot=config)

    @classmethod
    def from_model_file(cls, path: str | Path, robot: RobotConfig | None = None) -> Parameters:
        """Read a `model.toml`. robot: gives the numbers for a file with effects alone; by default the default
        robot. Raises ConfigError naming file, key, value and what is allowed."""
        from raccoon.sim.effects.model_file import load_model

        return load_model(path, robot)

    def save(self, path: str | Path) -> None:
        """Write a `model.toml`, atomically."""
        from raccoon.sim.effects.model_file import save_model

        save_model(self, path)

    def with_effect(self, id: str, where: str | None = None, **values: float) -> Parameters:  # noqa: A002
        """Switch an effect on, or change it.

        A parameter that is not named keeps its value, or takes the catalogue's initial one if the effect was
        off. An effect given with `where=None` replaces what was given for single places before. Raises
        ConfigError for an unknown id, parameter or place and for a value out of bounds.
        """
        entry = effect(id)
        place = self._place(entry, where)
        checked = {name: entry.check(name, value) for name, value in values.items()}
        before = self.effects.get((id, place), self.effects.get((id, None), {}))
        start = {each.name: each.initial for each in entry.parameters if each.initial is not None}
        kept = {
            key: value for key, value in self.effects.items() if key[0] != id or (place and key[1] != place)
        }
        origins = {key: each for key, each in self.origins.items() if key in kept and key != (id, place)}
        kept[(id, place)] = {**start, **before, **checked}
        return replace(self, effects=kept, origins=origins)

    def with_origin(self, id: str, where: str | None, origin: Origin) -> Parameters:  # noqa: A002
        """Set where the numbers of an effect come from. Raises ConfigError for an effect that is off, and for
        the standard deviation of a parameter that it does not have."""
        key = (id, self._place(effect(id), where))
        if key not in self.effects:
            raise ConfigError(
                f"{id}: the effect is off at {where or 'both sides'}, so its numbers have no origin"
            )
        for name in origin.std:
            effect(id).parameter(name)
        return replace(self, origins={**self.origins, key: origin})

    def with_chain(self, chain: Chain) -> Parameters:
        """The same robot behind another sensor chain."""
        return replace(self, chain=chain)

    def value(self, id: str, name: str, where: str | None = None) -> float:  # noqa: A002
        """The present value of a parameter: as switched on for this place or everywhere, else neutral or
        nominal.

        where: left or right for an effect of a side (required if the sides may differ), the port for a
        tophat's.
        """
        entry = effect(id)
        parameter = entry.parameter(name)
        for key in ((id, self._place(entry, where)), (id, None)):
            values = self.effects.get(key)
            if values is not None and name in values:
                return values[name]
        if parameter.neutral is not None:
            return parameter.neutral
        if parameter.initial is not None:
            return parameter.initial
        return nominal(self.robot, id, where)

    def _place(self, entry: Effect, where: str | None) -> str | None:
        if where is None or (where in SIDES and entry.place is Place.SIDE):  # what the plant asks for
            return where
        if entry.place is Place.SIDE:
            ports = {str(self.robot.drive.left): "left", str(self.robot.drive.right): "right"}
            allowed = {"left": "left", "right": "right", **ports}
        elif entry.place is Place.TOPHAT:
            allowed = {str(each.analog): str(each.analog) for each in self.robot.tophats.values()}
        else:
            allowed = {}
        if where not in allowed:
            nothing = "nothing: " + (
                "robot.toml has no tophat" if entry.place is Place.TOPHAT else "it belongs to the whole robot"
            )
            choice = ", ".join(allowed) or nothing
            meant = did_you_mean(where, allowed)
            raise ConfigError(f"{entry.id}: where is {where!r}{meant}: allowed are {choice}")
        return allowed[where]


def nominal(robot: RobotConfig, id: str, where: str | None) -> float:  # noqa: A002
    """The value in robot.toml of a parameter whose neutral value is the nominal one."""
    model = robot.model
    if id == "bemf.offset" and where in SIDES:
        port = robot.drive.left if where == "left" else robot.drive.right
        calibrated = robot.motor(port).bemf_offset
        return (calibrated or model.bemf.offset).value
    return {
        "battery.open_circuit_voltage": model.battery.open_circuit_voltage,
        "battery.internal_resistance": model.battery.internal_resistance,
        "friction.coulomb": model.friction.coulomb,
        "friction.viscous": model.friction.viscous,
        "bemf.offset": model.bemf.offset,
        "bemf.filter_lag": model.bemf.filter_time_constant,
        "imu.gyro_bias": model.imu.gyro_bias,
    }[id].value
