"""Back-EMF readings that are not proportional to the speed."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from diagnoses import make_diagnosis
from raccoon.diagnose.recordings.channels.curved_readings import BEMF_OVER_SPEED, with_curved_readings
from raccoon.diagnose.result import Curve, Diagnosis, Unexplained, Verdict

Array = NDArray[np.float64]
TIME = np.asarray(0.02 * np.arange(600), float)
SPEED = np.asarray(1500.0 * np.sin(1.7 * TIME) * np.sin(0.6 * TIME + 1.0), float)
NOISE = 2.0 * np.random.default_rng(3).standard_normal(len(TIME))
WAVES = 24.0 * np.sin(SPEED / 250.0)


def diagnosis(error: Array, verdict: Verdict, name: str = "motor.0.bemf") -> Diagnosis:
    measured = np.asarray(SPEED + error + NOISE, float)
    curve = Curve(name, "counts", TIME, measured, SPEED, SPEED)
    return replace(make_diagnosis(), verdict=verdict, curves=(curve,))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (Verdict.EXPLAINED, Verdict.PARTLY),
        (Verdict.ADEQUATE, Verdict.UNKNOWN),
        (Verdict.PARTLY, Verdict.PARTLY),
    ],
)
def test_a_reading_that_bends_over_the_speed_is_unknown(before: Verdict, after: Verdict) -> None:
    found = with_curved_readings(diagnosis(WAVES, before))
    assert found.verdict is after
    assert found.unexplained.depends_on == (BEMF_OVER_SPEED,)
    size = re.search(r"by (\d+) counts \(motor.0.bemf\)", found.notes[-1])
    assert size is not None
    beside_line = WAVES - np.polyval(np.polyfit(SPEED, WAVES, 1), SPEED)
    assert float(size[1]) == pytest.approx(np.sqrt((beside_line**2).mean()), rel=0.15)


@pytest.mark.parametrize(
    "error",
    [
        0.0 * TIME,
        0.4 * WAVES,
        24.0 * np.sin(9.0 * TIME),
        0.02 * np.gradient(SPEED, TIME),
        0.03 * SPEED + 20.0,
    ],
    ids=["noise", "small", "over time", "lag", "scale"],
)
def test_other_errors_do_not_depend_on_the_speed(error: Array) -> None:
    known = diagnosis(error, Verdict.EXPLAINED)
    assert with_curved_readings(known) is known


def test_what_is_unknown_already_and_other_sensors_stay() -> None:
    known = replace(diagnosis(WAVES, Verdict.PARTLY), unexplained=Unexplained(0.3, ("speed",)))
    assert with_curved_readings(known) is known
    gyro = diagnosis(WAVES, Verdict.EXPLAINED, "imu.gyro.z")
    assert with_curved_readings(gyro) is gyro
