"""Recordings of motors and axes that are damaged: what is said, and that nothing breaks."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis.fit import FreeParameter
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.kind import Kind, kind_of
from raccoon.diagnose.recordings.motors.diagnosis import diagnose_motors
from raccoon.diagnose.recordings.motors.units import speed_saturation_fault
from raccoon.diagnose.recordings.tophats.diagnosis import tophat_ports
from raccoon.diagnose.result import Verdict
from unit.diagnose.axes import Axis, bench, carriage, motor

ROBOT = RobotConfig()
FORCE = "motor.0.force"


@pytest.fixture(scope="module")
def good() -> dict[str, np.ndarray]:
    return carriage(Axis(), 1, seconds=6.0)


def test_a_time_in_milliseconds_is_said(good: dict[str, np.ndarray]) -> None:
    """It was adequate, over stretches of 1000 s."""
    with pytest.raises(TraceError, match="it looks like milliseconds or hundredths of a second, not seconds"):
        diagnose_recording({**good, "t": 1000.0 * good["t"]}, ROBOT)


@pytest.mark.parametrize("kind", ["magnitude", "changes"])
def test_a_force_that_is_none_breaks_nothing(good: dict[str, np.ndarray], kind: str) -> None:
    """Evidence without an end, and an effort that is 0 but for moments."""
    force = np.abs(good[FORCE]) if kind == "magnitude" else np.diff(good[FORCE], prepend=0.0)
    found = diagnose_recording({**good, FORCE: force}, ROBOT)
    assert not any(each.probability > 0.9 and each.change > 100.0 for each in found.causes)


def test_columns_that_are_swapped_are_not_diagnosed() -> None:
    """No numbers give such a motion: it was an error of linear algebra."""
    columns = bench(4, coulomb=0.05, seconds=4.0)
    speed, current = columns["motor.0.speed"], columns["motor.0.current"]
    found = diagnose_recording({**columns, "motor.0.speed": current, "motor.0.current": speed}, ROBOT)
    assert not found.causes
    assert any("not diagnosed" in each.reason for each in found.rejected)


def test_a_number_that_nothing_holds_stays_one() -> None:
    assert np.isfinite(FreeParameter("inertia", 1.0, 0.3, positive=True).value(np.array([-1e6, 1e6]))).all()


def test_names_without_a_port_are_of_another_program() -> None:
    """They were a ValueError."""
    time = 0.01 * np.arange(300, dtype=float)
    named = {"t": time, "motor.left.duty": np.sin(time), "motor0.bemf": time, "analog.front": time}
    assert kind_of(named, ROBOT) is Kind.DRIVE
    held = r"motor\.0\.duty is not in the recording: it holds motor\.left\.duty"
    with pytest.raises(
        TraceError, match=held + r"; .*'motor0\.bemf' should be motor\.0\.bemf; .*among 'motor\."
    ):
        diagnose_recording(named, ROBOT)
    assert tophat_ports({"t": time, "analog.front": time, "analog.3": time}, ROBOT) == [3]


def test_volts_beyond_the_battery_are_said() -> None:
    columns = bench(4, seconds=2.0)
    percent = {**columns, "motor.0.voltage": 12.5 * columns["motor.0.voltage"]}
    with pytest.raises(
        TraceError, match=r"motor\.0\.voltage reaches .* of a battery of 8 V: it looks like percent"
    ):
        diagnose_recording(percent, ROBOT)


@pytest.mark.parametrize("kind", ["voltage", "speed"])
def test_volts_and_speeds_without_their_sign_are_said(kind: str) -> None:
    """Of volts without it the wires were said to be swapped."""
    columns, name = bench(4, seconds=2.0), f"motor.0.{kind}"
    with pytest.raises(TraceError, match=rf"motor\.0\.{kind} has one sign only"):
        diagnose_recording({**columns, name: np.abs(columns[name])}, ROBOT)


@pytest.fixture(scope="module")
def driven() -> dict[str, np.ndarray]:
    columns = motor(5, 0.004)
    return {**columns, "battery.voltage": np.full(len(columns["t"]), 7.4)}


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("battery.voltage", 1.0 / 0.008862, r"battery.voltage is around 835\.\d+ V: .* looks like counts"),
        ("battery.voltage", 1000.0, "battery.voltage is around 7400 V: .* or millivolts, not volts"),
        ("motor.0.voltage", 1.0 / 7.4, "it looks like a duty from -1 to 1, not volts"),
        ("motor.0.voltage", 100.0 / 7.4, "it looks like percent"),
        ("t", -1.0, "it must advance"),
    ],
)
def test_a_motor_in_other_units_is_refused(
    driven: dict[str, np.ndarray], column: str, factor: float, said: str
) -> None:
    """A battery in counts had 1571 ohm, with a probability of 0.99."""
    with pytest.raises(TraceError, match=said):
        diagnose_motors({**driven, column: factor * driven[column]}, ROBOT)


@pytest.mark.parametrize("missing", [np.nan, 0.0])
def test_a_speed_that_is_missing_or_stuck_has_no_sign_to_lose(
    driven: dict[str, np.ndarray], missing: float
) -> None:
    """It was said to hold how large it was, and its current to be dead."""
    columns = {**driven, "motor.0.speed": np.full(len(driven["t"]), missing)}
    found = diagnose_motors(columns, ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert not any(each.fault == "dead" for each in found.sensor_faults)


def test_a_current_in_milliamperes_is_said(driven: dict[str, np.ndarray]) -> None:
    columns = {**driven, "motor.0.current": 1000.0 * driven["motor.0.current"]}
    (fault,) = diagnose_motors(columns, ROBOT).sensor_faults
    assert "it looks like milliamperes or counts, and was not used" in fault.text


def test_a_speed_that_is_cut_off_is_said_and_not_used(driven: dict[str, np.ndarray]) -> None:
    """It was a dry friction twice as large as there is, with a probability of 1."""
    columns = {**driven, "motor.0.speed": np.clip(driven["motor.0.speed"], -15.0, 15.0)}
    found = diagnose_motors(columns, ROBOT)
    assert found.causes == ()
    (fault,) = found.sensor_faults
    assert (fault.channel, fault.fault) == ("motor.0.speed", "saturated")


def test_a_speed_without_noise_that_comes_to_rest_at_its_largest_is_whole() -> None:
    time = 0.001 * np.arange(2000.0)
    speed = np.round(20.0 * (1.0 - np.exp(-time / 0.05)), 3)
    assert speed_saturation_fault("motor.0.speed", speed) is None
    assert speed_saturation_fault("motor.0.speed", np.minimum(speed, 15.0)) is not None
