from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from diagnoses import make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis.diagnosis import AxisName, _diagnosis
from raccoon.diagnose.recordings.axis.judge import judge_axis
from raccoon.diagnose.recordings.axis.log import axis_log
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.motors import diagnosis as motors
from raccoon.diagnose.recordings.motors.diagnosis import diagnose_motors
from raccoon.diagnose.recordings.motors.supply import judge_supply
from raccoon.diagnose.result import Diagnosis, ParameterResult, Verdict
from raccoon.trace.loading import load_run
from shared_data import data_path
from unit.diagnose.axes import Columns, bench, motor

ROBOT = RobotConfig()


def pair(seed: int, coulomb: tuple[float, float], resistance: float = 0.1) -> Columns:
    """Two motors on one battery of 11.5 V."""
    columns = {**motor(seed, coulomb[0], 0), **motor(seed + 1, coulomb[1], 1)}
    power = sum(columns[f"motor.{port}.voltage"] * columns[f"motor.{port}.current"] for port in (0, 1))
    noise = 0.005 * np.random.default_rng(seed).standard_normal(len(columns["t"]))
    return {**columns, "battery.voltage": 11.5 - resistance * power / 11.5 + noise}


def test_a_textbook_motor_has_no_cause() -> None:
    found = diagnose_recording(motor(3), ROBOT)
    assert found.causes == ()
    assert found.verdict is Verdict.ADEQUATE
    assert found.identified["resistance"].value == pytest.approx(4.0, rel=0.03)
    assert found.identified["back_emf"].value == pytest.approx(0.09, rel=0.02)


def not_asked(*_: object) -> None:
    raise TraceError("its motors are no matter here")


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """What is said of a pair whose left motor has friction."""
    return diagnose_recording(pair(5, (0.008, 0.0)), ROBOT)


def test_friction_is_named_for_the_motor_that_has_it_and_the_battery_for_itself(found: Diagnosis) -> None:
    assert {each.name for each in found.causes} == {"friction.coulomb@left", "battery.internal_resistance"}
    values = {each.name: next(iter(each.parameters.values())) for each in found.causes}
    assert values["friction.coulomb@left"].value == pytest.approx(0.008, rel=0.1)
    assert values["battery.internal_resistance"].value == pytest.approx(0.1, rel=0.1)
    assert [each.rank for each in found.causes] == [1, 2]


def test_a_speed_in_another_unit_than_the_other_motors_is_suspected(
    found: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a speed in turns a minute a K_E is 9.55 times smaller."""
    assert not any("in another unit" in note for note in found.notes)

    def judged(_columns: Columns, port: int, *_: object) -> Diagnosis:
        k_e = 0.09 if port == 0 else 0.09 * 2.0 * np.pi / 60.0
        return make_diagnosis(identified={"back_emf": ParameterResult(k_e, 1e-3 * k_e, "V s/rad", 0.0)})

    monkeypatch.setattr(motors, "diagnose_axis", judged)
    (told,) = (
        note for note in diagnose_motors(pair(5, (0.008, 0.0)), ROBOT).notes if "in another unit" in note
    )
    assert told.startswith("motor.0.back_emf is 9.")
    assert "if the motors are alike, motor.1.speed is in another unit than rad/s" in told


def test_dry_friction_by_direction_is_listed_beside_a_constant_force() -> None:
    found = diagnose_recording(bench(1, coulomb=0.05, asymmetry=0.25, seconds=2.0), ROBOT)
    pull = next(each for each in found.causes if each.id != "friction.coulomb")
    assert {pull.id, *pull.confounded_with} == {"drive.slope", "friction.direction_dependent"}
    assert pull.probability < 0.7


@pytest.mark.parametrize(
    ("band", "words"),
    [({"dead_below": 0.8}, "larger ones act in full"), ({"deadband": 0.8}, "add that much")],
)
def test_a_dead_band_is_found_by_either_rule(band: dict[str, float], words: str) -> None:
    found = diagnose_recording(bench(2, **band, seconds=2.0), ROBOT)
    (cause,) = found.causes
    assert cause.id == "actuation.deadband"
    assert cause.parameters["duty"].value == pytest.approx(0.8, rel=0.03)
    assert words in cause.explanation
    assert found.identified["resistance"].value == pytest.approx(2.0, rel=0.02)
    assert len({each.id for each in found.rejected}) == len(found.rejected)


def test_a_latency_is_found_to_a_part_of_a_sample_and_no_surer() -> None:
    late = 0.0083
    found = diagnose_recording(bench(3, late=late, seconds=2.0), ROBOT)
    (cause,) = found.causes
    assert cause.id == "actuation.latency"
    number = cause.parameters["seconds"]
    assert number.value == pytest.approx(late, abs=1e-4)
    assert number.std >= 0.002 / np.sqrt(12.0)
    assert found.identified["inductance"].value == pytest.approx(1e-3, rel=0.1)
    errors = {each.name: each.rmse_after / each.noise_floor for each in found.channels}
    assert errors["motor.0.current"] < 1.2


def test_a_number_at_its_bound_is_not_given_as_measured() -> None:
    place = AxisName(None, "the axis")
    judged = judge_axis(axis_log(bench(4, seconds=2.0), 0), None)
    assert "inductance" in _diagnosis(judged, place, 0.0).identified
    ends = np.where(
        [each.name == "inductance" for each in judged.final_fit.parameters], -20.0, judged.final_fit.u
    )
    found = _diagnosis(replace(judged, final_fit=replace(judged.final_fit, u=ends)), place, 0.0)
    assert "inductance" not in found.identified
    (note,) = found.notes
    assert note.startswith("inductance ends at 2")
    assert "H, the smallest that is tried" in note


def test_a_dead_current_is_a_sensor_fault_and_its_motor_is_judged_in_volts() -> None:
    columns = pair(7, (0.008, 0.008))
    columns["motor.1.current"] = np.zeros(len(columns["t"]))
    found = diagnose_recording(columns, ROBOT)
    assert [(each.channel, each.fault) for each in found.sensor_faults] == [("motor.1.current", "dead")]
    friction = next(each for each in found.causes if each.name == "friction.coulomb@right")
    assert friction.parameters["torque"].unit == "V"
    reasons = {each.id: each.reason for each in found.rejected}
    assert reasons["battery.internal_resistance"] == "not identifiable: motor.1.current is missing"


def test_a_current_of_something_else_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motors, "diagnose_axis", not_asked)
    columns = pair(9, (0.008, 0.0))
    columns["motor.0.current"] = np.random.default_rng(1).standard_normal(len(columns["t"]))
    found = diagnose_motors(columns, ROBOT)
    assert [each.fault for each in found.sensor_faults] == ["implausible"]


@pytest.mark.parametrize("as_commanded", [True, False], ids=["of the driver", "of the motion"])
def test_swapped_wires_are_said_and_taken_away(as_commanded: bool) -> None:
    columns = motor(11, 0.008, backwards=True)
    if as_commanded:  # which is what a driver measures
        columns["motor.0.current"] = -columns["motor.0.current"]
    found = diagnose_recording(columns, ROBOT)
    assert any("wires are swapped" in each for each in found.notes)
    assert [each.id for each in found.causes] == ["friction.coulomb"]
    assert found.sensor_faults == ()
    assert found.identified["resistance"].value == pytest.approx(4.0, rel=0.03)
    assert found.identified["back_emf"].value == pytest.approx(0.09, rel=0.02)


def test_a_battery_that_never_changes_tells_nothing_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """What rounding left of 8.1 V was an error of 0, and a division by it."""
    columns = pair(5, (0.008, 0.0))
    power = columns["motor.0.voltage"] * columns["motor.0.current"]
    for volts in np.arange(60, 130) / 10.0:
        assert judge_supply(columns["t"], np.full(len(power), volts), power) is None
    columns["battery.voltage"][:] = 11.5
    monkeypatch.setattr(motors, "diagnose_axis", not_asked)
    reasons = {each.id: each.reason for each in diagnose_motors(columns, ROBOT).rejected}
    assert reasons["battery.internal_resistance"].startswith("not visible: battery.voltage, or what")


def test_a_battery_of_0_volts_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motors, "diagnose_axis", not_asked)
    columns = pair(5, (0.008, 0.0))
    columns["battery.voltage"][100:110] = 0.0
    found = diagnose_motors(columns, ROBOT)
    (resistance,) = (each for each in found.causes if each.id == "battery.internal_resistance")
    assert resistance.parameters["resistance"].value == pytest.approx(0.1, rel=0.1)
    (fault,) = found.sensor_faults
    assert "battery.voltage is 0 V in 0.833 % of its samples, which no battery has" in fault.text
    columns["battery.voltage"][:] = 0.0
    reasons = {each.id: each.reason for each in diagnose_motors(columns, ROBOT).rejected}
    assert reasons["battery.internal_resistance"] == "not identifiable: battery.voltage is missing"


def test_a_stiff_battery_gets_no_resistance() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 1.0, 0.001)
    found = judge_supply(time, 11.5 + 0.01 * rng.standard_normal(1000), 5.0 * rng.random(1000))
    assert found is not None
    assert found.cause is None
    assert {each.id for each in found.rejected} >= {"battery.internal_resistance"}


def test_a_small_resistance_is_named_where_it_is_certain() -> None:
    rng = np.random.default_rng(2)
    power = 2.0 * np.abs(np.repeat(rng.standard_normal(100), 100))
    voltage = 8.0 - 0.03 * power / 8.0 + 0.01 * rng.standard_normal(len(power))
    found = judge_supply(0.002 * np.arange(len(power), dtype=np.float64), voltage, power)
    assert found is not None
    assert found.cause is not None
    assert found.channel.rmse_after > 0.9 * found.channel.rmse_before
    assert [each.id for each in found.rejected] == ["battery.*"]  # a program that reads it knows that name
    assert found.rejected[0].reason.startswith("a second, slower branch (RC) saves 0 %")
    assert found.resistance.value == pytest.approx(0.03, abs=4.0 * found.resistance.std)


@cache
def real(number: int) -> Diagnosis:
    """What is said of a real robot's motors."""
    path = data_path("fleet-steps") / f"robot-{number:02d}.csv"
    return diagnose_motors(load_run(path).recording.columns, ROBOT)


def test_a_speed_far_from_its_noise_is_only_partly_explained() -> None:
    found = real(3)
    speed = next(each for each in found.channels if each.name == "motor.0.speed")
    assert speed.rmse_after > 3.0 * speed.noise_floor
    assert found.verdict is Verdict.PARTLY


def test_real_motors_have_friction_and_their_battery_sags() -> None:
    # Two of the robots; `benchmarks/diagnosis_real.py` has them all, where 0.055 m/s is held.
    numbers = (3, 60)
    errors, resistances, wheels = [], [], 0
    for number in numbers:
        found = real(number)
        for side in ("left", "right"):
            wheels += any(each.id == "friction.coulomb" and each.where == side for each in found.causes)
        errors += [0.03 * each.rmse_after for each in found.channels if each.name.endswith(".speed")]
        resistances += [
            each.parameters["resistance"].value
            for each in found.causes
            if each.id == "battery.internal_resistance"
        ]
    assert wheels == 2 * len(numbers)
    assert float(np.median(errors)) <= 0.065
    assert float(np.median(resistances)) == pytest.approx(0.12, abs=0.03)


def test_a_real_dead_current_sensor_is_said() -> None:
    found = real(18)
    assert [(each.channel, each.fault) for each in found.sensor_faults] == [("motor.1.current", "dead")]
    assert not any(each.id.startswith("motor.") for each in found.causes)
