from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.drives.bins import low_pass, solve_recursion


def test_a_low_pass_answers_a_step_as_its_closed_form_and_passes_nothing_backwards() -> None:
    values = np.ones(400)
    assert low_pass(values, 0.005, 0.05) == pytest.approx(1.0 - np.exp(-0.1 * np.arange(1, 401)), abs=1e-12)
    values[300] = np.nan
    assert np.isfinite(low_pass(values, 0.005, 0.05)[:300]).all()
    assert low_pass(np.zeros(0), 0.005, 0.05).size == 0


def test_a_recursion_takes_each_samples_own_decay() -> None:
    random = np.random.default_rng(1)
    decay, inputs = random.uniform(0.0, 1.0, 50), random.normal(size=(2, 50))
    state, wanted = np.zeros(2), []
    for kept, each in zip(decay, inputs.T, strict=True):
        state = kept * state + each
        wanted.append(state)
    assert solve_recursion(decay, inputs) == pytest.approx(np.array(wanted).T, abs=1e-12)
