"""The causes of the catalogue that a drive can show: their coordinates, and where their fits start."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from operator import mul

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.hypotheses.coordinates import (
    FORM_PARAMETERS,
    WIDTH_FACTOR,
    Cause,
    Coordinate,
    Points,
    Settings,
    additive_coordinate,
    affected_places,
    multiplicative_coordinate,
    neutral_settings,
)
from raccoon.diagnose.own import OwnEffect
from raccoon.sim.effects.effect import Place, all_effects, effect
from raccoon.sim.effects.parameters import SIDES

TURN_SCALE_CAUSES = ("drive.wheel_radius", "drive.track_width", "imu.gyro_scale")
"""Causes of a wrong turn rate, scale r w / b, which only a reference of the pose tells apart."""


def _limit(settings: Settings, where: str | None, u: Sequence[float]) -> None:
    for place in affected_places("motor.current_limit", where):
        settings[("motor.current_limit", place, "limit")] = 1.0 / u[0] if u[0] > 1e-3 else math.inf


def _eccentricity(settings: Settings, where: str | None, u: Sequence[float]) -> None:
    width = WIDTH_FACTOR * effect("drive.wheel_eccentricity").parameters[0].prior_width
    for place in affected_places("drive.wheel_eccentricity", where):
        settings[("drive.wheel_eccentricity", place, "amplitude")] = width * math.hypot(u[0], u[1])
        settings[("drive.wheel_eccentricity", place, "phase")] = math.atan2(u[1], u[0])


SHAPE_RANGE = 1.6
"""Bound of a shape coordinate, in widths: beyond it stiction is ordinary friction, and heating a change of
resistance."""
# Effects whose second parameter is the shape of the response: the width of its logarithm, and the values from
# which its fits start.
_SHAPES: Mapping[str, tuple[float, tuple[float, ...]]] = {
    "drive.backlash": (1.0, (0.01,)),
    "friction.stiction": (0.7, (0.2, 0.5, 1.0)),
    "motor.heating": (0.7, (6.0, 18.0)),
}
MAX_CURRENT_LIMIT = 2.0
"""A; the highest current limit that is tried."""
# Starting points of the fits, in widths, for one-sided effects and those whose response has kinks.
_GUESSES: Mapping[str, tuple[float, ...]] = {
    "actuation.latency": (0.5, 1.5),
    "imu.latency": (0.5, 1.2),
    "drive.backlash": (0.1, 0.5, 1.0),
    "drive.wheel_slip": (0.15, 0.5, 1.5),
    "bemf.dead_zone": (0.15, 0.3, 1.0, 2.0, 4.0),
    "actuation.deadband": (0.15, 0.5, 1.5),
    "motor.current_limit": (1.0 / MAX_CURRENT_LIMIT, 0.7, 1.0),
    "bemf.filter_lag": (-0.5, 0.5),
}
# Finite-difference steps, in widths, of effects whose response is a staircase: those that shift an event by
# whole steps of a clock, and backlash, whose teeth touch and part.
_STEPS: Mapping[str, float] = {
    "actuation.latency": 0.05,
    "imu.latency": 0.05,
    "drive.backlash": 0.05,
}


MAX_ASYMMETRY = 0.95
"""Bound of the difference by direction: at 1 friction would push the robot in one direction."""


def _cause(id: str, where: str | None) -> Cause:  # noqa: A002
    entry = effect(id)
    first = entry.parameters[0]
    width = WIDTH_FACTOR * first.prior_width
    if id == "motor.current_limit":
        coordinate = Coordinate(f"{id}.limit", (), lambda u: u, low=0.0, high=5.0)
        guesses: tuple[Points, ...] = tuple(((u,),) for u in _GUESSES[id])
        return Cause(id, where, (coordinate,), guesses, lambda s, u: _limit(s, where, u))
    if id == "drive.wheel_eccentricity":
        pair = tuple(Coordinate(f"{id}.{part}", (), lambda u: u) for part in ("cos", "sin"))
        return Cause(id, where, pair, (((0.7, 0.0), (0.0, 0.7)),), lambda s, u: _eccentricity(s, where, u))
    if id in _SHAPES:
        return _with_shape(id, where, width)
    if id == "friction.direction_dependent":
        return _direction_dependent(id, where)
    if len(entry.parameters) == 2 and id not in FORM_PARAMETERS:
        coordinates = tuple(
            additive_coordinate(id, where, each.name, WIDTH_FACTOR * each.prior_width)
            for each in entry.parameters
        )
        return Cause(id, where, coordinates, (((0.5, 0.0), (0.0, 0.5)),))
    if first.name == "factor":
        return Cause(id, where, (multiplicative_coordinate(id, where, width),), (((0.5,),),))
    if id == "friction.coulomb":
        usual = RobotConfig().model.friction.coulomb.value
        share = replace(
            multiplicative_coordinate(id, where, width / usual, parameter="torque"), from_zero=width
        )
        return Cause(id, where, (share,), (((0.5,),),))
    low = 0.0 if first.neutral == 0.0 and first.bounds.low == 0.0 else -math.inf
    guesses = tuple(((u,),) for u in _GUESSES.get(id, (0.5,)))
    coordinate = additive_coordinate(id, where, first.name, width, low=low)
    coordinate = replace(coordinate, step=_STEPS.get(id, coordinate.step))
    return Cause(id, where, (coordinate,), guesses)


def _direction_dependent(id: str, where: str | None) -> Cause:  # noqa: A002
    """Friction that differs by direction, as a share of a usual robot's friction.

    The effect's own parameters are shares of the current friction. As coordinates they would change whenever
    another cause changes the friction, and the response would not be linear in both.
    """
    pairs = (
        ("asymmetry", "friction.coulomb", "torque"),
        ("viscous_asymmetry", "friction.viscous", "coefficient"),
    )
    widths = {each.name: WIDTH_FACTOR * each.prior_width for each in effect(id).parameters}
    usual = neutral_settings(RobotConfig())

    def joint(settings: Settings, u: Sequence[float]) -> None:
        for place in affected_places(id, where):
            for value, (name, friction, parameter) in zip(u, pairs, strict=True):
                key = (friction, place, parameter)
                share = usual[key] / max(settings[key], 1e-6)
                whole = settings[(id, place, name)] + widths[name] * value * share
                settings[(id, place, name)] = float(np.clip(whole, -MAX_ASYMMETRY, MAX_ASYMMETRY))

    coordinates = tuple(Coordinate(f"{id}.{name}", (), lambda u: u) for name, _, _ in pairs)
    return Cause(id, where, coordinates, (((0.5, 0.0), (0.0, 0.5)),), joint)


def _with_shape(id: str, where: str | None, width: float) -> Cause:  # noqa: A002
    entry = effect(id)
    strength, shape = entry.parameters
    log_width, starts = _SHAPES[id]
    centre = starts[len(starts) // 2]
    keys = tuple((id, place, shape.name) for place in affected_places(id, where))

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
    first, second = (replace(each, step=_STEPS.get(id, each.step)) for each in (first, second))
    guesses = tuple(
        ((size, math.log(start / centre) / log_width),)
        for size in _GUESSES.get(id, (0.7,))
        for start in starts
    )
    return Cause(id, where, (first, second), guesses, joint)


NUISANCE_EFFECTS = ("friction.presliding", "imu.low_pass")
"""Effects that fault-free robots have as well: fitted as a nuisance, never named as a cause. See
`base_coordinates.Wheels` and `plant_rollout.Habits`."""
SIDES_ONLY = ("drive.wheel_eccentricity",)


def drive_causes() -> tuple[Cause, ...]:
    """Every cause of the catalogue that a drive can show.

    An effect of a side is three causes: left, right, and both alike (but for wheels that are not round, each
    of which has a phase of its own).
    """
    found: list[Cause] = []
    for entry in all_effects():
        if entry.place is Place.TOPHAT or entry.id in NUISANCE_EFFECTS:
            continue
        if entry.place is not Place.SIDE or not entry.id.startswith(SIDES_ONLY):
            found.append(_cause(entry.id, None))
        if entry.place is Place.SIDE:
            found.extend(_cause(entry.id, side) for side in SIDES)
    return tuple(found)


def causes_from(causes: Sequence[Cause], settings: Settings) -> dict[str, Cause]:
    """Causes by name, with bounds that fit the settings they start from: where these have some of a one-sided
    effect already, there may be less of it. A cause that sets its numbers itself starts from zero anyway."""
    return {each.name: _bounded_from(each, settings) for each in causes}


def _bounded_from(cause: Cause, settings: Settings) -> Cause:
    first, *others = cause.coordinates
    plain = cause.one_sided and cause.joint is None and cause.own is None
    if not plain or any(settings[key] <= 0.0 for key in first.settings):
        return cause
    return replace(cause, coordinates=(replace(first, low=-math.inf), *others))


OWN_EFFECT_START = 0.5
"""Starting point of the fits of a team's own effect, in widths."""
MIN_POSITIVE_WIDTHS = 1e-6
"""Lower bound of a parameter that must be above 0, in prior standard deviations."""


def own_cause(own: OwnEffect) -> Cause:
    """A team's own effect as a cause. Its coordinates are the deviations from the neutral values."""
    coordinates = []
    for each in own.parameters:
        width, neutral = WIDTH_FACTOR * each.prior_width, float(each.neutral or 0.0)
        least = MIN_POSITIVE_WIDTHS * each.prior_width if each.bounds.positive else -math.inf
        low, high = ((bound - neutral) / width for bound in (max(each.bounds.low, least), each.bounds.high))
        add = partial(mul, width)
        coordinates.append(
            Coordinate(f"{own.id}.{each.name}", ((own.id, None, each.name),), add, False, min(low, 0.0), high)
        )
    starts = np.diag([_start_inside_bounds(each) for each in coordinates])
    points = tuple(tuple(map(float, row)) for row in starts)
    return Cause(own.id, None, tuple(coordinates), (points,), own=own)


def _start_inside_bounds(coordinate: Coordinate) -> float:
    """OWN_EFFECT_START in the direction in which the bounds leave more room, or as much as they allow."""
    low, high = max(coordinate.low, -OWN_EFFECT_START), min(coordinate.high, OWN_EFFECT_START)
    return high if high >= -low else low
