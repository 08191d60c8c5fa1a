"""Slow variations that are no fault of the robot: of its floor's friction, and of its battery's voltage.

Each is an Ornstein-Uhlenbeck process with a correlation time of seconds. A long recording is processed in
pieces: as a whole, time and memory would grow with the square of its length.
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
"""Correlation time in s of slowly varying floor friction."""
KNOT_SPACING = 0.2
"""Distance of the knots of a process, as a share of its correlation time."""
MAX_GROWTH = 300.0
"""Number of correlation times over which a sum may grow exponentially before it is rescaled."""
PIECE_S = 40.0
"""Length of a piece in s: 10 correlation times of a floor, 4 of a battery."""


def split_into_pieces(features: Features) -> list[slice]:
    """Bins of each piece, which consists of whole half seconds and lasts about `PIECE_S`."""
    bins, event = len(features.time), features.event
    count = max(int(bins * features.width / PIECE_S + 0.5), 1)
    edges = [event * round(bins / event * part / count) for part in range(count)]
    return [slice(start, end) for start, end in zip(edges, [*edges[1:], bins], strict=True)]


@dataclass(frozen=True, slots=True)
class Piece:
    """The slowly varying directions of a part of a recording. friction, creep (columns, bins, channels):
    responses to a variation of the size of Coulomb friction, and to a battery's usual creep, in the part and
    in the `margin` bins before it, which the noise's autoregression needs. bins: those of the part itself."""

    bins: slice
    margin: int
    friction: Array
    creep: Array

    @classmethod
    def of(cls, problem: Problem, linear: LinearModel, bins: slice, memory: int) -> Piece:
        """The piece of these bins. memory: largest order of the noise's autoregression, in bins."""
        margin = min(memory, bins.start)
        span = slice(bins.start - margin, bins.stop)
        friction = wandering_friction_columns(problem, linear, bins=span)
        return cls(bins, margin, friction, creeping_battery_columns(problem, linear, span))

    @property
    def span(self) -> slice:
        """The part's bins and the margin before them."""
        return slice(self.bins.start - self.margin, self.bins.stop)

    def inside(self, columns: Array) -> Array:
        """Columns of the span, cut to the part itself."""
        return columns[:, self.margin :]

    def whitened(self, noise: NoiseModel, columns: Array) -> Array:
        """Columns of the span, whitened by the noise model and cut to the part itself."""
        return self.inside(noise.part(self.span).whiten(columns))


def wandering_friction_columns(
    problem: Problem, linear: LinearModel, seconds: float = FLOOR_CORRELATION_S, bins: slice = slice(None)
) -> Array:
    """Columns, in these bins, of a torque at each wheel that varies with that correlation time, with a
    standard deviation equal to the Coulomb friction.

    The robot forgets a torque within 0.1 s, so the response to friction that changes over seconds is the
    response to a constant friction times the process. Only the angle that a wheel lost by it stays lost,
    which shows if wheels are eccentric. The angle lost before these bins is one more column.
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
    """Columns of a battery whose voltage creeps by some mV for seconds after each change of its current."""
    roles, shape = problem.features.roles, linear.residual[bins].shape
    if "battery" not in roles:
        return np.zeros((0, *shape))
    course = ornstein_uhlenbeck_basis(problem.features.time[bins], problem.creep.seconds)
    columns = np.zeros((len(course), *shape))
    columns[:, :, roles.index("battery")] = problem.creep.volts * course
    return columns


def ornstein_uhlenbeck_basis(time: Array, seconds: float) -> Array:
    """Basis (knots, bins) of an Ornstein-Uhlenbeck process of standard deviation 1 and that correlation time:
    its rows, each multiplied by an independent standard normal number, sum to the process on a grid of hat
    functions. A gap without bins has no knots; the correlation decays there as in any other time."""
    grid = KNOT_SPACING * seconds
    before = np.unique(np.floor((time - time[0]) / grid).astype(int))
    knots = time[0] + grid * np.union1d(before, before + 1)
    hats = np.maximum(0.0, 1.0 - np.abs(time[None, :] - knots[:, None]) / grid)
    factor = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots[None, :]) / seconds))
    return np.asarray(factor.T @ hats, float)


def covariance_of_sums(weights: Array, time: Array, seconds: float) -> Array:
    """Covariance (sums, sums) of sums over bins of a process of standard deviation 1 and that correlation
    time. weights (sums, bins): of each bin; those of bins i and j count times exp(-|t_i - t_j| / seconds)."""
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
    """Change of the readings in these bins due to the angles that wheels lost or gained until then by columns
    (columns, bins, channels)."""
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
    """Change of the readings in these bins due to the angle that each wheel lost before them, of one standard
    deviation, (wheels, bins, channels)."""
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
    """Response to a rad of an eccentric wheel, (bins, channels); None for a wheel that is not."""
    name = f"drive.wheel_eccentricity@{side}"
    span = linear.point.spans().get(name)
    if span is None:
        return None
    along, across = linear.point.active[name]  # amplitude times cosine and sine of the phase
    return np.asarray(along * linear.jacobian[span.start + 1] - across * linear.jacobian[span.start], float)
