"""Possible deviations from the nominal model: coordinates, and the causes that are made of them.

Every coordinate u is in units of its prior's width: u = 0 is the nominal (or neutral) value, u = 1 one width
away. A *base* coordinate is a number that robot.toml gives with a standard deviation: it is refitted within
that without being reported. A *cause* is an effect of the catalogue at one place, with the width of an
unusual deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from raccoon.core.config import RobotConfig
from raccoon.diagnose.own import OwnEffect
from raccoon.sim.effects.effect import Effect, Place, all_effects, effect
from raccoon.sim.effects.parameters import SIDES, nominal

Setting = tuple[str, str | None, str]
"""Effect id, place (left, right or None for the whole robot), parameter."""
Settings = dict[Setting, float]

WIDTH_FACTOR = 2.0
"""Factor on the catalogue's prior widths for causes: only larger deviations are reported as causes."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One number u. settings: those that it changes: `value(u)` is added to each, or multiplies it (factor).

    low, high: bounds of u. from_zero: added to a setting of 0 per unit of u, since a factor would not change
    it. usual: value that a factor multiplies instead of a setting of 0. step: difference of u for the
    columns. It is small because the response has kinks where wheels break loose, and columns over longer
    steps do not cancel along directions in which nothing changes.
    """

    name: str
    settings: tuple[Setting, ...]
    value: Callable[[float], float]
    factor: bool = False
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.001
    from_zero: float = 0.0
    usual: float = 0.0

    def apply(self, settings: Settings, u: float) -> None:
        """Apply the coordinate at u to the settings, in place."""
        change = self.value(u)
        for key in self.settings:
            if not self.factor:
                settings[key] += change
            elif number := settings[key] or self.usual:
                settings[key] = number * change
            else:
                settings[key] = max(self.from_zero * u, 0.0)

    def beside(self, settings: Settings) -> Coordinate:
        """The coordinate for settings that already contain some of a one-sided quantity: it may then also be
        negative, down to a quantity of 0 and at most as far as it may be positive."""
        if self.low != 0.0 or self.factor:
            return self
        present = min((settings[key] for key in self.settings), default=0.0)
        return replace(self, low=max(-self.high, -present / self.value(1.0))) if present > 0.0 else self

    def units_of(self, other: Coordinate) -> float:
        """One unit of this coordinate in units of another coordinate of the same settings."""
        if self.factor:
            return math.log(self.value(1.0)) / math.log(other.value(1.0))
        return self.value(1.0) / other.value(1.0)


FORM_PARAMETERS = {"drive.wheel_slip": "at_once"}
"""Parameters that choose between two forms of an effect, by id: values between them have no meaning, so no
fit changes them, and a search uses one form or the other."""
Points = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect of the catalogue at one place.

    variants: for each starting guess the points (one u per coordinate) whose secants from 0 are its columns.
    joint: sets the parameters from all coordinates, if one depends on several (a strength and its shape).
    own: a team's own effect, which is not in the catalogue.
    """

    id: str
    where: str | None
    coordinates: tuple[Coordinate, ...]
    variants: tuple[Points, ...]
    joint: Callable[[Settings, Sequence[float]], None] | None = None
    own: OwnEffect | None = None

    @property
    def effect(self) -> Effect:
        """Its entry in the catalogue, or the team's own effect."""
        return effect(self.id) if self.own is None else self.own

    @property
    def places(self) -> tuple[str | None, ...]:
        """The plant's places that it affects."""
        return (None,) if self.own is not None else affected_places(self.id, self.where)

    @property
    def name(self) -> str:
        """id, or id@where."""
        return cause_name(self.id, self.where)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def one_sided(self) -> bool:
        """Whether its first coordinate cannot be negative."""
        return self.coordinates[0].low == 0.0

    def apply(self, settings: Settings, u: Sequence[float]) -> None:
        """Apply this cause at coordinates u to the settings, in place."""
        if self.joint is not None:
            self.joint(settings, u)
            return
        for coordinate, value in zip(self.coordinates, u, strict=True):
            coordinate.apply(settings, value)


def cause_name(id: str, where: str | None) -> str:  # noqa: A002
    """id, or id@where."""
    return id if where is None else f"{id}@{where}"


def lookup_by_prefix(table: Mapping[str, float], name: str, otherwise: float) -> float:
    """The number of the first entry with which a cause's name begins; `otherwise` if there is none."""
    return next((number for start, number in table.items() if name.startswith(start)), otherwise)


def affected_places(id: str, where: str | None) -> tuple[str | None, ...]:  # noqa: A002
    """The plant's places that an effect at `where` affects."""
    if effect(id).place is not Place.SIDE:
        return (None,)
    return SIDES if where is None else (where,)


def neutral_settings(robot: RobotConfig) -> Settings:
    """Every parameter of every drive effect at its neutral or nominal value."""
    settings: Settings = {}
    for entry in all_effects():
        if entry.place is Place.TOPHAT:
            continue
        for parameter in entry.parameters:
            for place in affected_places(entry.id, None):
                value = parameter.neutral
                if value is None:
                    value = parameter.initial
                if value is None:
                    value = nominal(robot, entry.id, place)
                settings[(entry.id, place, parameter.name)] = value
    settings[("inertia", None, "straight")] = 1.0
    settings[("inertia", None, "turn")] = 1.0
    return settings


def additive_coordinate(
    id: str,  # noqa: A002
    where: str | None,
    parameter: str,
    width: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> Coordinate:
    """A coordinate whose u adds u widths to an effect's parameter."""
    keys = tuple((id, place, parameter) for place in affected_places(id, where))
    return Coordinate(f"{id}.{parameter}", keys, lambda u: width * u, False, low, high)


def multiplicative_coordinate(
    id: str,  # noqa: A002
    where: str | None,
    width: float,
    low: float = -math.inf,
    high: float = math.inf,
    parameter: str = "factor",
    usual: float = 0.0,
) -> Coordinate:
    """A coordinate whose u multiplies an effect's parameter, or `usual` if that is 0, by exp(u widths)."""
    keys = tuple((id, place, parameter) for place in affected_places(id, where))
    return Coordinate(f"{id}.{parameter}", keys, lambda u: math.exp(width * u), True, low, high, usual=usual)
