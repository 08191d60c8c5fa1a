"""What an unknown cause does: the curves of the probes that were accepted, with their size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import Gram
from raccoon.diagnose.result import Shape
from raccoon.diagnose.select.outlook import Search
from raccoon.diagnose.unknown import INERTIA_SHARE, PREFIX, Probe
from raccoon.diagnose.whitening import whitener_for

Array = NDArray[np.float64]

POINTS = 48


def shapes_of(search: Search) -> tuple[Shape, ...]:
    """The curves over what they depend on, fitted together with all that the search left free.

    They are no noise here, as they were while causes were sought beside them.
    """
    if not search.unknown:
        return ()
    linear, fit = search.linear, search.fit
    every = search.probes(linear)
    probes = [each for each in every if isinstance(each, Probe) and each.name in search.unknown]
    whitener = whitener_for(search.problem, linear, every, search.whitener, tolerant=False)
    own = linear.own[fit.free]
    target = linear.residual + np.tensordot(fit.point.vector()[fit.free], own, axes=1)
    white = whitener(np.concatenate([own, *(each.columns for each in probes), target[None]]))
    mean, _, covariance = Gram.of(white[:-1].T, white[-1]).solve()
    found, place = [], len(own)
    for each in probes:
        rows = slice(place, place + len(each.curves))
        found.append(_shape(each, mean[rows], covariance[rows, rows]))
        place += len(each.curves)
    return tuple(found)


def _shape(probe: Probe, mean: Array, covariance: Array) -> Shape:
    values = mean @ probe.curves
    variances = np.einsum("ib,ij,jb->b", probe.curves, covariance, probe.curves)
    stds = np.sqrt(np.maximum(variances, 0.0))
    if probe.quantity == INERTIA_SHARE:
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
