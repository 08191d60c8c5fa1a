"""What may differ from the nominal model: causes, and what robot.toml leaves open anyway.

Everything is counted in units of its prior's width: u = 0 is the nominal (or neutral) value, u = 1 one width
away. A *base* coordinate is what robot.toml gives with a standard deviation: it is refitted silently inside
it. A *cause* is an effect of the catalogue at one place, with the width of an unusual deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from raccoon.core.config import Measured, RobotConfig
from raccoon.sim.effects import Place, all_effects, effect
from raccoon.sim.parameters import SIDES, nominal

Setting = tuple[str, str | None, str]
"""Effect id, place (left, right or None for the whole robot), parameter."""
Settings = dict[Setting, float]

INSIDE = 3.5
"""Standard deviations around robot.toml's value inside which a parameter is refitted silently."""
WIDTH_FACTOR = 2.0
"""Widths of a cause over the catalogue's: deviations that are called a cause are the larger ones."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One number u. settings: what it moves; each gets `value(u)` added, or multiplied where `factor`.

    step: in u, over which columns are taken. jumps: whether readings jump where it acts, so that a column is
    also how uncertain they are there.
    """

    name: str
    settings: tuple[Setting, ...]
    value: Callable[[float], float]
    factor: bool = False
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.05
    jumps: bool = False

    def apply(self, settings: Settings, u: float) -> None:
        """Move the settings."""
        change = self.value(u)
        for key in self.settings:
            settings[key] = settings[key] * change if self.factor else settings[key] + change


Points = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect of the catalogue at one place.

    variants: for each starting guess the points (one u for each coordinate) whose secants from 0 give its
    columns. replaces: parameters that are set outright (an inverse limit, a phase) instead of added to.
    """

    id: str
    where: str | None
    coordinates: tuple[Coordinate, ...]
    variants: tuple[Points, ...]
    joint: Callable[[Settings, Sequence[float]], None] | None = None

    @property
    def name(self) -> str:
        """id, or id@where."""
        return self.id if self.where is None else f"{self.id}@{self.where}"

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def apply(self, settings: Settings, u: Sequence[float]) -> None:
        """Move the settings to where this cause has the coordinates u."""
        if self.joint is not None:
            self.joint(settings, u)
            return
        for coordinate, value in zip(self.coordinates, u, strict=True):
            coordinate.apply(settings, value)


def places(id: str, where: str | None) -> tuple[str | None, ...]:  # noqa: A002
    """The plant's places that an effect at `where` moves."""
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
            for place in places(entry.id, None):
                value = parameter.neutral
                if value is None:
                    value = parameter.initial
                if value is None:
                    value = nominal(robot, entry.id, place)
                settings[(entry.id, place, parameter.name)] = value
    settings[("inertia", None, "straight")] = 1.0
    settings[("inertia", None, "turn")] = 1.0
    return settings


def _added(
    id: str,  # noqa: A002
    where: str | None,
    parameter: str,
    width: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> Coordinate:
    keys = tuple((id, place, parameter) for place in places(id, where))
    return Coordinate(f"{id}.{parameter}", keys, lambda u: width * u, False, low, high)


def _multiplied(
    id: str,  # noqa: A002
    where: str | None,
    width: float,
    low: float = -math.inf,
    high: float = math.inf,
) -> Coordinate:
    keys = tuple((id, place, "factor") for place in places(id, where))
    return Coordinate(f"{id}.factor", keys, lambda u: math.exp(width * u), True, low, high)


def base_coordinates(robot: RobotConfig, inside: float = INSIDE) -> tuple[Coordinate, ...]:
    """What robot.toml leaves open: one coordinate for each number with a standard deviation above 0.

    inside: standard deviations that a number may move.
    """
    model = robot.model
    found: list[Coordinate] = []

    def plus(id: str, where: str | None, parameter: str, number: Measured) -> None:  # noqa: A002
        if number.std > 0.0:
            found.append(_added(id, where, parameter, number.std, low=-inside, high=inside))

    def times(id: str, where: str | None, number: Measured) -> None:  # noqa: A002
        if number.std > 0.0:
            found.append(_multiplied(id, where, number.std / number.value, low=-inside, high=inside))

    plus("battery.open_circuit_voltage", None, "voltage", model.battery.open_circuit_voltage)
    plus("battery.internal_resistance", None, "resistance", model.battery.internal_resistance)
    for side, motor in (("left", model.left), ("right", model.right)):
        times("motor.armature_resistance", side, motor.armature_resistance)
        times("motor.back_emf_constant", side, motor.back_emf_constant)
        times("drive.wheel_radius", side, model.drive.wheel_radius)
        port = robot.drive.left if side == "left" else robot.drive.right
        plus("bemf.offset", side, "counts", robot.motor(port).bemf_offset or model.bemf.offset)
    plus("friction.coulomb", None, "torque", model.friction.coulomb)
    plus("friction.viscous", None, "coefficient", model.friction.viscous)
    plus("bemf.filter_lag", None, "time_constant", model.bemf.filter_time_constant)
    plus("imu.gyro_bias", None, "rate", model.imu.gyro_bias)
    times("imu.gyro_scale", None, model.imu.gyro_scale)
    times("drive.track_width", None, model.drive.track_width)
    for kind, number in (("straight", model.drive.inertia_straight), ("turn", model.drive.inertia_turn)):
        if number.std > 0.0:
            width = number.std / number.value
            found.append(_inertia(kind, width, inside))
    return tuple(found)


def _inertia(kind: str, width: float, inside: float) -> Coordinate:
    keys = (("inertia", None, kind),)
    return Coordinate(f"drive.inertia_{kind}", keys, lambda u: math.exp(width * u), True, -inside, inside)


def _limit(settings: Settings, where: str | None, u: Sequence[float]) -> None:
    for place in places("motor.current_limit", where):
        settings[("motor.current_limit", place, "limit")] = 1.0 / u[0] if u[0] > 1e-3 else math.inf


def _eccentricity(settings: Settings, where: str | None, u: Sequence[float]) -> None:
    width = WIDTH_FACTOR * effect("drive.wheel_eccentricity").parameters[0].prior_width
    for place in places("drive.wheel_eccentricity", where):
        settings[("drive.wheel_eccentricity", place, "amplitude")] = width * math.hypot(u[0], u[1])
        settings[("drive.wheel_eccentricity", place, "phase")] = math.atan2(u[1], u[0])


SHAPE_RANGE = 1.6
"""Widths that a shape may move: beyond, stiction is ordinary friction and heating a change of resistance."""
# Effects whose second parameter bends the curve: where the fits of that parameter start, and its width in the
# logarithm.
_SHAPES: Mapping[str, tuple[float, tuple[float, ...]]] = {
    "friction.stiction": (0.7, (0.2, 0.5, 1.0)),
    "motor.heating": (0.7, (6.0, 18.0)),
}
# Starting guesses in widths, for one-sided and kinked effects.
_GUESSES: Mapping[str, tuple[float, ...]] = {
    "actuation.latency": (0.5, 1.5),
    "imu.latency": (0.5, 1.2),
    "drive.backlash": (0.5, 1.0),
    "drive.wheel_slip": (0.5, 1.5),
    "bemf.dead_zone": (1.0, 2.0, 3.0, 4.0),
    "actuation.deadband": (0.5, 1.5),
    "motor.current_limit": (0.5, 0.7, 1.0),
    "bemf.filter_lag": (-0.5, 0.5),
}


DEAD_ZONE_STEP = 0.25
"""Of a dead zone's width, 20 counts: as much as readings scatter when they cross it."""


def _cause(id: str, where: str | None) -> Cause:  # noqa: A002
    entry = effect(id)
    first = entry.parameters[0]
    width = WIDTH_FACTOR * first.prior_width
    if id == "motor.current_limit":
        coordinate = Coordinate("motor.current_limit.limit", (), lambda u: u, low=0.0, high=5.0)
        guesses: tuple[Points, ...] = tuple(((u,),) for u in _GUESSES[id])
        return Cause(id, where, (coordinate,), guesses, lambda s, u: _limit(s, where, u))
    if id == "drive.wheel_eccentricity":
        pair = tuple(Coordinate(f"{id}.{part}", (), lambda u: u) for part in ("cos", "sin"))
        return Cause(id, where, pair, (((0.7, 0.0), (0.0, 0.7)),), lambda s, u: _eccentricity(s, where, u))
    if id in _SHAPES:
        return _shaped(id, where, width)
    if len(entry.parameters) == 2:
        coordinates = tuple(
            _added(id, where, each.name, WIDTH_FACTOR * each.prior_width) for each in entry.parameters
        )
        return Cause(id, where, coordinates, (((0.5, 0.0), (0.0, 0.5)),))
    if first.name == "factor":
        return Cause(id, where, (_multiplied(id, where, width),), (((0.5,),),))
    low = 0.0 if first.neutral == 0.0 and first.bounds.low == 0.0 else -math.inf
    guesses = tuple(((u,),) for u in _GUESSES.get(id, (0.5,)))
    coordinate = _added(id, where, first.name, width, low=low)
    if id == "bemf.dead_zone":
        coordinate = replace(coordinate, step=DEAD_ZONE_STEP, jumps=True)
    return Cause(id, where, (coordinate,), guesses)


def _shaped(id: str, where: str | None, width: float) -> Cause:  # noqa: A002
    entry = effect(id)
    strength, shape = entry.parameters
    log_width, starts = _SHAPES[id]
    centre = starts[len(starts) // 2]
    keys = tuple((id, place, shape.name) for place in places(id, where))

    def joint(settings: Settings, u: Sequence[float]) -> None:
        for key in keys:
            settings[(id, key[1], strength.name)] = max(width * u[0], 0.0)
            settings[key] = centre * math.exp(log_width * u[1])

    first = Coordinate(f"{id}.{strength.name}", (), lambda u: width * u, low=0.0)
    second = Coordinate(
        f"{id}.{shape.name}",
        (),
        lambda u: centre * math.exp(log_width * u),
        low=-SHAPE_RANGE,
        high=SHAPE_RANGE,
    )
    guesses = tuple(((0.7, math.log(start / centre) / log_width),) for start in starts)
    return Cause(id, where, (first, second), guesses, joint)


SIDES_ONLY = ("drive.wheel_eccentricity",)


def drive_causes() -> tuple[Cause, ...]:
    """Every cause of the catalogue that a drive can show.

    Effects of a side: each side and, but for a wheel's own roundness, both at once.
    """
    found: list[Cause] = []
    for entry in all_effects():
        if entry.place is Place.TOPHAT:
            continue
        if entry.place is not Place.SIDE or not entry.id.startswith(SIDES_ONLY):
            found.append(_cause(entry.id, None))
        if entry.place is Place.SIDE:
            found.extend(_cause(entry.id, side) for side in SIDES)
    return tuple(found)
