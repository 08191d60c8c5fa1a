"""The model around a working point: one column for each direction in which it may differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import Gram
from raccoon.diagnose.log import WHEELS
from raccoon.diagnose.noise import CHANGING, CREEPING, STANDING, STEADY, NoiseModel, fit_noise, white_noise
from raccoon.diagnose.problem import Point, Problem, Whitener, neighbours

Array = NDArray[np.float64]

ORDER = 6
BLOCKS = 8
STANDSTILL = 0.03
"""Of the largest reading of a wheel: below it the wheel is taken to stand."""
CREEP = 0.15
"""Part of the largest reading of a wheel: below it stick and slip rule."""
CHANGE = 0.03
"""Change of a wheel's reading in a bin, of its largest: above it the wheel speeds up or brakes."""
NEGLIGIBLE = 0.025
"""Part of an effect's width that no model is expected to get right: it counts as noise while the effect is
off."""
UNEVEN = {"friction.direction_dependent": 1.5}
"""No floor and no gear is as even as a model: factors on what is negligible."""
FLOOR_GRID = 0.8
FLOOR_SECONDS = 4.0
FLOOR_SHARES = (0.0, 0.02, 0.04, 0.07)


@dataclass(frozen=True, slots=True)
class Group:
    """Columns that come and go together. start: coordinates at which they were taken (secants of a cause)."""

    name: str
    columns: Array
    start: tuple[float, ...] = ()
    one_sided: bool = False


@dataclass(frozen=True, slots=True)
class Linear:
    """target = residual + columns at the working point times its coordinates, all raw (bins, channels)."""

    point: Point
    residual: Array
    own: Array
    groups: tuple[Group, ...]

    @property
    def target(self) -> Array:
        """What all columns together must explain, counted from u = 0."""
        return np.asarray(self.residual + np.tensordot(self.point.vector(), self.own, axes=1))


def linearise(problem: Problem, point: Point, tried: Sequence[str]) -> Linear:
    """Simulate the point, its neighbours, and each cause in `tried` that is off at its starting guesses."""
    points, steps = neighbours(problem, point)
    guesses: list[tuple[str, int, tuple[float, ...]]] = []
    for name in tried:
        if name in point.active:
            continue
        cause = problem.causes[name]
        guesses.extend((name, index, u) for index, variant in enumerate(cause.variants) for u in variant)
    points = [point, *points, *(point.with_cause(name, np.array(u)) for name, _, u in guesses)]
    outputs = problem.predict(points)
    centre = outputs[0]
    count = len(steps)
    own = (outputs[1 : count + 1] - centre) / steps[:, None, None]
    groups: dict[tuple[str, int], list[tuple[Array, tuple[float, ...]]]] = {}
    for (name, index, u), output in zip(guesses, outputs[count + 1 :], strict=True):
        scale = float(np.hypot(u[0], u[1])) if _is_pair(problem, name) else u[0]
        groups.setdefault((name, index), []).append(((output - centre) / scale, u))
    return Linear(
        point,
        problem.features.measured - centre,
        own,
        tuple(_group(problem, name, found) for (name, _), found in groups.items()),
    )


def _is_pair(problem: Problem, name: str) -> bool:
    """Whether a cause's coordinates are all linear (each has a column of its own)."""
    cause = problem.causes[name]
    return len(cause.variants[0]) > 1


def _group(problem: Problem, name: str, found: list[tuple[Array, tuple[float, ...]]]) -> Group:
    columns = np.stack([column for column, _ in found])
    one_sided = problem.causes[name].coordinates[0].low == 0.0
    return Group(name, columns, found[0][1] if len(found) == 1 else (), one_sided)


def slow_friction(problem: Problem, linear: Linear) -> Array:
    """Columns of friction that wanders with the floor, of either wheel, for a wander of all of Coulomb
    friction.

    The robot forgets a torque within 0.1 s, so friction that changes over seconds acts as its constant
    response times its course. The course is an Ornstein-Uhlenbeck process (4 s) on a grid of hats.
    """
    time = problem.features.time
    knots = np.arange(time[0], time[-1] + FLOOR_GRID, FLOOR_GRID)
    hats = np.maximum(0.0, 1.0 - np.abs(time[None, :] - knots[:, None]) / FLOOR_GRID)
    course = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots[None, :]) / FLOOR_SECONDS)).T @ hats
    torque = problem.neutral[("friction.coulomb", "left", "torque")]
    width = problem.causes["friction.coulomb@left"].coordinates[0].value(1.0)
    columns = []
    for name in ("friction.coulomb@left", "friction.coulomb@right"):
        response = _response(linear, name)
        if response is not None:
            columns.append(course[:, :, None] * response[None] * (torque / width))
    return np.concatenate(columns) if columns else np.zeros((0, *linear.residual.shape))


def _response(linear: Linear, name: str) -> Array | None:
    for each in linear.groups:
        if each.name == name:
            return np.asarray(each.columns[0], float)
    return None


def whitener_for(
    problem: Problem,
    linear: Linear,
    extra: Sequence[Group],
    before: Whitener | None,
    unknown: Sequence[str] = (),
    tolerant: bool = True,
) -> Whitener:
    """Noise of what nothing in the catalogue explains.

    tolerant: whether a little of every effect that is off is noise. A search needs it; a last fit does not:
    causes would be found too small by it, and base numbers that resemble an effect would hardly count.

    unknown: probes that were found to matter; from then on their curves are part of the noise, so that no
    known cause is blamed for what they do.

    The residual's autocorrelation also holds what a missing effect does; noise estimated from it would hide
    that effect. So all directions, probes among them, are projected out first.
    """
    slow = slow_friction(problem, linear)
    every = np.concatenate([linear.own, *(each.columns for each in (*linear.groups, *extra))])
    floors, regimes = problem.features.floors, regimes_of(problem)
    noise = (
        before.noise
        if before is not None
        else white_noise(np.maximum(linear.residual.std(axis=0), floors), regimes)
    )
    for _ in range(1 if before is not None else 2):
        rest, _ = _unexplained(noise, every, slow, linear.target)
        noise = fit_noise(rest, ORDER, floors, regimes)
    noise = _less_at_jumps(problem, linear, noise)
    rest, share = _unexplained(noise, every, slow, linear.target)
    tolerated = {each.name: _tolerated(each) for each in linear.groups}  # of variants one stands for all
    spread = sum(((each**2).sum(axis=0) for each in tolerated.values()), ((share * slow) ** 2).sum(axis=0))
    nothing = [_tolerated(each) for each in linear.groups] if tolerant else []
    nothing.extend(each.columns for each in extra if each.name in unknown)
    return Whitener(noise, *_slow_directions(noise, np.concatenate([share * slow, *nothing])), rest, spread)


def _tolerated(group: Group) -> Array:
    """What of a cause no model is expected to get right."""
    return NEGLIGIBLE * UNEVEN.get(group.name.partition("@")[0], 1.0) * group.columns


def _less_at_jumps(problem: Problem, linear: Linear, noise: NoiseModel) -> NoiseModel:
    """Bins in which readings jump count as little as the jump is uncertain: by a step of its coordinate."""
    steps = problem.steps(linear.point)
    coordinates = [each for name in linear.point.active for each in problem.causes[name].coordinates]
    jumps = [len(problem.base) + index for index, each in enumerate(coordinates) if each.jumps]
    if not jumps:
        return noise
    spread = noise.whiten(linear.own[jumps] * steps[jumps, None, None])
    size = (spread**2).mean(axis=2).sum(axis=0)
    return replace(noise, weights=noise.weights / np.sqrt(1.0 + size))


def regimes_of(problem: Problem) -> NDArray[np.intp]:
    """Whether each bin belongs to standing, steady driving or a change; without wheels all is steady."""
    features = problem.features
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    if not wheels:
        return np.full(len(features.time), STEADY)
    speed = features.measured[:, wheels]
    speed = speed / np.maximum(np.abs(speed).max(axis=0), 1e-9)
    moving = _widened((np.abs(speed) > STANDSTILL).any(axis=1), 2, 2)
    changing = _widened((np.abs(np.gradient(speed, axis=0)) > CHANGE).any(axis=1), 2, 3)
    creeping = _widened((np.abs(speed) < CREEP).any(axis=1), 1, 1)
    driving = np.where(changing, CHANGING, np.where(creeping, CREEPING, STEADY))
    return np.where(moving, driving, STANDING)


def _widened(flags: NDArray[np.bool_], before: int, after: int) -> NDArray[np.bool_]:
    wide = flags.copy()
    for shift in range(1, before + 1):
        wide[:-shift] |= flags[shift:]
    for shift in range(1, after + 1):
        wide[shift:] |= flags[:-shift]
    return wide


def _unexplained(noise: NoiseModel, every: Array, slow: Array, target: Array) -> tuple[Array, float]:
    """What a fit of all columns under their unit priors leaves, and the likeliest share of wandering
    friction."""
    columns = np.concatenate([every, slow])
    white = noise.whiten(columns).reshape(len(columns), -1)
    goal = noise.whiten(target).reshape(-1)
    gram = Gram.of(white.T, goal)
    best: tuple[float, float, Array] | None = None
    for share in FLOOR_SHARES if len(slow) else (0.0,):
        scale = np.concatenate([np.ones(len(every)), np.full(len(slow), share)])
        scaled = Gram(gram.matrix * np.outer(scale, scale), gram.projection * scale, gram.power)
        mean, evidence, _ = scaled.solve()
        if best is None or evidence > best[0]:
            best = (evidence, share, mean * scale)
    assert best is not None
    return target - np.tensordot(best[2], columns, axes=1), best[1]


def _slow_directions(noise: NoiseModel, slow: Array) -> tuple[Array, Array]:
    if len(slow) == 0:
        return np.zeros((0, 0)), np.zeros(0)
    rows = noise.whiten(slow).reshape(len(slow), -1).T
    powers, right = np.linalg.eigh(rows.T @ rows)
    strong = powers > 1e-6 * max(float(powers[-1]), 1e-12)
    left = rows @ (right[:, strong] / np.sqrt(powers[strong]))
    return left, 1.0 - 1.0 / np.sqrt(1.0 + powers[strong])


@dataclass(frozen=True, slots=True)
class Table:
    """The whitened columns' Gram numbers, whole and by blocks of time, and which columns belong to what."""

    blocks: tuple[Gram, ...]
    whole: Gram
    base: int
    active: dict[str, list[int]]
    off: tuple[tuple[Group, list[int]], ...]


def tabulate(linear: Linear, extra: Sequence[Group], whitener: Whitener, base: int) -> tuple[Table, Table]:
    """Whiten everything once and keep its inner products: under the whole noise, and without slow
    friction."""
    groups = (*linear.groups, *extra)
    every = np.concatenate([linear.own, *(each.columns for each in groups), linear.target[None]])
    plain = whitener.without_slow()(every)
    white = whitener.slowed(plain)
    return _table(linear, groups, white, base), _table(linear, groups, plain, base)


def _table(linear: Linear, groups: Sequence[Group], white: Array, base: int) -> Table:
    bins, channels = linear.residual.shape
    edges = np.linspace(0, bins, BLOCKS + 1).astype(int) * channels
    blocks = []
    for start, end in pairwise(edges):
        part = white[:, start:end]
        gram = part @ part.T
        blocks.append(Gram(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1])))
    whole = blocks[0]
    for each in blocks[1:]:
        whole = whole + each
    active, position = {}, base
    for name, values in linear.point.active.items():
        active[name] = list(range(position, position + len(values)))
        position += len(values)
    off = []
    for group in groups:
        size = len(group.columns)
        off.append((group, list(range(position, position + size))))
        position += size
    return Table(tuple(blocks), whole, base, active, tuple(off))
