"""A recording and a simulator as one estimation problem: points of the model, and the simulation there."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import StepChange
from raccoon.diagnose.hypotheses.coordinates import Cause, Coordinate, Setting, Settings
from raccoon.diagnose.rollout.dead_zone_evidence import ReadingEvidence
from raccoon.diagnose.rollout.plant_rollout import Rollout

Array = NDArray[np.float64]
SettingsKey = tuple[float, ...]

BASE_STEP_STDS = 0.005
"""Difference step of a base number's column, in standard deviations."""
CACHE_BYTES = 8e6
"""Size in bytes of each problem's cache of the latest simulations: some 120 robots of 40 s."""


@dataclass(frozen=True, slots=True)
class Point:
    """A point of the model: base coordinates, and the coordinates of every active cause by name."""

    base: Array
    active: Mapping[str, Array] = field(default_factory=dict)

    def vector(self) -> Array:
        """All coordinates: those of the base, then each cause's in its order."""
        return np.concatenate([self.base, *self.active.values()]) if self.active else self.base.copy()

    def moved(self, vector: Array) -> Point:
        """The same causes at other coordinates."""
        active = {name: vector[span.start : span.stop] for name, span in self.spans().items()}
        return Point(vector[: len(self.base)], active)

    def spans(self) -> dict[str, range]:
        """The indices of each active cause's coordinates in the vector."""
        position, found = len(self.base), {}
        for name, values in self.active.items():
            found[name] = range(position, position + len(values))
            position += len(values)
        return found

    def with_cause(self, name: str, u: Array) -> Point:
        """The point with this cause at coordinates u."""
        return Point(self.base, {**self.active, name: np.asarray(u, float)})

    def shrunk(self, base: float, causes: float = 1.0) -> Point:
        """The same causes, with the base coordinates and the causes' coordinates multiplied by these
        factors."""
        return Point(base * self.base, {name: causes * u for name, u in self.active.items()})

    def without_cause(self, name: str) -> Point:
        """The point without this cause."""
        return Point(self.base, {key: value for key, value in self.active.items() if key != name})


@dataclass(frozen=True, slots=True)
class BatteryCreep:
    """Slow variation of a battery's reading: its standard deviation in V, and its correlation time in s.

    The defaults are those of a usual battery, whose voltage creeps after its current: within ten seconds
    through some hundredths of an ohm.
    """

    volts: float = 0.003
    seconds: float = 10.0


@dataclass(frozen=True, slots=True)
class Problem:
    """Everything a fit needs: what was measured, how to simulate it, what may differ.

    reading_evidence: what the readings themselves show of causes, by name. creep: slow variation of the
    battery's reading. coast_share: share of the time in which a driven motor is unpowered to be measured.
    friction_may_change: whether friction may change at some moment, for example when the robot takes a load.
    change: a known change.
    """

    features: Features
    rollout: Rollout
    robot: RobotConfig
    neutral: Settings
    base: tuple[Coordinate, ...]
    causes: Mapping[str, Cause]
    reading_evidence: Mapping[str, ReadingEvidence] = field(default_factory=dict)
    creep: BatteryCreep = BatteryCreep()
    coast_share: float = 0.0
    friction_may_change: bool = False
    change: StepChange | None = None
    _latest: OrderedDict[SettingsKey, tuple[Array, float]] = field(
        default_factory=OrderedDict, init=False, repr=False, compare=False
    )

    def reading_evidence_at(self, point: Point) -> float:
        """Log evidence of a point's causes that the readings themselves contain, without any simulation."""
        present = (
            (self.reading_evidence[name], u[0])
            for name, u in point.active.items()
            if name in self.reading_evidence
        )
        return sum(shown.log_evidence for shown, u in present if u >= shown.least)

    def settings(self, point: Point) -> Settings:
        """The simulator's settings at a point."""
        settings = dict(self.neutral)
        for coordinate, u in zip(self.base, point.base.tolist(), strict=True):
            coordinate.apply(settings, u)
        ordered = sorted(point.active, key=lambda name: self.causes[name].joint is not None)
        for name in ordered:  # those that depend on what others have set come last
            self.causes[name].apply(settings, point.active[name].tolist())
        return settings

    def predict(self, points: Sequence[Point]) -> Array:
        """Simulated bins (points, bins, channels)."""
        outputs = np.empty((len(points), *self.features.measured.shape))
        for place, each in enumerate(self.predictions(points)):
            outputs[place] = each
        return outputs

    def predictions(self, points: Sequence[Point]) -> Iterator[Array]:
        """Simulated bins (bins, channels) of one point after the other, which must not be modified. They are
        computed as they are consumed, so that many points need not be in memory at once."""
        settings = [self.settings(each) for each in points]
        keys = [tuple(each.values()) for each in settings]
        wanted, latest = dict(zip(keys, settings, strict=True)), self._latest
        known = {key: latest[key] for key in wanted if key in latest}
        parts, step = self._simulate_missing([each for key, each in wanted.items() if key not in known])
        if len({each for _, each in known.values()} | ({step} if step else set())) > 1:
            known = {}  # simulations with different steps cannot be compared
            parts, step = self._simulate_missing(list(wanted.values()))
        for key in known:
            latest.move_to_end(key)
        remaining = Counter(keys)
        for key in keys:
            bins = known[key][0] if key in known else next(parts)
            remaining[key] -= 1
            if key not in known:
                self._cache(key, bins, step)
                if remaining[key]:
                    known[key] = bins, step
            yield bins

    def _simulate_missing(self, variants: Sequence[Settings]) -> tuple[Iterator[Array], float]:
        """Bins (bins, channels) of each variant, and the integration step in s, 0 if there are no
        variants."""
        if not variants:
            return iter(()), 0.0
        parts, step = self.rollout(variants)
        return chain.from_iterable(map(self.features.simulated, parts)), step

    def _cache(self, key: SettingsKey, bins: Array, step: float) -> None:
        """Cache a simulation, and drop the oldest beyond `CACHE_BYTES`."""
        self._latest[key] = bins.copy(), step  # a view would keep the whole chunk in memory
        self._latest.move_to_end(key)
        while len(self._latest) * bins.nbytes > CACHE_BYTES:
            self._latest.popitem(last=False)

    def nominal(self) -> Point:
        """The point at which everything is as in robot.toml."""
        return Point(np.zeros(len(self.base)))

    def base_indices_of(self, name: str) -> list[int]:
        """Indices of the base coordinates that change a setting that a cause changes."""
        moved = {key for each in self.causes[name].coordinates for key in each.settings}
        return [index for index, each in enumerate(self.base) if moved & set(each.settings)]

    def steps(self, point: Point) -> Array:
        """The difference step of each coordinate of the point's vector, for its column."""
        causes = [coordinate.step for name in point.active for coordinate in self.causes[name].coordinates]
        return np.array([BASE_STEP_STDS] * len(self.base) + causes)

    def limits(self, point: Point) -> tuple[Array, Array]:
        """Lower and upper bounds of the point's vector: those of the base coordinates, and for causes the
        range that the simulator and the readings allow."""
        causes = [self.causes[name] for name in point.active]
        low = [each.low for each in self.base]
        for cause in causes:
            first, *others = (self._lowest(cause, each) for each in cause.coordinates)
            shown = self.reading_evidence.get(cause.name)
            low += [first if shown is None else max(first, shown.low), *others]
        high = [each.high for each in self.base]
        high += [each.high for cause in causes for each in cause.coordinates]
        return np.array(low), np.array(high)

    def inside(self, point: Point) -> Point:
        """The nearest point within the limits."""
        return point.moved(np.clip(point.vector(), *self.limits(point)))

    def _lowest(self, cause: Cause, coordinate: Coordinate) -> float:
        """The lowest coordinate at which a cause's parameter stays within its bounds whatever its base
        coordinates are: no friction can drive a wheel."""
        plain = bool(coordinate.settings) and not coordinate.factor and cause.own is None
        if not plain or coordinate.low > -np.inf:
            return coordinate.low
        name = coordinate.settings[0][2]
        bounds = next(each.bounds for each in cause.effect.parameters if each.name == name)
        if not np.isfinite(bounds.low):
            return coordinate.low

        def smallest(key: Setting) -> float:
            lowest_base = sum(each.value(each.low) for each in self.base if key in each.settings)
            return self.neutral[key] + lowest_base

        lowest = min(map(smallest, coordinate.settings))  # of two wheels that which has less
        return min((bounds.low - lowest) / coordinate.value(1.0), 0.0)


def neighbouring_points(problem: Problem, point: Point, start: int = 0) -> tuple[list[Point], Array]:
    """The points one step away along each coordinate of index `start` and above, and the steps."""
    vector = point.vector()
    _, high = problem.limits(point)
    wanted = problem.steps(point)
    points, steps = [], []
    for index in range(start, len(vector)):
        step = float(wanted[index])
        if vector[index] + step > high[index]:
            step = -step
        changed = vector.copy()
        changed[index] += step
        points.append(point.moved(changed))
        steps.append(step)
    return points, np.array(steps)


def transfer_point(point: Point, here: Problem, there: Problem) -> Point:
    """A point of problem `here` as one of problem `there`, whose base coordinates and widths may differ: the
    same numbers, as far as the limits there allow."""
    known = {each.settings: (each, u) for each, u in zip(here.base, point.base, strict=True)}
    base = np.zeros(len(there.base))
    for index, each in enumerate(there.base):
        if each.settings in known:
            own, u = known[each.settings]
            base[index] = u * own.units_of(each)
    return there.inside(replace(point, base=base))


def transfer_columns(columns: Array, here: Problem, there: Problem) -> Array | None:
    """Columns (coordinates, ...) of problem `here` as those of problem `there`; None if `here` lacks one of
    its base coordinates. Columns after those of the base coordinates are kept unchanged."""
    known = {each.settings: index for index, each in enumerate(here.base)}
    rows = [known.get(each.settings, -1) for each in there.base]
    if -1 in rows:
        return None
    found = columns[[*rows, *range(len(here.base), len(columns))]]
    for index, (row, each) in enumerate(zip(rows, there.base, strict=True)):
        found[index] *= each.units_of(here.base[row])
    return np.asarray(found, float)
