import ast
from collections.abc import Callable

import numpy as np
import pytest

from raccoon.estimate.ekf import model as drive_model
from raccoon.estimate.ekf.filter import DriveFilter, ProcessNoise, covariance_of, mean_of, variance_index
from raccoon.estimate.ekf.state import SIZE, State
from raccoon.model.drive import DriveGeometry
from reference_filter import ReferenceFilter

GEOMETRY = DriveGeometry(0.0345, 0.16)
NOISE = ProcessNoise(0.09, 4.0, 1e-10, 1e-8, 1e-7)
DEVIATIONS = (0.01, 0.01, 0.02, 0.1, 0.3, 0.005, 0.05, 0.05, 0.05, 0.03, 0.05, 0.001, 0.015)


def belief(seed: int = 0) -> tuple[drive_model.Array, drive_model.Array]:
    """A random state with a full random covariance."""
    generator = np.random.default_rng(seed)
    nominal = np.array([0.3, -0.2, 0.7, 0.15, 0.4, 0.002, 0.01, -0.02, 1.0, 0.0, 1.0, 1.0, 0.0])
    deviations = np.array(DEVIATIONS)
    A = np.eye(SIZE) + 0.2 * generator.normal(size=(SIZE, SIZE))
    correlation = A @ A.T
    covariance = correlation * np.outer(deviations, deviations)
    return nominal + deviations * generator.normal(size=SIZE), covariance


def pair(seed: int = 0) -> tuple[DriveFilter, ReferenceFilter]:
    mean, covariance = belief(seed)
    return DriveFilter(mean, covariance, GEOMETRY, NOISE), ReferenceFilter(mean, covariance, GEOMETRY, NOISE)


def assert_same(fast: DriveFilter, stock: ReferenceFilter) -> None:
    np.testing.assert_allclose(mean_of(fast.flat), mean_of(stock.flat), rtol=1e-9, atol=1e-12)
    scale = np.sqrt(np.diag(covariance_of(stock.flat)))
    error = (covariance_of(fast.flat) - covariance_of(stock.flat)) / np.outer(scale, scale)
    assert np.abs(error).max() < 1e-9


def test_generated_filter_equals_filterpy_over_a_drive() -> None:
    generator = np.random.default_rng(1)
    fast, stock = pair()
    for cycle in range(400):
        dt = float(generator.uniform(0.003, 0.03))
        left, right, gyro = (float(each) for each in generator.normal([4.0, 4.5, 0.3], [1.0, 1.0, 0.5]))
        swing = float(generator.normal(0.0, 5.0))
        if cycle % 7 == 3:
            fast.step(dt, (left, right), (0.01, 0.02), swing, 0.03)
            stock.step(dt, (left, right), (0.01, 0.02), swing, 0.03)
        else:
            fast.step(dt, (left, right, gyro), (0.01, 0.02, 1e-5), swing, 0.03)
            stock.step(dt, (left, right, gyro), (0.01, 0.02, 1e-5), swing, 0.03)
        if cycle % 11 == 5:
            fast.apply_standstill(1e-6, 1e-6)
            stock.still(1e-6, 1e-6)
        if cycle % 13 == 5:
            fast.predict(dt)
            stock.predict(dt)
        assert_same(fast, stock)


@pytest.mark.parametrize("seed", range(5))
def test_jacobians_are_the_slopes_of_the_model(seed: int) -> None:
    mean, _ = belief(seed)
    step = 1e-6
    models: list[tuple[Callable[[drive_model.Array], drive_model.Array], drive_model.Array]] = [
        (lambda x: drive_model.predict_state(x, 0.02), drive_model.motion_jacobian(mean, 0.02)),
        (
            lambda x: drive_model.expected_readings(x, GEOMETRY, 4.0),
            drive_model.expected_readings_jacobian(mean, GEOMETRY, 4.0),
        ),
    ]
    for function, jacobian in models:
        columns = [(function(mean + h) - function(mean - h)) / (2 * step) for h in step * np.eye(SIZE)]
        np.testing.assert_allclose(jacobian, np.array(columns).T, rtol=1e-6, atol=1e-8)


def test_innovation_and_its_variance_are_those_of_the_textbook() -> None:
    fast, stock = pair(3)
    stock.predict(0.01)
    mean, P = mean_of(stock.flat), covariance_of(stock.flat)
    H = drive_model.expected_readings_jacobian(mean, GEOMETRY)[0]
    innovation, variance = fast.step(0.01, (5.0, 5.5, 0.2), (0.01, 0.01, 1e-5), 0.0)[:2]
    assert innovation == pytest.approx(5.0 - drive_model.expected_readings(mean, GEOMETRY)[0], rel=1e-9)
    assert variance == pytest.approx(H @ P @ H + 0.01, rel=1e-9)


def test_observation_goes_through_filterpy_and_moves_what_correlates() -> None:
    fast, _ = pair(4)
    before, P = mean_of(fast.flat), covariance_of(fast.flat)
    H = np.zeros((1, SIZE))
    H[0, State.HEADING] = 1.0
    measured = before[State.HEADING : State.HEADING + 1] + 0.05
    distance = fast.observe(measured, lambda x: H @ x, lambda _: H, np.array([[1e-4]]))
    expected_gain = P[:, State.HEADING] / (P[State.HEADING, State.HEADING] + 1e-4)
    np.testing.assert_allclose(mean_of(fast.flat), before + 0.05 * expected_gain, rtol=1e-9)
    assert distance == pytest.approx(0.05 / np.sqrt(P[State.HEADING, State.HEADING] + 1e-4))


def test_variance_index_points_at_the_diagonal() -> None:
    fast, _ = pair(5)
    P = covariance_of(fast.flat)
    for state in State:
        assert fast.flat[variance_index(state)] == P[state, state]


def test_a_wrong_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="shapes"):
        DriveFilter(np.zeros(3), np.eye(3), GEOMETRY, NOISE)


def test_checked_in_code_is_what_the_generator_writes() -> None:
    from raccoon.estimate.ekf import generate as generate_ekf  # and with it SymPy, which nothing else needs

    written = generate_ekf.TARGET.read_text(encoding="utf-8")
    assert ast.dump(ast.parse(written)) == ast.dump(ast.parse(generate_ekf.source()))
