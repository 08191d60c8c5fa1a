from __future__ import annotations

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.kind import Kind, kind_of
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.trace.loading import load_run
from shared_data import data_path

ROBOT = RobotConfig()


def real(name: str) -> Diagnosis:
    recording = load_run(data_path("wombat-motor-steps") / name).recording
    return diagnose_recording(recording.columns, ROBOT, problems=recording.problems)


@pytest.mark.parametrize("motor", range(4))
def test_a_real_step_tells_its_dead_time_and_no_motor_constants(motor: int) -> None:
    found = real(f"motor_{motor}_cmd_10.csv")
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert found.causes == ()
    assert 0.24 <= found.identified["dead time at 10 %"].value <= 0.27
    told = {each.id: each.reason for each in found.rejected}
    assert told["motor.back_emf_constant"].startswith("not identifiable")
    assert "repeats" in {each.fault for each in found.sensor_faults}


@pytest.mark.parametrize("name", ["motor_0_cmd_15", "motor_1_cmd_20", "motor_2_cmd_15", "motor_3_cmd_20"])
def test_a_real_stale_start_and_the_filter_behind_it_are_said(name: str) -> None:
    found = real(f"{name}.csv")
    faults = {each.fault: each.text for each in found.sensor_faults}
    assert {"stale", "filtered", "repeats"} <= set(faults)
    assert found.identified["filter keeps of a sample"].value == pytest.approx(0.2, abs=0.01)
    assert 0.04 <= found.identified["repeated samples"].value <= 0.43


def test_a_made_step_that_turns_backwards() -> None:
    time = 0.01 * np.arange(200.0)
    columns = {"t": time, "motor.2.duty": np.full(200, 0.2), "motor.2.speed": np.where(time > 0.3, -5.0, 0.0)}
    assert kind_of(columns, ROBOT) is Kind.STEP
    found = diagnose_recording(columns, ROBOT)
    assert [each.fault for each in found.sensor_faults] == ["repeats", "inverted"]
    assert "set inverted" not in found.sensor_faults[1].text  # which turns command and reading
    assert found.identified["dead time at 20 %"].value == pytest.approx(0.31, abs=0.011)


def test_a_step_of_back_emf_is_drawn_in_counts() -> None:
    time = 0.01 * np.arange(200.0)
    columns = {"t": time, "motor.2.duty": np.full(200, 0.2), "motor.2.bemf": np.where(time > 0.3, 300.0, 0.0)}
    (curve,) = diagnose_recording(columns, ROBOT).curves
    assert (curve.name, curve.unit) == ("motor.2.bemf", "counts")


def test_a_step_begins_where_its_command_does() -> None:
    """Blank rows before the first command were a power of nan %, and counted as dead time."""
    time = 0.01 * np.arange(200.0)
    duty = np.where(time < 0.095, np.nan, 0.2)
    columns = {"t": time, "motor.2.duty": duty, "motor.2.speed": np.where(time > 0.305, 5.0, 0.0)}
    assert kind_of(columns, ROBOT) is Kind.STEP
    found = diagnose_recording(columns, ROBOT)
    assert found.identified["dead time at 20 %"].value == pytest.approx(0.21, abs=0.011)
    columns["motor.2.speed"][:15] = np.nan  # of which the first came late; the command did not
    found = diagnose_recording(columns, ROBOT)
    assert found.identified["dead time at 20 %"].value == pytest.approx(0.21, abs=0.011)
    late = {**columns, "motor.2.duty": np.where(time < 1.95, np.nan, 0.2)}
    assert kind_of(late, ROBOT) is not Kind.STEP  # nothing is left that was read under it


def made(**changes: np.ndarray) -> dict[str, np.ndarray]:
    time = 0.01 * np.arange(200.0)
    noise = 0.05 * np.random.default_rng(0).standard_normal(200)
    speed = 5.0 * (1.0 - np.exp(-time / 0.05)) + noise
    return {"t": time, "motor.0.duty": np.full(200, 0.5), "motor.0.speed": speed, **changes}


@pytest.mark.parametrize(
    ("factor", "said"), [(1000.0, "it looks like milliseconds, not seconds"), (-1.0, "it must advance")]
)
def test_a_step_whose_time_is_none_is_refused(factor: float, said: str) -> None:
    """Its dead time was a thousand times as long."""
    assert diagnose_recording(made(), ROBOT).identified["dead time at 50 %"].value < 0.03
    with pytest.raises(TraceError, match=said):
        diagnose_recording(made(t=factor * made()["t"]), ROBOT)


def test_a_motor_that_never_turns_is_not_read_too_fast() -> None:
    found = diagnose_recording(made(**{"motor.0.speed": np.zeros(200)}), ROBOT)
    assert [each.fault for each in found.sensor_faults] == ["stuck"]
