"""The model linearised at a working point: one column for each direction in which it may differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.problem import Point, Problem, neighbouring_points
from raccoon.diagnose.fit.whitener import Whitener

Array = NDArray[np.float64]

FRICTION_STEP_WIDTHS = 0.1
"""Widths of Coulomb friction over which its torque is practically linear."""


@dataclass(frozen=True, slots=True)
class ColumnGroup:
    """Columns of one cause or probe, which are added and dropped together.

    start: coordinates at which they were computed (secants of a cause). over_place: whether they are friction
    that depends on the robot's place. parts: subsets of the columns, of which one alone may act.
    choice_penalty: log evidence that the choice of such a part costs; part: the indices of its columns.
    min_lead: lead up to which ordinary effects imitate the group if the norm of its coordinates is below
    `usual`; min_lead_if_larger: the same above.
    """

    name: str
    columns: Array
    start: tuple[float, ...] = ()
    one_sided: bool = False
    over_place: bool = False
    parts: tuple[tuple[int, ...], ...] = ()
    choice_penalty: float = 0.0
    part: tuple[int, ...] = ()
    min_lead: float = 0.0
    usual: float = math.inf
    min_lead_if_larger: float = 0.0

    def without_columns(self) -> ColumnGroup:
        """The group with empty columns: they take some megabytes, and can be computed again."""
        return replace(self, columns=np.empty((len(self.columns), 0, 0)))


@dataclass(frozen=True, slots=True)
class LinearModel:
    """target = residual + columns at the working point times its coordinates, all unwhitened (bins,
    channels).

    groups: columns of the inactive causes. cause_responses: difference that each active cause makes, (bins,
    channels).
    """

    point: Point
    residual: Array
    jacobian: Array
    groups: tuple[ColumnGroup, ...]
    cause_responses: dict[str, Array]

    @property
    def target(self) -> Array:
        """The residual at u = 0 according to the linear model, which all columns together must explain."""
        return np.asarray(self.residual + np.tensordot(self.point.vector(), self.jacobian, axes=1))

    def column(self, name: str) -> Array | None:
        """The column of a cause's first coordinate, active or not; None if it was not simulated."""
        span = self.point.spans().get(name)
        if span is not None:
            return np.asarray(self.jacobian[span.start], float)
        return next((each.columns[0] for each in self.groups if each.name == name), None)


def linearise(problem: Problem, point: Point, tried: Sequence[str], sizes: int | None = None) -> LinearModel:
    """Simulate the point, its neighbours, and each inactive cause in `tried` at its starting guesses, at most
    the first `sizes` of them."""
    points, steps = neighbouring_points(problem, point)
    guesses: list[tuple[str, int, tuple[float, ...]]] = []
    for name in tried:
        if name in point.active:
            continue
        cause = problem.causes[name]
        guesses.extend(
            (name, index, u) for index, variant in enumerate(cause.variants[:sizes]) for u in variant
        )
    points = [point, *points, *(point.with_cause(name, np.array(u)) for name, _, u in guesses)]
    without_each = [point.without_cause(name) for name in point.active]
    outputs = problem.predict([*points, *without_each])
    centre, without = outputs[0], outputs[len(points) :]
    count = len(steps)
    jacobian = (outputs[1 : count + 1] - centre) / steps[:, None, None]
    groups: dict[tuple[str, int], list[tuple[Array, tuple[float, ...]]]] = {}
    for (name, index, u), output in zip(guesses, outputs[count + 1 : len(points)], strict=True):
        scale = sum(u) if _has_linear_coordinates(problem, name) else u[0]
        groups.setdefault((name, index), []).append(((output - centre) / scale, u))
    return LinearModel(
        point,
        problem.features.measured - centre,
        jacobian,
        tuple(_group(problem, name, found) for (name, _), found in groups.items()),
        {name: centre - each for name, each in zip(point.active, without, strict=True)},
    )


def _has_linear_coordinates(problem: Problem, name: str) -> bool:
    """Whether a cause's coordinates are all linear: each has its own column, from a guess along it."""
    cause = problem.causes[name]
    return len(cause.variants[0]) > 1


def _group(problem: Problem, name: str, found: list[tuple[Array, tuple[float, ...]]]) -> ColumnGroup:
    columns = np.stack([column for column, _ in found])
    one_sided = problem.causes[name].one_sided
    return ColumnGroup(name, columns, found[0][1] if len(found) == 1 else (), one_sided)


def wheel_speed(problem: Problem, columns: Array, side: str) -> Array | None:
    """Speed of a wheel in rad/s, (..., bins), from readings or columns (..., bins, channels); None if the
    wheel has no reading."""
    roles = problem.features.roles
    if f"speed_{side}" in roles:
        return np.asarray(columns[..., roles.index(f"speed_{side}")], float)
    if f"bemf_{side}" not in roles:
        return None
    constant = getattr(problem.robot.model, side).back_emf_constant.value
    return np.asarray(columns[..., roles.index(f"bemf_{side}")] * BEMF_VOLTS_PER_COUNT / constant, float)


def coulomb_response(problem: Problem, linear: LinearModel, side: str) -> Array | None:
    """Response to 1 N m of Coulomb friction at a wheel; None if it was not simulated."""
    name = f"friction.coulomb@{side}"
    column = linear.column(name)
    if column is None:
        return None
    key = ("friction.coulomb", side, "torque")
    u, step = linear.point.active.get(name), FRICTION_STEP_WIDTHS
    if u is None:  # the column is a secant
        u, step = np.zeros(1), next(each.start[0] for each in linear.groups if each.name == name)
    moved = problem.settings(linear.point.with_cause(name, u + step))
    torque = moved[key] - problem.settings(linear.point)[key]
    return column * (step / torque)


@dataclass(frozen=True, slots=True)
class GramTable:
    """Inner products of the whitened columns, and the owner of each column.

    base_count: number of base coordinates, which come first. active: column indices of each active cause.
    inactive: groups that may be added, with their column indices; those of probes have no column data.
    """

    gram: Gram
    base_count: int
    active: dict[str, list[int]]
    inactive: tuple[tuple[ColumnGroup, list[int]], ...]

    def with_parts(self) -> GramTable:
        """The table with each part of a group as a further group."""
        inactive = list(self.inactive)
        for group, span in self.inactive:
            penalty = math.log(len(group.parts)) if group.parts else 0.0
            for part in group.parts:
                columns = group.columns[list(part)]
                single = replace(group, columns=columns, parts=(), choice_penalty=penalty, part=part)
                inactive.append((single, [span[index] for index in part]))
        return replace(self, inactive=tuple(inactive))


def gram_tables(
    linear: LinearModel, extra: Sequence[ColumnGroup], whitener: Whitener
) -> tuple[GramTable, GramTable]:
    """Whiten all columns once and keep their inner products: under the whole noise, and under the noise model
    alone, without slowly varying friction."""
    every = [*linear.groups, *extra]
    columns = np.concatenate([linear.jacobian, *(each.columns for each in every), linear.target[None]])
    groups = (*linear.groups, *(each.without_columns() for each in extra))
    plain = whitener.noise_only()(columns)
    del columns
    products = plain @ plain.T
    whole = products - whitener.gram_reduction(plain)
    return _table(linear, groups, whole), _table(linear, groups, products)


def _table(linear: LinearModel, groups: Sequence[ColumnGroup], gram: Array) -> GramTable:
    """gram: inner products of all columns, with the target last."""
    whole = Gram(gram[:-1, :-1], gram[:-1, -1])
    active = {name: list(span) for name, span in linear.point.spans().items()}
    inactive, position = [], len(linear.jacobian)
    for group in groups:
        size = len(group.columns)
        inactive.append((group, list(range(position, position + size))))
        position += size
    return GramTable(whole, len(linear.point.base), active, tuple(inactive))
