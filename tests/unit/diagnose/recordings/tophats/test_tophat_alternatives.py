"""What else a tophat's levels may be, light that jumps under labels, and tophats that were not recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import parse_robot
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.tophats.fit import NominalSensor
from raccoon.diagnose.recordings.tophats.judge import _parameter_result
from raccoon.diagnose.recordings.tophats.sentences import GAIN
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.model.reflectance import counts, fit

Array = NDArray[np.float64]
ROBOT = parse_robot({"tophat": {"front": {"analog": 2}}})
TIME: Array = np.asarray(0.01 * np.arange(2000), np.float64)
BLACK = TIME % 1.0 > 0.7


def over_lines(white: Array | float, black: Array | float, *, labels: bool = True) -> dict[str, Array]:
    """White with a black line every second, 20 s at 100 Hz, with the noise of a standing sensor."""
    clean = np.where(BLACK, black, white) + 3.0 * np.random.default_rng(3).standard_normal(len(TIME))
    read: Array = np.clip(np.round(clean), 0.0, 4095.0)
    columns: dict[str, Array] = {"t": TIME, "analog.2": read}
    return {**columns, "truth.surface.2": BLACK.astype(float)} if labels else columns


def in_light(sun: NDArray[Any], *, labels: bool) -> Diagnosis:
    sensor = fit("new").at(0.007)
    white, black = (sensor.counts(np.full(len(sun), side), sun) for side in (0.0, 1.0))
    return diagnose_recording(over_lines(white, black, labels=labels), ROBOT)


@pytest.mark.parametrize("labels", [False, True])
def test_a_light_that_comes_on_is_found_with_and_without_labels(labels: bool) -> None:
    """With labels the levels' own fall hid them from each other: "white and black cannot be told apart"."""
    found = in_light(0.1 * (TIME > 10.5), labels=labels)
    assert found.verdict is Verdict.PARTLY
    assert [each.id for each in found.causes] == ["tophat.ambient_light"]
    assert found.causes[0].explanation.startswith("From 10.5 s on: ")


def test_light_that_grows_slowly_is_a_change_in_time_with_labels_too() -> None:
    found = in_light(0.3 / (1.0 + np.exp(-0.5 * (TIME - 10.0))), labels=True)
    assert found.verdict is Verdict.UNKNOWN
    assert found.unexplained.depends_on == ("time",)


def test_an_older_sensor_that_reads_the_same_at_another_height_is_said() -> None:
    """One at 12 mm was said to be a newer one at 4.4 mm, and nothing else."""
    levels = [float(counts(side, "old", 0.012, 0.0)) for side in (0.0, 1.0)]
    found = diagnose_recording(over_lines(*levels), ROBOT)
    assert [each.id for each in found.causes] == ["tophat.height"]
    (note,) = found.notes
    assert "at about 12 mm a sensor of the older make reads the same" in note
    # One that is 23 mm up would have to be higher than sensors are.
    high = diagnose_recording(over_lines(*(float(counts(side, "new", 0.023, 0.0)) for side in (0, 1))), ROBOT)
    assert high.notes == ()


def test_counts_of_ten_bits_with_a_fault_besides_are_asked_about() -> None:
    white, black = (float(counts(side, "new", 0.007, 0.0)) for side in (0.0, 1.0))
    found = diagnose_recording(over_lines(0.85 * white / 4.0, 0.85 * black / 4.0), ROBOT)
    assert any("may hold readings of 10 bits" in each for each in found.notes)
    whole = diagnose_recording(over_lines(0.85 * white, 0.85 * black), ROBOT)
    assert whole.notes == ()


def test_a_tophat_that_was_not_recorded_is_named_as_missing() -> None:
    two = parse_robot({"tophat": {"front": {"analog": 2}, "back": {"analog": 5}}})
    found = diagnose_recording(over_lines(1270.0, 3800.0), two)
    assert found.verdict is Verdict.ADEQUATE
    assert {(each.id, each.reason) for each in found.rejected if each.id.endswith("@5")} == {
        (f"tophat.{name}@5", "not identifiable: analog.5 is missing")
        for name in ("ambient_light", "gain", "height", "noise")
    }


def test_how_sure_a_gain_is_counts_from_the_one_that_the_model_has() -> None:
    number = _parameter_result(GAIN, 0.1, 0.02, NominalSensor(factor=0.5))
    assert (number.value, number.std, number.nominal) == pytest.approx((0.55, 0.01, 0.5))
