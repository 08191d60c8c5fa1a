"""The shape of an unknown effect: the fitted curves of the accepted probes, with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.noise_estimation import estimate_whitener
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.result import Shape
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.unknown.probes import INERTIA, INERTIA_GROWTH, SPEED
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX, Probe

Array = NDArray[np.float64]

CURVE_POINTS = 48
"""Number of points of a reported curve."""
WAVE_PRIOR_FACTOR = 10.0
"""Factor on the prior standard deviation of waves once they are known to be present."""
MAX_WAVE_CORRECTION = 2.0
"""Upper bound of the factor by which a wave may be larger than its constant part; beyond, it is chance."""

FLOOR_SHARE_OVER_SPEED = 0.05
"""Share of robot.toml's Coulomb friction by which friction must vary over the speed to matter; a floor varies
a torque over a wheel's angle by as much. Of robots without such a fault it varied by 0.014 to 0.028: where
friction gives before it slides in another way than the simulated one's, and where a battery sags by more than
its reading, taken in a motor's pause, shows."""


def is_small_friction(shape: Shape, coulomb: float) -> bool:
    """Whether a curve is friction over the speed that varies too little to matter. coulomb: robot.toml's
    friction, N m."""
    return shape.depends_on == SPEED and shape.size.value < FLOOR_SHARE_OVER_SPEED * coulomb


def fit_shapes(search: Search) -> tuple[Shape, ...]:
    """Fit the accepted probes' curves together with everything that the search left free.

    They are not part of the noise here, as they were during the search for causes.
    """
    if not search.unknown:
        return ()
    all_probes = search.probes(search.linear)
    whitener = estimate_whitener(search.problem, search.linear, all_probes, search.whitener, tolerant=False)
    probes = [each for each in all_probes if isinstance(each, Probe) and each.name in search.unknown]
    fitted = _fit_probes(search, probes, whitener)
    if any(_is_inertia_growth(each.probe) for each in fitted):
        refined = [
            _with_response_over_range(search, each) if _is_inertia_growth(each.probe) else each.probe
            for each in fitted
        ]
        fitted = _fit_probes(search, refined, whitener)
    return tuple(_make_shape(each) for each in fitted)


def _is_inertia_growth(probe: Probe) -> bool:
    """Whether the curve is the logarithm of a factor on inertia."""
    return probe.quantity == INERTIA_GROWTH


@dataclass(frozen=True, slots=True)
class _FittedProbe:
    """A probe, its coordinates and their covariance."""

    probe: Probe
    mean: Array
    covariance: Array


def _fit_probes(search: Search, probes: Sequence[Probe], whitener: Whitener) -> list[_FittedProbe]:
    """Fit the probes together with everything that the search left free, in the linear model."""
    linear, fit = search.linear, search.fit
    own = linear.jacobian[fit.free]
    probes = [_with_wide_prior(each) if each.parts else each for each in probes]
    target = linear.residual + np.tensordot(fit.point.vector()[fit.free], own, axes=1)
    white = whitener(np.concatenate([own, *(each.columns for each in probes), target[None]]))
    mean, _, covariance = Gram.of(white[:-1].T, white[-1]).solve()
    found, place = [], len(own)
    for each in probes:
        rows = slice(place, place + len(each.curves))
        found.append(_FittedProbe(each, mean[rows], covariance[rows, rows]))
        place += len(each.curves)
    return found


def _with_wide_prior(probe: Probe) -> Probe:
    """A probe of waves with a wider prior, since they are now known to be present."""
    return replace(probe, columns=WAVE_PRIOR_FACTOR * probe.columns, curves=WAVE_PRIOR_FACTOR * probe.curves)


def _with_response_over_range(search: Search, fitted: _FittedProbe) -> Probe:
    """A probe of inertia with the mean response between the smallest and the largest inertia in the drive.

    The response of a robot that becomes half as heavy again is not linear: with the response to a small
    inertia, loads came out up to a tenth too small.
    """
    probe, problem, point = fitted.probe, search.problem, search.fit.point
    (coordinate,) = problem.causes[INERTIA].coordinates
    steps = probe.curves / math.log(coordinate.value(1.0))
    course = fitted.mean @ steps
    ends = point.active.get(INERTIA, np.zeros(1)) + np.array([[course.min()], [course.max()]])
    least, largest = problem.predict([point.with_cause(INERTIA, end) for end in ends])
    response = (largest - least) / max(float(np.ptp(course)), 1e-9)
    return replace(probe, columns=steps[:, :, None] * response[None])


def _with_constant_waves(fitted: _FittedProbe) -> _FittedProbe:
    """Constant waves, with the power of those that change along the way added to them.

    A change along the way mostly is an error of the angle: the mean of waves that shift by a radian either
    way is a sixth too small.
    """
    probe, mean, covariance = fitted.probe, fitted.mean, fitted.covariance
    half = len(mean) // 2
    strength = np.hypot(*mean[:half].reshape(2, -1))
    power = (mean[half:] ** 2 - np.diag(covariance)[half:]).reshape(2, -1).sum(axis=0)
    shares = (probe.curves[half:] ** 2).sum(axis=1) / (probe.curves[:half] ** 2).sum(axis=1)
    changes = np.maximum(power, 0.0) * shares[: half // 2]
    larger = np.tile(np.sqrt(1.0 + changes / np.maximum(strength**2, 1e-12)), 2)
    larger = np.minimum(larger, MAX_WAVE_CORRECTION)
    covariance = covariance[:half, :half] * np.outer(larger, larger)
    return _FittedProbe(replace(probe, curves=probe.curves[:half]), mean[:half] * larger, covariance)


def _make_shape(fitted: _FittedProbe) -> Shape:
    if fitted.probe.parts:
        fitted = _with_constant_waves(fitted)
    probe, mean, covariance = fitted.probe, fitted.mean, fitted.covariance
    curves = probe.curves
    if _is_inertia_growth(probe):
        # Only robot.toml, with its wide deviation, separates the level from the robot's own inertia. The
        # curve's change is known.
        curves = curves - curves[:, :1]
    values = mean @ curves
    variances = np.einsum("ib,ij,jb->b", curves, covariance, curves)
    stds = np.sqrt(np.maximum(variances, 0.0))
    if _is_inertia_growth(probe):
        values, stds = 100.0 * np.expm1(values), 100.0 * np.exp(values) * stds
    edges = np.linspace(probe.over.min(), probe.over.max(), CURVE_POINTS + 1)
    place = np.clip(np.searchsorted(edges, probe.over, side="right") - 1, 0, CURVE_POINTS - 1)
    count = np.bincount(place, minlength=CURVE_POINTS)
    seen = count > 0
    over, values, stds = (
        np.bincount(place, each, CURVE_POINTS)[seen] / count[seen] for each in (probe.over, values, stds)
    )
    name = probe.name.removeprefix(UNKNOWN_PREFIX)
    return Shape(name, probe.quantity, probe.unit, over, probe.over_unit, values, stds)
