"""The plant against recordings of real motors."""

import numpy as np

from shared_data import data_path
from step_recordings import (
    EFFECTS,
    LATENCY,
    Wheel,
    fitted,
    held_out,
    recordings,
    sag,
    simulated,
    steps_inside,
    wheels,
)


def test_it_foresees_steps_it_was_not_fitted_on() -> None:
    """Every second robot; `benchmarks/plant.py` has them all."""
    robots = recordings(data_path("fleet-steps"))[::2]
    every = [wheel for table in robots for wheel in wheels(table)]
    scores = [held_out(wheel, fitted(wheel, LATENCY), LATENCY) for wheel in every]
    assert len(scores) == 22
    assert np.median([each.r2 for each in scores]) >= 0.986
    assert np.median([each.rmse for each in scores]) <= 0.061


def test_battery_sag_of_a_step_it_was_not_fitted_on() -> None:
    tables = recordings(data_path("fleet-steps"))
    easy, hard = sag(tables, split=0.503), sag(tables, split=0.352)
    assert easy.own <= 0.0085
    assert easy.plain > 0.02
    # The small currents of the first two steps say little about each robot: the fleet's mean helps.
    assert hard.floor < hard.shared < hard.own < hard.plain


def test_a_fit_finds_the_numbers_of_a_simulated_wheel() -> None:
    time = (np.arange(660) * 0.001).astype(np.float64)
    steps = np.select([time < 0.2, time < 0.352, time < 0.503], [2.0, 4.0, -4.0], 0.0)
    command = steps.astype(np.float64)
    numbers = np.array([*np.log([3.0, 0.1, 3e-4, 0.01, 2e-5]), 0.004])
    blank = Wheel(time, command, np.zeros(660), np.zeros(660))
    wheel = Wheel(time, command, *simulated(numbers, blank, LATENCY))
    found = fitted(wheel, LATENCY)
    np.testing.assert_allclose(found[[0, 1, 2, 5]], numbers[[0, 1, 2, 5]], rtol=0.02, atol=1e-4)
    assert held_out(wheel, found, LATENCY).r2 > 0.999
    assert set(LATENCY) <= set(EFFECTS)


def test_a_number_at_its_bound_is_moved_inwards_for_its_column() -> None:
    numbers, high = np.array([10.0, 2.0]), np.array([10.0, 10.0])
    low, up = steps_inside(numbers, np.array([0.1, 0.1]), high)
    assert low < 0.0 < up
