from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import draw
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.kinds import Kind, diagnose_recording, kind_of
from raccoon.diagnose.recordings.truth import with_reference
from raccoon.diagnose.result import CauseResult, Diagnosis, Gain, ParameterResult, Unexplained, Verdict
from raccoon.sim.parameters import Parameters

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def weak_right() -> Columns:
    """A drive whose right motor has another K_E."""
    hidden = draw("motor.back_emf_constant", np.random.default_rng(8))
    return dict(make(8, [hidden], seconds=10.0).columns)


def without(columns: Columns, *words: str) -> Columns:
    return {name: each for name, each in columns.items() if not any(word in name for word in words)}


def test_volts_instead_of_duty_hide_the_battery_and_nothing_else(weak_right: Columns) -> None:
    known = np.isfinite(weak_right["battery.voltage"])
    battery = np.interp(weak_right["t"], weak_right["t"][known], weak_right["battery.voltage"][known])
    volts = without(weak_right, "duty", "battery")
    for port in (0, 1):
        volts[f"motor.{port}.voltage"] = weak_right[f"motor.{port}.duty"] * battery
    assert kind_of(volts, ROBOT) is Kind.DRIVE
    found = diagnose_recording(volts, ROBOT)
    assert [each.name for each in found.causes] == ["motor.back_emf_constant@right"]
    reasons = {each.id: each.reason for each in found.rejected}
    assert "motor.N.voltage is recorded instead" in reasons["battery.internal_resistance"]


def test_without_gyro_and_battery_the_rest_is_named_and_the_columns_too(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "gyro", "battery"), ROBOT)
    assert [each.name for each in found.causes] == ["motor.back_emf_constant@right"]
    reasons = {each.id: each.reason for each in found.rejected}
    assert reasons["imu.gyro_scale"] == "not identifiable: imu.gyro.z is missing"
    assert reasons["battery.discharge"] == "not identifiable: battery.voltage is missing"


def test_without_any_wheel_nothing_is_identifiable(weak_right: Columns) -> None:
    found = diagnose_recording(without(weak_right, "bemf", "position"), ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert any("motor.0.bemf or motor.0.speed" in each.reason for each in found.rejected)


def test_commands_of_another_robot_are_an_error(weak_right: Columns) -> None:
    other = {name.replace("motor.1", "motor.3"): each for name, each in weak_right.items()}
    with pytest.raises(TraceError, match=r"motor\.1\.duty is not in the recording"):
        diagnose_recording(other, ROBOT)


def spinning(gyro: float = 1.0, track: float = 1.0) -> Columns:
    """Spins and straights to both sides with back-EMF, gyro and a reference; factors on gyro and track."""
    rng = np.random.default_rng(2)
    time = 0.01 * np.arange(3000)
    forward = np.where(time < 2.0, 0.0, 0.2 * (time % 6.0 < 3.0))
    turn = np.where(time < 2.0, 0.0, 1.5 * np.sign(np.sin(1.3 * time)))
    heading = np.concatenate([[0.0], np.cumsum(0.005 * (turn[1:] + turn[:-1]))])
    along = np.concatenate([[0.0], np.cumsum(0.005 * (forward[1:] + forward[:-1]))])
    x = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.cos(heading[1:]))])
    y = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.sin(heading[1:]))])
    drive, model = ROBOT.model.drive, ROBOT.model.left
    columns: Columns = {"t": time, "truth.x": x, "truth.y": y, "truth.heading": heading}
    counts = 303.4 * model.back_emf_constant.value / drive.wheel_radius.value
    for port, side in ((0, -1.0), (1, 1.0)):
        speed = forward + side * 0.5 * track * drive.track_width.value * turn
        columns[f"motor.{port}.bemf"] = counts * speed + rng.standard_normal(3000)
    return {**columns, "imu.gyro.z": gyro * turn + 0.002 + 0.005 * rng.standard_normal(3000)}


def twin(id_: str, factor: float) -> Diagnosis:
    """A diagnosis that could not tell the three from each other."""
    rivals = tuple(
        each for each in ("imu.gyro_scale", "drive.track_width", "drive.wheel_radius") if each != id_
    )
    numbers = {"factor": ParameterResult(factor, 0.002, "", 1.0)}
    cause = CauseResult(id_, None, 1, numbers, Gain(4.0, 1.0, 1.0), 0.5, rivals, "twins.")
    return Diagnosis(Verdict.EXPLAINED, (), (cause,), (), Unexplained(0.0), (), 0.1)


def test_a_reference_decides_between_the_twins() -> None:
    (cause,) = with_reference(twin("drive.track_width", 0.93), spinning(gyro=1.07), ROBOT).causes
    assert (cause.id, cause.confounded_with) == ("imu.gyro_scale", ())
    assert cause.parameters["factor"].value == pytest.approx(1.07, abs=0.005)
    (cause,) = with_reference(twin("imu.gyro_scale", 0.93), spinning(track=1.07), ROBOT).causes
    assert (cause.id, cause.confounded_with) == ("drive.track_width", ())
    assert cause.parameters["factor"].value == pytest.approx(1.07, abs=0.01)


def test_the_model_has_the_twin_that_the_reference_chose() -> None:
    before = twin("drive.track_width", 0.93)
    model = Parameters.from_robot(ROBOT).with_effect("drive.track_width", factor=0.93)
    found = with_reference(replace(before, model=model), spinning(gyro=1.07), ROBOT).model
    assert found is not None
    assert list(found.effects) == [("imu.gyro_scale", None)]
    assert found.value("imu.gyro_scale", "factor") == pytest.approx(1.07, abs=0.005)


def test_a_reading_that_is_named_too_large_is_no_smaller_wheel() -> None:
    """By the reference the wheels go less far than they say, whatever it is that makes them say so."""
    columns = spinning()
    columns["motor.0.bemf"] = 1.05 * columns["motor.0.bemf"]
    numbers = {"factor": ParameterResult(1.05, 0.002, "", 1.0)}
    cause = CauseResult("bemf.scale", "left", 1, numbers, Gain(4.0, 1.0, 1.0), 1.0, (), "reads too much.")
    before = Diagnosis(Verdict.EXPLAINED, (), (cause,), (), Unexplained(0.0), (), 0.1)
    identified = with_reference(before, columns, ROBOT).identified
    for name in ("wheel_radius", "track_width"):
        number = identified[f"{name} by the reference"]
        assert number.value == pytest.approx(1.0, abs=0.005)
    unnamed = with_reference(replace(before, causes=()), columns, ROBOT).identified
    assert unnamed["wheel_radius by the reference"].value < 0.985


def test_without_a_reference_they_stay_a_class() -> None:
    before = twin("drive.track_width", 0.93)
    columns = without(spinning(gyro=1.07), "truth")
    assert with_reference(before, columns, ROBOT) == before
