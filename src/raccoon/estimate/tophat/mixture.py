"""Mixtures of normal densities in one dimension, and the single surface that they must beat."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VARIANCE_FLOOR = 1.0  # counts^2; a component with less than the converter's noise covers a single value
MAX_ITERATIONS = 40
MULTI_STARTS = 2  # number of starts for two components, the best cuts
TAIL_DEGREES = (2.5, 4.0, 8.0, 40.0)  # degrees of freedom tried for one surface: heavy tails to nearly none
MODE_QUANTILES = (0.03, 0.2, 0.35, 0.5, 0.65, 0.8, 0.97)  # quantiles tried as its mode
SEARCH_READINGS = 250  # readings for that search; the best one is then measured on all


@dataclass(frozen=True, slots=True)
class Component:
    """One normal density of a mixture: weight 0..1, mean and sd in counts."""

    weight: float
    mean: float
    sd: float


@dataclass(frozen=True, slots=True)
class Mixture:
    """Components, bright first, and the Bayesian information criterion (lower is better)."""

    components: tuple[Component, ...]
    bic: float


def best_mixture(ordered: Array) -> Mixture:
    """The mixture of one to three components with the lowest BIC; `ordered` ascending, shape (n,)."""
    fits = [_fit_single(ordered)]
    starts = sorted(_first_cuts(ordered), key=lambda cut: _misfit(ordered, [cut]))[:MULTI_STARTS]
    pairs = [_fit_mixture(ordered, [cut], alike) for cut in starts for alike in (True, False)]
    if pairs:
        base = min(pairs, key=lambda each: each.bic)
        thirds = sorted(_second_cuts(ordered, base), key=lambda cuts: _misfit(ordered, cuts))[:1]
        fits += pairs + [_fit_mixture(ordered, cuts) for cuts in thirds]
    return min(fits, key=lambda each: each.bic)


def single_surface_bic(ordered: Array) -> float:
    """BIC of one surface of any usual shape: skewed, heavy-tailed, both or neither.

    The family is the two-piece Student t, with a mode, one scale on each side of it, and degrees of freedom;
    density 2 / (s_left + s_right) t((x - mode) / s_side). Scales by expectation maximisation, mode and
    degrees of freedom on a grid. Four parameters.
    """
    few = ordered[:: -(-len(ordered) // SEARCH_READINGS)]
    shapes = [(float(mode), tail) for mode in np.quantile(ordered, MODE_QUANTILES) for tail in TAIL_DEGREES]
    best = sorted(shapes, key=lambda shape: -_two_piece_log_likelihood(few, *shape))[:3]
    likelihood = max(_two_piece_log_likelihood(ordered, *shape) for shape in best)
    return -2.0 * likelihood + 4.0 * math.log(len(ordered))


def _two_piece_log_likelihood(x: Array, mode: float, tail: float) -> float:
    away = x - mode
    left = away < 0.0
    squares = away * away
    scales = np.full(2, math.sqrt(float(squares.mean()) + VARIANCE_FLOOR))
    for _ in range(6):
        weighted = squares * (tail + 1.0) / (tail + squares / np.where(left, *(scales * scales)))
        on_left = float(weighted[left].sum())
        # dL/ds = 0 of a two-piece density: s_side^3 is proportional to the weighted squares on that side.
        roots = np.cbrt(np.array([on_left, float(weighted.sum()) - on_left]) / len(x) + 1e-9)
        scales = np.maximum(roots * math.sqrt(roots.sum()), 0.3 * math.sqrt(VARIANCE_FLOOR))
    constant = math.lgamma(0.5 * (tail + 1.0)) - math.lgamma(0.5 * tail) - 0.5 * math.log(tail * math.pi)
    constant += math.log(2.0 / float(scales.sum()))
    bends = np.log1p(squares / (tail * np.where(left, *(scales * scales))))
    return len(x) * constant - 0.5 * (tail + 1.0) * float(bends.sum())


def _first_cuts(ordered: Array) -> list[float]:
    """Starting cuts for a mixture of two: the best 2-means cut, the middle of the range, the widest gap.

    Each finds what the others miss: 2-means an even share, the middle a rare far surface, the gap a rare near
    one. (Each end keeps at least two readings: a single one is not a surface.)
    """
    cuts = {_two_means_cut(ordered), 0.5 * (float(ordered[1]) + float(ordered[-2]))}
    widest = int(np.argmax(np.diff(ordered[1:-1])))
    cuts.add(0.5 * float(ordered[widest + 1] + ordered[widest + 2]))
    return [cut for cut in sorted(cuts) if ordered[1] < cut < ordered[-2]]


def _second_cuts(ordered: Array, pair: Mixture) -> list[list[float]]:
    """Starting cuts for three components: each side of the pair's cut, cut again."""
    bright, dark = pair.components
    cut = (bright.mean * dark.sd + dark.mean * bright.sd) / (bright.sd + dark.sd)
    halves = (ordered[ordered <= cut], ordered[ordered > cut])
    return [sorted([cut, _two_means_cut(half)]) for half in halves if len(half) >= 8 and half[0] < half[-1]]


def _two_means_cut(ordered: Array) -> float:
    """The exact 2-means cut of sorted numbers: the split with the largest variance between the sides."""
    total = ordered.sum()
    left = np.cumsum(ordered)[:-1]
    count = np.arange(1, len(ordered))
    rest = len(ordered) - count
    between = left * left / count + (total - left) ** 2 / rest
    at = int(np.argmax(between))
    return 0.5 * float(ordered[at] + ordered[at + 1])


def _split_at(ordered: Array, cuts: list[float]) -> list[Array]:
    return [part for part in np.split(ordered, np.searchsorted(ordered, cuts)) if len(part)]


def _misfit(ordered: Array, cuts: list[float]) -> float:
    """Misfit of one normal density for each part: the negative classification likelihood, without
    constants."""
    parts = _split_at(ordered, cuts)
    return sum(
        len(part) * (0.5 * math.log(float(part.var()) + VARIANCE_FLOOR) - math.log(len(part)))
        for part in parts
    )


def _fit_single(ordered: Array) -> Mixture:
    n = len(ordered)
    variance = float(ordered.var()) + VARIANCE_FLOOR
    squares = float(((ordered - ordered.mean()) ** 2).sum())
    likelihood = -0.5 * (n * math.log(2.0 * math.pi * variance) + squares / variance)
    whole = Component(1.0, float(ordered.mean()), math.sqrt(variance))
    return Mixture((whole,), -2.0 * likelihood + 2.0 * math.log(n))


def load_scikit_learn() -> None:
    """Import what the mixtures need; this takes a second on a laptop and ten on a Raspberry Pi 3."""
    import sklearn.mixture  # noqa: F401


def _fit_mixture(ordered: Array, cuts: list[float], alike: bool = False) -> Mixture:
    """Expectation maximisation (scikit-learn) from the moments of the parts between `cuts`.

    alike: all components have the same variance, which a few readings of a rare surface cannot determine
    alone.
    """
    from sklearn import config_context
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture

    parts = _split_at(ordered, cuts)
    precisions = np.array([[1.0 / (part.var() + VARIANCE_FLOOR)] for part in parts])
    model = GaussianMixture(
        len(parts),
        covariance_type="tied" if alike else "diag",
        reg_covar=VARIANCE_FLOOR,
        tol=1e-4,
        max_iter=MAX_ITERATIONS,
        random_state=0,
        weights_init=np.array([len(part) / len(ordered) for part in parts]),
        means_init=np.array([[part.mean()] for part in parts]),
        precisions_init=precisions[:1] if alike else precisions,
    )
    column = ordered[:, np.newaxis]
    with warnings.catch_warnings(), config_context(assume_finite=True, skip_parameter_validation=True):
        warnings.simplefilter("ignore", ConvergenceWarning)  # an unconverged fit is still a candidate
        model.fit(column)
        bic = float(model.bic(column))
    order = np.argsort(model.means_.ravel())
    found = zip(
        model.weights_[order].tolist(),
        model.means_.ravel()[order].tolist(),
        np.sqrt(np.broadcast_to(model.covariances_.ravel(), len(parts))[order]).tolist(),
        strict=True,
    )
    return Mixture(tuple(Component(*each) for each in found), bic)
