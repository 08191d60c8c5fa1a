from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from raccoon.diagnose.fit.evidence import Gram, held_out_residual, minimise_in_bounds
from raccoon.diagnose.fit.noise_model import (
    CHANGING,
    EVENT_BINS,
    OUTLIER_EVENT_SIZE,
    STEADY,
    fit_noise_model,
    whiteness_p_values,
)


def random_gram(seed: int, columns: int = 4, rows: int = 50) -> tuple[np.ndarray, np.ndarray, Gram]:
    rng = np.random.default_rng(seed)
    x, y = rng.standard_normal((rows, columns)), rng.standard_normal(rows)
    return x, y, Gram.of(x, y)


def test_log_evidence_is_that_of_the_gaussian_it_stands_for() -> None:
    x, y, gram = random_gram(1)
    covariance = np.eye(len(y)) + x @ x.T
    _, logdet = np.linalg.slogdet(covariance)
    direct = -0.5 * y @ np.linalg.solve(covariance, y) - 0.5 * logdet + 0.5 * y @ y
    assert gram.solve()[1] == pytest.approx(direct)
    assert gram.evidence() == pytest.approx(direct)


def test_eliminating_columns_changes_no_estimate() -> None:
    _, _, gram = random_gram(2)
    whole = gram.solve()[0]
    assert gram.eliminate_leading(2).solve()[0] == pytest.approx(whole[2:])


def test_evidence_of_a_set_is_that_of_its_parts_in_turn() -> None:
    _, _, gram = random_gram(3)
    first = gram.take([0, 1]).solve()[1]
    assert first + gram.eliminate_leading(2).solve()[1] == pytest.approx(gram.solve()[1])


def test_shifting_is_subtracting_a_prediction() -> None:
    x, y, gram = random_gram(4)
    held = np.array([0.3, 0.0, -1.0, 0.0])
    shifted, direct = gram.shifted(held), Gram.of(x, y - x @ held)
    assert shifted.projection == pytest.approx(direct.projection)
    assert shifted.matrix == pytest.approx(direct.matrix)


def test_each_block_is_foreseen_by_a_fit_of_all_others() -> None:
    rng = np.random.default_rng(5)
    x = rng.standard_normal((2, 400))
    y = 0.8 * x[0] + rng.standard_normal(400)
    left = held_out_residual(x, y, 8)
    for start in range(0, 400, 50):
        inside = np.zeros(400, bool)
        inside[start : start + 50] = True
        others = x[:, ~inside]
        mean = np.linalg.solve(np.eye(2) + others @ others.T, others @ y[~inside])
        assert left[inside] == pytest.approx(y[inside] - mean @ x[:, inside])
    nothing, right, both = (-0.5 * (held_out_residual(x[:count], y, 8) ** 2).sum() for count in (0, 1, 2))
    assert right > nothing + 20.0
    assert both < right + 1.0


def coloured(seed: int, n: int = 4000) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shocks = rng.multivariate_normal([0.0, 0.0], [[1.0, 0.7], [0.7, 2.0]], n)
    noise = np.zeros((n, 2))
    for row in range(1, n):
        noise[row] = np.array([[0.8, 0.1], [0.0, 0.6]]) @ noise[row - 1] + shocks[row]
    return noise


def test_whitened_noise_is_white_independent_and_of_unit_size() -> None:
    noise = coloured(6)
    regimes = np.full(len(noise), STEADY)
    model = fit_noise_model(noise, 3, np.full(2, 1e-3), regimes, EVENT_BINS)
    white = model.whiten(noise)[5:]
    assert np.cov(white.T) == pytest.approx(np.eye(2), abs=0.06)
    assert whiteness_p_values(white).min() > 0.001
    assert whiteness_p_values(noise).max() < 1e-6


def test_a_bin_far_outside_counts_less() -> None:
    noise = coloured(7)
    noise[2000] += 60.0
    model = fit_noise_model(noise, 3, np.full(2, 1e-3), np.full(len(noise), STEADY), EVENT_BINS)
    assert model.weights[2000] < 0.2
    assert np.median(model.weights) == 1.0


def test_whitening_is_an_innovation_unmixed_by_its_regime() -> None:
    regimes = np.repeat([0, 1, 2, 3], 500)
    model = fit_noise_model(coloured(3, 2000), 3, np.full(2, 1e-6), regimes, EVENT_BINS)
    signals = np.random.default_rng(4).normal(size=(5, 2000, 2))
    expected = np.zeros_like(signals)
    for t in range(model.order, 2000):
        past = sum(signals[:, t - k - 1] @ each.T for k, each in enumerate(model.coefficients))
        expected[:, t] = model.weights[t] * (signals[:, t] - past) @ model.whitening_factors[regimes[t]].T
    np.testing.assert_allclose(model.whiten(signals), expected, atol=1e-12)
    np.testing.assert_allclose(model.whiten(signals[0]), expected[0], atol=1e-12)


def test_noise_is_the_same_in_other_units() -> None:
    units, regimes, floor = np.array([1.0, 300.0]), np.repeat([0, 1, 2, 3], 500), np.full(2, 1e-3)
    plain = fit_noise_model(coloured(4, 2000), 3, floor, regimes, EVENT_BINS)
    scaled = fit_noise_model(units * coloured(4, 2000), 3, units * floor, regimes, EVENT_BINS)
    signals = np.random.default_rng(5).normal(size=(2000, 2))
    np.testing.assert_allclose(scaled.whiten(units * signals), plain.whiten(signals), rtol=1e-6, atol=1e-6)


def test_a_channel_in_which_nothing_is_left_has_a_tenth_of_its_floor() -> None:
    residual = np.random.default_rng(6).normal(size=(2000, 2)) * [1.0, 0.0]
    model = fit_noise_model(residual, 1, np.full(2, 0.02), np.full(2000, STEADY), EVENT_BINS)
    assert model.whitening_factors[STEADY][1, 1] == pytest.approx(1.0 / (0.1 * 0.02))
    assert model.whitening_factors[STEADY][0, 0] == pytest.approx(1.0, rel=0.05)


def test_a_regime_of_few_bins_has_the_noise_of_all_by_their_freedom() -> None:
    """Innovations of so many bins, less the numbers that their memory was fitted with: 3 lags of 2 channels.
    It is one of enough bins that has a covariance of its own."""
    noise, few = coloured(8, 200), 15 * 2
    regimes = np.full(200, STEADY)
    regimes[60 : 60 + few] = CHANGING
    model = fit_noise_model(noise, 3, np.full(2, 1e-9), regimes, EVENT_BINS)
    past = [noise[3 - lag : 200 - lag] @ model.coefficients[lag - 1].T for lag in (1, 2, 3)]
    shocks = noise[3:] - sum(past)
    for regime, own, freedom in (
        (CHANGING, shocks, 197 - 6),
        (STEADY, shocks[regimes[3:] == STEADY], 197 - few),
    ):
        whole = np.linalg.inv(model.whitening_factors[regime].T @ model.whitening_factors[regime])
        assert whole == pytest.approx(own.T @ own / freedom, rel=1e-6)
    regimes[60 + few] = CHANGING
    more = fit_noise_model(noise, 3, np.full(2, 1e-9), regimes, EVENT_BINS)
    assert np.abs(more.whitening_factors[CHANGING] - model.whitening_factors[CHANGING]).max() > 0.01


def test_half_a_second_that_is_larger_than_usual_counts_as_a_usual_one() -> None:
    """1.8 times the noise, where no bin by itself is far outside: then 1.2 times."""
    noise = np.random.default_rng(7).choice([-1.0, 1.0], size=(100 * EVENT_BINS, 1))
    noise[50 * EVENT_BINS : 51 * EVENT_BINS] *= 1.8
    model = fit_noise_model(noise, 0, np.full(1, 1e-6), np.full(len(noise), STEADY), EVENT_BINS)
    level = np.sqrt((noise**2).mean())
    assert model.weights[50 * EVENT_BINS : 51 * EVENT_BINS] == pytest.approx(
        OUTLIER_EVENT_SIZE / (1.8 / level)
    )
    assert (np.delete(model.weights, np.s_[50 * EVENT_BINS : 51 * EVENT_BINS]) == 1.0).all()


def test_whiteness_is_the_chance_of_such_correlations_by_ljung_and_box() -> None:
    rng, lags, count = np.random.default_rng(8), 10, 60
    white = rng.normal(size=(count, 1))
    centred = (white - white.mean())[:, 0]
    each = [
        (centred[lag:] @ centred[:-lag] / (centred @ centred)) ** 2 / (count - lag) for lag in range(1, 11)
    ]
    assert whiteness_p_values(white)[0] == pytest.approx(chi2.sf(count * (count + 2) * sum(each), lags))
    assert whiteness_p_values(np.ones((count, 1)))[0] == 1.0  # nothing is left


@pytest.mark.parametrize("seed", range(12))
def test_bounds_are_kept_where_columns_are_nearly_the_same(seed: int) -> None:
    """Letting go and holding went round in circles there: a group that adds 1915 to the log evidence was said
    to lose 1234."""
    rng = np.random.default_rng(seed)
    few, mixed = rng.normal(size=(36, 4)), rng.normal(size=(4, 12))
    columns = np.vstack([30.0 * few @ mixed + 0.5 * rng.normal(size=(36, 12)), np.eye(12)])
    target = columns @ rng.normal(scale=0.3, size=12)
    low, high = -rng.uniform(0.01, 0.3, 12), rng.uniform(0.01, 0.3, 12)
    found = minimise_in_bounds(columns.T @ columns, columns.T @ target, low, high)
    assert ((found >= low) & (found <= high)).all()
    least = lsq_linear(columns, target, (low, high), tol=1e-12)
    assert 0.5 * ((target - columns @ found) ** 2).sum() == pytest.approx(least.cost, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_where_bounds_are_likely_to_hold_changes_nothing_but_the_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns, target = rng.normal(size=(40, 7)), rng.normal(size=40)
    matrix, projection = columns.T @ columns, columns.T @ target
    low, high = -rng.uniform(0.0, 0.2, 7), rng.uniform(0.0, 0.2, 7)
    found = minimise_in_bounds(matrix, projection, low, high)
    for near in (low, high, 0.5 * (low + high), rng.normal(size=7)):
        assert minimise_in_bounds(matrix, projection, low, high, near) == pytest.approx(found, abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_beside_bounds_a_span_adds_what_bounded_least_squares_and_determinants_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(30, 6)), rng.normal(size=30)
    low, high = np.array([-0.1, -0.05, -np.inf, 0.0]), np.array([0.1, 0.05, np.inf, 0.2])
    own = [0, 1, 2, 3]

    def best(chosen: list[int]) -> tuple[np.ndarray, float]:
        """Where it is best, and the log evidence there by Laplace's method."""
        far = np.full(len(chosen) - 4, np.inf)
        rows = np.vstack([x[:, chosen], np.eye(len(chosen))])
        goal = np.concatenate([y, np.zeros(len(chosen))])
        bounds = np.concatenate([low, -far]), np.concatenate([high, far])
        found = lsq_linear(rows, goal, bounds, method="bvls", tol=1e-14)
        _, logdet = np.linalg.slogdet(np.eye(len(chosen)) + x[:, chosen].T @ x[:, chosen])
        return found.x, -found.cost - 0.5 * logdet

    _, alone = best(own)
    spans = [[4], [5], [4, 5]]
    for span, (mean, gain) in zip(spans, Gram.of(x, y).solve_beside_bounded(low, high, spans), strict=True):
        least, evidence = best([*own, *span])
        assert mean == pytest.approx(least[4:], abs=1e-9)
        assert gain == pytest.approx(evidence - alone, abs=1e-9)
