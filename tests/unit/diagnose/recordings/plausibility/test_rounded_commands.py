"""Commands that were rounded for the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from blind import drives
from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.diagnose.recordings.plausibility.rounded_commands import with_rounding_doubt
from raccoon.diagnose.result import ChannelResult, Verdict

Drive = Callable[[np.random.Generator, float], np.ndarray]
FOUND = make_diagnosis(make_cause("drive.inertia", factor_parameters(1.4)))


def columns(duty: np.ndarray) -> dict[str, np.ndarray]:
    return {"motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}


@pytest.mark.parametrize("drive", [drives.contest, drives.legs])
@pytest.mark.parametrize("step", [0.1, 0.05])
def test_ramps_in_a_log_of_one_digit_are_doubted(drive: Drive, step: float) -> None:
    """They made another inertia, a friction, a filter and a slip of a sound robot."""
    duty = np.asarray(drive(np.random.default_rng(32), 24.0))
    told = with_rounding_doubt(FOUND, columns(np.round(duty / step) * step))
    assert told.verdict is Verdict.PARTLY
    assert told.notes[0].startswith("motor.0.duty and motor.1.duty hold whole multiples")
    assert f"multiples of {step:g} " in told.notes[0]
    assert with_rounding_doubt(FOUND, columns(np.round(duty, 2))) is FOUND


def test_of_commands_in_whole_percent_what_moves_a_wheel_by_less_is_doubted() -> None:
    """A sound robot whose turns were calculated had a scrub of 6 mN m, with a probability of 1."""
    duty = np.asarray(drives.contest(np.random.default_rng(32), 24.0))
    wheels = (ChannelResult("motor.0.bemf", "counts", 9.0, 6.0, 3.7, 0.0),)
    scrub = make_cause("drive.turn_scrub", said="wrong: do.", change=0.55)
    found = make_diagnosis(
        scrub, make_cause("drive.inertia", factor_parameters(1.4), change=8.0), channels=wheels
    )
    volts = {"battery.voltage": np.full(len(duty), 6.8)}
    told = with_rounding_doubt(found, columns(np.round(duty, 2)) | volts)
    assert "readings by 6 counts, more than drive.turn_scrub:" in told.notes[0]
    assert told.verdict is found.verdict
    assert with_rounding_doubt(found, columns(duty) | volts) is found
    assert (
        with_rounding_doubt(replace(found, causes=found.causes[1:]), columns(np.round(duty, 2)) | volts).notes
        == ()
    )
    few = np.round(duty, 1) + 0.03
    assert with_rounding_doubt(found, columns(few) | volts) is found


def test_a_program_of_a_few_powers_is_not() -> None:
    rng = np.random.default_rng(1)
    few = rng.choice([-0.6, -0.3, 0.0, 0.3, 0.6, 1.0], (80, 2)).repeat(60, axis=0)
    many = np.round(rng.uniform(-1.0, 1.0, (80, 2)), 1).repeat(60, axis=0)
    for duty in (few, many):
        assert with_rounding_doubt(FOUND, columns(duty)) is FOUND
