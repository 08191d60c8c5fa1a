"""The type of effects: a way in which a robot can differ from the textbook one, as data. `catalogue` lists
them.

An effect that is off has its neutral value, at which it changes nothing, exactly. `docs/simulator.md` says
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
    """The whole robot: `where` is not given."""
    SIDE = "side"
    """left or right (or the motor port of that side); both sides if not given."""
    TOPHAT = "tophat"
    """The analog port of a tophat; all of them if not given."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    neutral: the value at which it changes nothing; None if that is the nominal value of robot.toml, or if the
    effect is off because its first parameter is neutral. initial: where a fit starts, and the value when the
    effect is switched on without naming this parameter. prior_width: the size of a usual deviation from
    neutral.
    """

    name: str
    unit: str
    neutral: float | None
    bounds: Bounds
    prior_width: float
    initial: float | None = None


@dataclass(frozen=True, slots=True)
class Effect:
    """A cause of differences between recordings of two robots."""

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
        """`value`, if the parameter allows it. Raises ConfigError naming parameter, value and bounds."""
        parameter = self.parameter(name)
        unit = f" {parameter.unit}" if parameter.unit else ""
        if isinstance(value, bool) or not isinstance(value, SupportsFloat):
            raise ConfigError(f"{self.id}: {name} is {value!r}: it must be a number")
        try:
            number = float(value)
        except OverflowError:  # a whole number of hundreds of digits
            raise ConfigError(
                f"{self.id}: {name} is {format_value(value)}: the number is too large"
            ) from None
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
    """Every effect, in the order of the flow of energy from the battery to the sensors."""
    from raccoon.sim.effects.catalogue import CATALOGUE

    return tuple(CATALOGUE.values())
