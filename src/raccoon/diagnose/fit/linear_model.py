"""The model around a working point: one column for each direction in which it may differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.problem import Point, Problem, neighbours
from raccoon.diagnose.fit.whitener import Whitener

Array = NDArray[np.float64]

A_LITTLE = 0.1
"""Widths of Coulomb friction over which its torque is as good as straight."""


@dataclass(frozen=True, slots=True)
class Group:
    """Columns that come and go together. start: coordinates at which they were taken (secants of a cause).
    over_place: whether they are friction that depends on where the robot is. parts: those of the columns
    that may be all there is, one set of them alone. paid: log evidence that a part pays for the choice.
    part: those that it has, of such a part. least: log evidence up to which something usual imitates it,
    as long as its coordinates together are no larger than `usual`, and larger: where they are."""

    name: str
    columns: Array
    start: tuple[float, ...] = ()
    one_sided: bool = False
    over_place: bool = False
    parts: tuple[tuple[int, ...], ...] = ()
    paid: float = 0.0
    part: tuple[int, ...] = ()
    least: float = 0.0
    usual: float = math.inf
    larger: float = 0.0

    def bare(self) -> Group:
        """The same without what its columns are: some megabytes, which can be made again."""
        nothing = np.empty((len(self.columns), 0, 0))
        its = self.start, self.one_sided, self.over_place, self.parts, self.paid, self.part
        return Group(self.name, nothing, *its, self.least, self.usual, self.larger)


@dataclass(frozen=True, slots=True)
class Linear:
    """target = residual + columns at the working point times its coordinates, all raw (bins, channels).

    acting: what each cause that is on changes.
    """

    point: Point
    residual: Array
    own: Array
    groups: tuple[Group, ...]
    acting: dict[str, Array]

    @property
    def target(self) -> Array:
        """What all columns together must explain, counted from u = 0."""
        return np.asarray(self.residual + np.tensordot(self.point.vector(), self.own, axes=1))

    def column(self, name: str) -> Array | None:
        """What a cause's first coordinate changes, whether it is on or off; None where it was not looked
        at."""
        span = self.point.spans().get(name)
        if span is not None:
            return np.asarray(self.own[span.start], float)
        return next((each.columns[0] for each in self.groups if each.name == name), None)


def linearise(problem: Problem, point: Point, tried: Sequence[str], sizes: int | None = None) -> Linear:
    """Simulate the point, its neighbours, and each cause in `tried` that is off at its starting guesses, of
    several sizes at so many of them."""
    points, steps = neighbours(problem, point)
    guesses: list[tuple[str, int, tuple[float, ...]]] = []
    for name in tried:
        if name in point.active:
            continue
        cause = problem.causes[name]
        guesses.extend(
            (name, index, u) for index, variant in enumerate(cause.variants[:sizes]) for u in variant
        )
    points = [point, *points, *(point.with_cause(name, np.array(u)) for name, _, u in guesses)]
    less = [point.without_cause(name) for name in point.active]
    outputs = problem.predict([*points, *less])
    centre, without = outputs[0], outputs[len(points) :]
    count = len(steps)
    own = (outputs[1 : count + 1] - centre) / steps[:, None, None]
    groups: dict[tuple[str, int], list[tuple[Array, tuple[float, ...]]]] = {}
    for (name, index, u), output in zip(guesses, outputs[count + 1 : len(points)], strict=True):
        scale = sum(u) if _are_linear(problem, name) else u[0]
        groups.setdefault((name, index), []).append(((output - centre) / scale, u))
    return Linear(
        point,
        problem.features.measured - centre,
        own,
        tuple(_group(problem, name, found) for (name, _), found in groups.items()),
        {name: centre - each for name, each in zip(point.active, without, strict=True)},
    )


def _are_linear(problem: Problem, name: str) -> bool:
    """Whether a cause's coordinates are all linear: each has a column of its own, of a point along it."""
    cause = problem.causes[name]
    return len(cause.variants[0]) > 1


def _group(problem: Problem, name: str, found: list[tuple[Array, tuple[float, ...]]]) -> Group:
    columns = np.stack([column for column, _ in found])
    one_sided = problem.causes[name].one_sided
    return Group(name, columns, found[0][1] if len(found) == 1 else (), one_sided)


def speed_of(problem: Problem, columns: Array, side: str) -> Array | None:
    """rad/s of a wheel, (..., bins), in readings or columns (..., bins, channels); None without a reading of
    it."""
    roles = problem.features.roles
    if f"speed_{side}" in roles:
        return np.asarray(columns[..., roles.index(f"speed_{side}")], float)
    if f"bemf_{side}" not in roles:
        return None
    constant = getattr(problem.robot.model, side).back_emf_constant.value
    return np.asarray(columns[..., roles.index(f"bemf_{side}")] * BEMF_VOLTS_PER_COUNT / constant, float)


def coulomb_response(problem: Problem, linear: Linear, side: str) -> Array | None:
    """Response to one N m of Coulomb friction at a wheel; None where that was not looked at."""
    name = f"friction.coulomb@{side}"
    column = linear.column(name)
    if column is None:
        return None
    key = ("friction.coulomb", side, "torque")
    there, step = linear.point.active.get(name), A_LITTLE
    if there is None:  # the column is a secant
        there, step = np.zeros(1), next(each.start[0] for each in linear.groups if each.name == name)
    moved = problem.settings(linear.point.with_cause(name, there + step))
    torque = moved[key] - problem.settings(linear.point)[key]
    return column * (step / torque)


@dataclass(frozen=True, slots=True)
class Table:
    """The whitened columns' Gram numbers, and which columns belong to what. base: how many base coordinates
    come first. off: what may come in, of which probes are bare."""

    whole: Gram
    base: int
    active: dict[str, list[int]]
    off: tuple[tuple[Group, list[int]], ...]

    def in_parts(self) -> Table:
        """The same with each part of a group beside the group."""
        off = list(self.off)
        for group, span in self.off:
            for part in group.parts:
                paid = math.log(len(group.parts))
                less = replace(group, columns=group.columns[list(part)], parts=(), paid=paid, part=part)
                off.append((less, [span[index] for index in part]))
        return replace(self, off=tuple(off))


def tabulate(linear: Linear, extra: Sequence[Group], whitener: Whitener) -> tuple[Table, Table]:
    """Whiten everything once and keep its inner products: under the whole noise, and without slow
    friction."""
    every = [*linear.groups, *extra]
    columns = np.concatenate([linear.own, *(each.columns for each in every), linear.target[None]])
    groups = (*linear.groups, *(each.bare() for each in extra))
    plain = whitener.without_slow()(columns)
    del columns
    products = plain @ plain.T
    whole = products - whitener.taken(plain)
    return _table(linear, groups, whole), _table(linear, groups, products)


def _table(linear: Linear, groups: Sequence[Group], gram: Array) -> Table:
    """gram: inner products of all columns, the target last."""
    whole = Gram(gram[:-1, :-1], gram[:-1, -1])
    active = {name: list(span) for name, span in linear.point.spans().items()}
    off, position = [], len(linear.own)
    for group in groups:
        size = len(group.columns)
        off.append((group, list(range(position, position + size))))
        position += size
    return Table(whole, len(linear.point.base), active, tuple(off))
