"""The plant against recordings of real motors."""

import numpy as np

from shared_data import data_path
from step_recordings import fitted, held_out, recordings, sag_error, wheels


def test_it_foresees_steps_it_was_not_fitted_on() -> None:
    robots = recordings(data_path("fleet-steps"))
    every = [wheel for table in robots for wheel in wheels(table)]
    scores = [held_out(wheel, fitted(wheel, latency=True)) for wheel in every]
    assert len(scores) == 44
    assert np.median([each.r2 for each in scores]) >= 0.986
    assert np.median([each.rmse for each in scores]) <= 0.061


def test_battery_sag_of_a_step_it_was_not_fitted_on() -> None:
    errors = [sag_error(table, split=0.503) for table in recordings(data_path("fleet-steps"))]
    fit, plain = np.median(errors, axis=0)
    assert fit <= 0.0085
    assert plain > 0.02
