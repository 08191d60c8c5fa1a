"""What an effect is: a way in which a robot can differ from the textbook one, as data. `catalogue` has all.

An effect that is off sits at its neutral value, where it changes nothing, exactly. `docs/simulator.md` says
how to add one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import SupportsFloat

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.core.schema import Bounds, format_value


class Place(StrEnum):
    """What `where` may name."""

    ROBOT = "robot"
    """Nothing: the effect belongs to the whole robot."""
    SIDE = "side"
    """left or right (or the motor port of that side); without it, both sides."""
    TOPHAT = "tophat"
    """The analog port of a tophat; without it, all of them."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    neutral: the value at which it changes nothing; None where that is the nominal value of robot.toml, or
    where the effect is off anyway because its first parameter is neutral. initial: where a fit starts, and
    what is taken when the effect is switched on without naming this parameter. prior_width: the size of a
    usual deviation from neutral.
    """

    name: str
    unit: str
    neutral: float | None
    bounds: Bounds
    prior_width: float
    initial: float | None = None


@dataclass(frozen=True, slots=True)
class Effect:
    """A cause by which recordings of two robots differ."""

    id: str
    sentence: str
    parameters: tuple[Parameter, ...]
    place: Place = Place.ROBOT

    @property
    def group(self) -> str:
        """Battery, motor, friction, drive, actuation, bemf, imu or tophat."""
        return self.id.split(".", 1)[0]

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name. Raises ConfigError."""
        for each in self.parameters:
            if each.name == name:
                return each
        allowed = [each.name for each in self.parameters]
        raise ConfigError(
            f"{self.id}: there is no parameter {name}{did_you_mean(name, allowed)}; allowed are"
            f" {', '.join(allowed)}"
        )

    def check(self, name: str, value: object) -> float:
        """`value` where the parameter allows it. Raises ConfigError naming all of them."""
        parameter = self.parameter(name)
        unit = f" {parameter.unit}" if parameter.unit else ""
        if isinstance(value, bool) or not isinstance(value, SupportsFloat):
            raise ConfigError(f"{self.id}: {name} is {value!r}: it must be a number")
        try:
            number = float(value)
        except OverflowError:  # a whole number of hundreds of digits
            raise ConfigError(f"{self.id}: {name} is {format_value(value)}: no float is as large") from None
        if math.isnan(number) or not parameter.bounds.allows(number):
            raise ConfigError(f"{self.id}: {name} is {number:g}{unit}: allowed are {parameter.bounds}")
        return number


@cache
def effect(id: str) -> Effect:  # noqa: A002
    """The effect of that id. Raises ConfigError."""
    from raccoon.sim.effects.catalogue import CATALOGUE

    try:
        return CATALOGUE[id]
    except KeyError:
        raise ConfigError(
            f"effect {id!r}: there is no such id{did_you_mean(id, CATALOGUE)}; allowed are"
            f" {', '.join(CATALOGUE)}"
        ) from None


def all_effects() -> tuple[Effect, ...]:
    """Every effect, in the order of the energy's way from the battery to the sensors."""
    from raccoon.sim.effects.catalogue import CATALOGUE

    return tuple(CATALOGUE.values())
