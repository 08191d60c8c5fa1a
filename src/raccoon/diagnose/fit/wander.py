"""What wanders slowly and is no fault of the robot: the friction of its floor, and its battery's voltage.

Either is an Ornstein-Uhlenbeck process with a correlation time of seconds, so a long recording is treated in
pieces: as a whole it would take time and memory by the square of its length.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.fit.linear_model import LinearModel, coulomb_response, wheel_speed
from raccoon.diagnose.fit.noise_model import NoiseModel
from raccoon.diagnose.fit.problem import Problem
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

FLOOR_CORRELATION_S = 4.0
"""Correlation time of friction that wanders with the floor."""
KNOT_SPACING = 0.2
"""Distance of a course's knots, as a share of its correlation time."""
MAX_GROWTH = 300.0
"""Correlation times over which a sum may grow exponentially before it is rescaled."""
PIECE_S = 40.0
"""Length of a piece in s: 10 correlation times of a floor, 4 of a battery."""


def split_into_pieces(features: Features) -> list[slice]:
    """Bins of each piece, which consists of whole half seconds and lasts some `PIECE_S`."""
    bins, event = len(features.time), features.event
    count = max(int(bins * features.width / PIECE_S + 0.5), 1)
    edges = [event * round(bins / event * part / count) for part in range(count)]
    return [slice(start, end) for start, end in zip(edges, [*edges[1:], bins], strict=True)]


@dataclass(frozen=True, slots=True)
class Piece:
    """The wandering directions of a part of a recording. friction, creep (columns, bins, channels): responses
    to a wander of all of Coulomb friction, and of a battery's usual creep, in the part and in the `margin`
    bins before it, which the noise's memory needs. bins: those of the part itself."""

    bins: slice
    margin: int
    friction: Array
    creep: Array

    @classmethod
    def of(cls, problem: Problem, linear: LinearModel, bins: slice, memory: int) -> Piece:
        """memory: bins that the noise remembers at most."""
        margin = min(memory, bins.start)
        span = slice(bins.start - margin, bins.stop)
        friction = wandering_friction_columns(problem, linear, bins=span)
        return cls(bins, margin, friction, creeping_battery_columns(problem, linear, span))

    @property
    def span(self) -> slice:
        """The part's bins and those before."""
        return slice(self.bins.start - self.margin, self.bins.stop)

    def inside(self, columns: Array) -> Array:
        """Columns of the span in the part itself."""
        return columns[:, self.margin :]

    def whitened(self, noise: NoiseModel, columns: Array) -> Array:
        """Columns of the span, whitened by the noise model, in the part itself."""
        return self.inside(noise.part(self.span).whiten(columns))


def wandering_friction_columns(
    problem: Problem, linear: LinearModel, seconds: float = FLOOR_CORRELATION_S, bins: slice = slice(None)
) -> Array:
    """Columns, in these bins, of a torque at either wheel that wanders with that correlation time, by all of
    Coulomb friction (one standard deviation).

    The robot forgets a torque within 0.1 s, so friction that changes over seconds acts as its constant
    response times its course. Only the angle that a wheel lost by it stays lost, which shows where wheels are
    not round. What it lost before these bins is one number more.
    """
    course = ornstein_uhlenbeck_basis(problem.features.time[bins], seconds)
    columns = []
    for side in SIDES:
        response = coulomb_response(problem, linear, side)
        if response is None:
            continue
        torque = problem.neutral[("friction.coulomb", side, "torque")]
        at_once = torque * (
            response - _response_to_lost_angle(problem, linear, response[None], slice(None))[0]
        )
        column = course[:, :, None] * at_once[bins]
        columns.append(column + _response_to_lost_angle(problem, linear, column, bins))
        columns.append(_response_to_earlier_loss(problem, linear, at_once, bins, seconds))
    return np.concatenate(columns) if columns else np.zeros((0, *linear.residual[bins].shape))


def creeping_battery_columns(problem: Problem, linear: LinearModel, bins: slice = slice(None)) -> Array:
    """Columns of a battery whose voltage creeps: after each change of its current by some mV, for seconds."""
    roles, shape = problem.features.roles, linear.residual[bins].shape
    if "battery" not in roles:
        return np.zeros((0, *shape))
    course = ornstein_uhlenbeck_basis(problem.features.time[bins], problem.creep.seconds)
    columns = np.zeros((len(course), *shape))
    columns[:, :, roles.index("battery")] = problem.creep.volts * course
    return columns


def ornstein_uhlenbeck_basis(time: Array, seconds: float) -> Array:
    """What a wander of size 1 and that correlation time is made of, (knots, bins): each times a normal number
    is an Ornstein-Uhlenbeck process on a grid of hats. In a gap without bins there are no knots, and as much
    is forgotten there as in any other time."""
    grid = KNOT_SPACING * seconds
    before = np.unique(np.floor((time - time[0]) / grid).astype(int))
    knots = time[0] + grid * np.union1d(before, before + 1)
    hats = np.maximum(0.0, 1.0 - np.abs(time[None, :] - knots[:, None]) / grid)
    factor = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots[None, :]) / seconds))
    return np.asarray(factor.T @ hats, float)


def covariance_of_sums(weights: Array, time: Array, seconds: float) -> Array:
    """Covariance (sums, sums) of sums over bins of a course of size 1 and that correlation time, each bin
    counted by weights (sums, bins): those of bins i and j times exp(-|t_i - t_j| / seconds)."""
    since = (time - time[0]) / seconds
    before, remembered = np.empty_like(weights), np.zeros((len(weights), 1))
    edges = np.searchsorted(since, np.arange(0.0, since[-1] + MAX_GROWTH, MAX_GROWTH))
    for begin, end in pairwise(np.unique([*edges, len(since)]).tolist()):
        growth = np.exp(since[begin:end] - since[begin])
        grown = remembered + np.cumsum(weights[:, begin:end] * growth, axis=1)
        before[:, begin : begin + 1] = remembered
        before[:, begin + 1 : end] = grown[:, :-1] / growth[1:]
        if end < len(since):
            remembered = grown[:, -1:] * np.exp(since[begin] - since[end])
    cross = weights @ before.T
    return np.asarray(weights @ weights.T + cross + cross.T, float)


def _response_to_lost_angle(problem: Problem, linear: LinearModel, columns: Array, bins: slice) -> Array:
    """What the angles that wheels lose or gain by columns (columns, bins, channels) change from then on, in
    these bins."""
    changed = np.zeros_like(columns)
    for side in SIDES:
        wheel = _eccentricity_response(linear, side)
        speeds = None if wheel is None else wheel_speed(problem, columns, side)
        if wheel is not None and speeds is not None:
            changed += problem.features.width * np.cumsum(speeds, axis=1)[:, :, None] * wheel[bins]
    return changed


def _response_to_earlier_loss(
    problem: Problem, linear: LinearModel, at_once: Array, bins: slice, seconds: float
) -> Array:
    """What the angle changes, in these bins, that each wheel usually lost before them, (wheels, bins,
    channels).
    """
    start = bins.indices(len(at_once))[0]
    found = [np.zeros((0, *at_once[bins].shape))]
    for side in SIDES if start else ():
        wheel = _eccentricity_response(linear, side)
        speeds = None if wheel is None else wheel_speed(problem, at_once[:start], side)
        if wheel is not None and speeds is not None:
            turned = problem.features.width * speeds[None]
            angle = np.sqrt(covariance_of_sums(turned, problem.features.time[:start], seconds)[0, 0])
            found.append(angle * wheel[None, bins])
    return np.concatenate(found)


def _eccentricity_response(linear: LinearModel, side: str) -> Array | None:
    """Response to a rad of a wheel that is not round, (bins, channels); None for one that is."""
    name = f"drive.wheel_eccentricity@{side}"
    span = linear.point.spans().get(name)
    if span is None:
        return None
    along, across = linear.point.active[name]  # amplitude times cosine and sine of the phase
    return np.asarray(along * linear.jacobian[span.start + 1] - across * linear.jacobian[span.start], float)
