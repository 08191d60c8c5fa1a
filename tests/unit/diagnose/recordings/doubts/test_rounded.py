"""Commands that were rounded for the log."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from blind import drives
from diagnoses import cause, diagnosis, factor
from raccoon.diagnose.recordings.doubts.rounded import with_rounded
from raccoon.diagnose.result import Verdict

Drive = Callable[[np.random.Generator, float], np.ndarray]
FOUND = diagnosis(cause("drive.inertia", factor(1.4)))


def columns(duty: np.ndarray) -> dict[str, np.ndarray]:
    return {"motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}


@pytest.mark.parametrize("drive", [drives.contest, drives.legs])
@pytest.mark.parametrize("step", [0.1, 0.05])
def test_ramps_in_a_log_of_one_digit_are_doubted(drive: Drive, step: float) -> None:
    """They made another inertia, a friction, a filter and a slip of a sound robot."""
    duty = np.asarray(drive(np.random.default_rng(32), 24.0))
    told = with_rounded(FOUND, columns(np.round(duty / step) * step))
    assert told.verdict is Verdict.PARTLY
    assert told.notes[0].startswith("motor.0.duty and motor.1.duty hold whole multiples")
    assert f"multiples of {step:g} " in told.notes[0]
    assert with_rounded(FOUND, columns(np.round(duty, 2))) is FOUND


def test_a_program_of_a_few_powers_is_not() -> None:
    rng = np.random.default_rng(1)
    few = rng.choice([-0.6, -0.3, 0.0, 0.3, 0.6, 1.0], (80, 2)).repeat(60, axis=0)
    many = np.round(rng.uniform(-1.0, 1.0, (80, 2)), 1).repeat(60, axis=0)
    for duty in (few, many):
        assert with_rounded(FOUND, columns(duty)) is FOUND
