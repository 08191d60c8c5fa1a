"""What an unknown cause does: the curves of the probes that were accepted, with their size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.noise_estimation import whitener_for
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.result import Shape
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.unknown.probes import INERTIA, INERTIA_SHARE
from raccoon.diagnose.unknown.sensors import PREFIX, Probe

Array = NDArray[np.float64]

POINTS = 48
"""Of a curve as it is said."""
FREED = 10.0
"""Times their usual size that waves may well have whose size is asked for."""
MOST_LARGER = 2.0
"""By how much a wave may be larger than what of it stays the same on the way: beyond, it is chance."""


def shapes_of(search: Search) -> tuple[Shape, ...]:
    """The curves over what they depend on, fitted together with all that the search left free.

    They are no noise here, as they were while causes were sought beside them.
    """
    if not search.unknown:
        return ()
    every = search.probes(search.linear)
    whitener = whitener_for(search.problem, search.linear, every, search.whitener, tolerant=False)
    probes = [each for each in every if isinstance(each, Probe) and each.name in search.unknown]
    found = _fitted(search, probes, whitener)
    if any(_grows(each.probe) for each in found):
        refined = [_over_its_range(search, each) if _grows(each.probe) else each.probe for each in found]
        found = _fitted(search, refined, whitener)
    return tuple(_shape(each) for each in found)


def _grows(probe: Probe) -> bool:
    """Whether the curve is the logarithm of a factor on inertia."""
    return probe.quantity == INERTIA_SHARE


@dataclass(frozen=True, slots=True)
class _Fitted:
    """A probe, and its coordinates with their covariance."""

    probe: Probe
    mean: Array
    covariance: Array


def _fitted(search: Search, probes: Sequence[Probe], whitener: Whitener) -> list[_Fitted]:
    """The probes beside all that the search left free, by the linear model."""
    linear, fit = search.linear, search.fit
    own = linear.own[fit.free]
    probes = [_freed(each) if each.parts else each for each in probes]
    target = linear.residual + np.tensordot(fit.point.vector()[fit.free], own, axes=1)
    white = whitener(np.concatenate([own, *(each.columns for each in probes), target[None]]))
    mean, _, covariance = Gram.of(white[:-1].T, white[-1]).solve()
    found, place = [], len(own)
    for each in probes:
        rows = slice(place, place + len(each.curves))
        found.append(_Fitted(each, mean[rows], covariance[rows, rows]))
        place += len(each.curves)
    return found


def _freed(probe: Probe) -> Probe:
    """A probe of waves with next to nothing that keeps them small, now that they are known to be there."""
    return replace(probe, columns=FREED * probe.columns, curves=FREED * probe.curves)


def _over_its_range(search: Search, fitted: _Fitted) -> Probe:
    """A probe of inertia with the response between the least and the largest inertia that there was.

    A robot half as heavy again does not answer by a straight line: by the response to a little inertia, loads
    came out up to a tenth too small.
    """
    probe, problem, point = fitted.probe, search.problem, search.fit.point
    (coordinate,) = problem.causes[INERTIA].coordinates
    steps = probe.curves / math.log(coordinate.value(1.0))
    course = fitted.mean @ steps
    ends = point.active.get(INERTIA, np.zeros(1)) + np.array([[course.min()], [course.max()]])
    least, largest = problem.predict([point.with_cause(INERTIA, end) for end in ends])
    response = (largest - least) / max(float(np.ptp(course)), 1e-9)
    return replace(probe, columns=steps[:, :, None] * response[None])


def _as_large_all_the_way(fitted: _Fitted) -> _Fitted:
    """Waves as they are, instead of with what changes on the way, and so much larger that both are as strong.

    What changes is mostly where in the turn the angle is counted from: the mean of waves that shift by a
    radian either way is a sixth too small.
    """
    probe, mean, covariance = fitted.probe, fitted.mean, fitted.covariance
    half = len(mean) // 2
    strength = np.hypot(*mean[:half].reshape(2, -1))
    power = (mean[half:] ** 2 - np.diag(covariance)[half:]).reshape(2, -1).sum(axis=0)
    shares = (probe.curves[half:] ** 2).sum(axis=1) / (probe.curves[:half] ** 2).sum(axis=1)
    changes = np.maximum(power, 0.0) * shares[: half // 2]
    larger = np.tile(np.sqrt(1.0 + changes / np.maximum(strength**2, 1e-12)), 2)
    larger = np.minimum(larger, MOST_LARGER)
    covariance = covariance[:half, :half] * np.outer(larger, larger)
    return _Fitted(replace(probe, curves=probe.curves[:half]), mean[:half] * larger, covariance)


def _shape(fitted: _Fitted) -> Shape:
    if fitted.probe.parts:
        fitted = _as_large_all_the_way(fitted)
    probe, mean, covariance = fitted.probe, fitted.mean, fitted.covariance
    curves = probe.curves
    if _grows(probe):
        # Robot.toml alone tells the level from the robot's own inertia, and badly. The course is known.
        curves = curves - curves[:, :1]
    values = mean @ curves
    variances = np.einsum("ib,ij,jb->b", curves, covariance, curves)
    stds = np.sqrt(np.maximum(variances, 0.0))
    if _grows(probe):
        values, stds = 100.0 * np.expm1(values), 100.0 * np.exp(values) * stds
    edges = np.linspace(probe.over.min(), probe.over.max(), POINTS + 1)
    place = np.clip(np.searchsorted(edges, probe.over, side="right") - 1, 0, POINTS - 1)
    count = np.bincount(place, minlength=POINTS)
    seen = count > 0
    over, values, stds = (
        np.bincount(place, each, POINTS)[seen] / count[seen] for each in (probe.over, values, stds)
    )
    name = probe.name.removeprefix(PREFIX)
    return Shape(name, probe.quantity, probe.unit, over, probe.over_unit, values, stds)
