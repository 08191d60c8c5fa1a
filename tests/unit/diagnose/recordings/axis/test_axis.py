from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.axis import model as axis_model
from raccoon.diagnose.recordings.axis.diagnosis import AxisName, diagnose_axis
from raccoon.diagnose.recordings.axis.fit import cut_stretches, stretch_duration
from raccoon.diagnose.recordings.axis.log import axis_log, holdout_start, with_channels_of
from raccoon.diagnose.recordings.axis.model import NEUTRAL_VALUES, Stretches, simulate
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.trace.loading import load_run
from shared_data import data_path
from unit.diagnose.axes import Axis, Columns, carriage

HERE = AxisName(None, "the axis")


def named(columns: Columns) -> Diagnosis:
    return diagnose_axis(columns, 0, HERE)


def test_a_sound_carriage_has_no_cause() -> None:
    found = named(carriage(Axis(), 1))
    assert found.causes == ()
    assert found.verdict is Verdict.ADEQUATE
    assert found.identified["inertia"].value == pytest.approx(40.0, rel=0.02)
    assert found.identified["coulomb"].value == pytest.approx(12.0, rel=0.05)


@pytest.mark.parametrize(
    ("axis", "cause", "number", "value"),
    [
        (Axis(viscous_asymmetry=-0.2), "friction.direction_dependent", "viscous_asymmetry", -0.2),
        (Axis(late=0.03), "actuation.latency", "seconds", 0.03),
        (Axis(load=0.15), "friction.load_dependent", "coefficient", 0.15),
    ],
)
def test_a_hidden_cause_is_named_alone_with_its_size(
    axis: Axis, cause: str, number: str, value: float, tmp_path: Path
) -> None:
    found = named(carriage(axis, 5, seconds=6.0))
    assert [each.id for each in found.causes] == [cause]
    assert found.causes[0].parameters[number].value == pytest.approx(value, rel=0.12)
    assert found.causes[0].gain.heldout_rmse_after < 0.9 * found.causes[0].gain.heldout_rmse_before
    assert found.verdict is Verdict.EXPLAINED
    found.save_json(tmp_path / "out.json")
    read = json.loads((tmp_path / "out.json").read_text())
    assert list(read)[:7] == [
        "verdict", "channels", "causes", "rejected", "unexplained", "suggested_manoeuvres", "seconds",
    ]  # fmt: skip
    assert read["identified"]["inertia"]["unit"] == "kg"


def test_a_torque_and_a_voltage_without_current_are_axes_too() -> None:
    columns = carriage(Axis(), 3, seconds=3.0)
    turned = {
        "t": columns["t"],
        "motor.2.torque": columns["motor.0.force"],
        "motor.2.angle": columns["motor.0.travel"],
    }
    found = diagnose_recording(turned, RobotConfig())
    assert found.identified["inertia"].unit == "kg m2"
    volts = {
        "t": columns["t"],
        "motor.2.voltage": columns["motor.0.force"],
        "motor.2.angle": columns["motor.0.travel"],
    }
    found = diagnose_recording(volts, RobotConfig())
    assert [each.id for each in found.causes] == ["friction.coulomb"]
    assert found.causes[0].parameters["torque"].unit == "V"
    assert any("motor.2.current is missing" in each for each in found.notes)


def test_with_and_without_numba_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    effort = 3.0 * np.sin(0.05 * np.arange(300)) + 1.0
    parts = Stretches(
        np.array([0, 150], np.intp),
        75,
        2,
        np.zeros(2),
        np.array([0.0, 2.0]),
        np.zeros((75, 2)),
        None,
        np.ones((75, 2)),
    )
    numbers = {name: np.full(3, value) for name, value in NEUTRAL_VALUES.items()}
    numbers |= {
        "inductance": np.array([0.0, 1e-3, 2e-3]), "inertia": rng.uniform(0.01, 0.1, 3),
        "stiction": np.array([0.0, 0.1, 0.0]), "latency": np.array([0.0, 0.0123, 0.03]),
        "viscous": np.full(3, 0.1), "coulomb": np.full(3, 0.3),
        "deadband": np.array([0.0, 0.0, 0.2]), "dead_below": np.array([0.0, 0.5, 0.0]),
        "full": np.array([1e9, 1e9, 6.0]), "load": np.full(3, 0.05), "asymmetry": np.full(3, 0.2),
        "quadratic": np.array([0.0, 0.01, 0.0]), "viscous_asymmetry": np.full(3, -0.1),
        "offset": np.full(3, 0.1),
    }  # fmt: skip
    for electrical in (False, True):
        fast = simulate(numbers, effort, 0.004, parts, electrical)
        with monkeypatch.context() as patch:
            patch.setattr(axis_model, "_compiled_kernel", lambda: None)
            slow = simulate(numbers, effort, 0.004, parts, electrical)
        for one, other in zip(fast, slow, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_stretches_are_round_and_the_held_back_part_begins_at_a_step() -> None:
    assert stretch_duration(0.51) == pytest.approx(1.0)
    assert stretch_duration(0.04) == pytest.approx(0.1)
    assert holdout_start(np.repeat([2.0, 4.0, -4.0, 0.0], [200, 151, 151, 158])) == 351
    assert holdout_start(np.sin(np.arange(1000.0))) == 700


def test_a_speed_of_minutes_has_a_part_to_be_judged_on() -> None:
    """Its runs have 60 s, and the last 30 % of 100 s hold none of them."""
    parts = (slice(None, 7000), slice(7000, None))
    columns = {"t": 0.01 * np.arange(10000.0), "motor.0.speed": np.ones(10000)}
    columns["motor.0.voltage"] = np.repeat(np.random.default_rng(0).choice([-2.0, 2.0], 200), 50)
    log = axis_log(columns, 0)
    for part, seconds in zip(parts, (60.0, 30.0), strict=True):
        flags = np.zeros(10000, bool)
        flags[part] = True
        found = cut_stretches(log, 0.05, flags.__getitem__, 1)
        assert found is not None
        assert found.weight.all()
        assert found.count * found.every * log.step == pytest.approx(seconds, abs=0.05)


def test_what_cannot_be_used_is_said() -> None:
    good = carriage(Axis(), 3, seconds=3.0)
    with pytest.raises(TraceError, match=r"motor\.0\.force is 5 N all the time"):
        axis_log({**good, "motor.0.force": np.full(len(good["t"]), 5.0)}, 0)
    with pytest.raises(TraceError, match="at least 100"):
        axis_log({name: each[:20] for name, each in good.items()}, 0)
    with pytest.raises(TraceError, match="does not advance"):
        axis_log({**good, "t": good["t"][::-1].copy()}, 0)
    with pytest.raises(TraceError, match="gap"):
        axis_log({**good, "t": good["t"] + np.where(good["t"] > 1.0, 5.0, 0.0)}, 0)
    with pytest.raises(TraceError, match="nothing moves"):
        named({**good, "motor.0.travel": np.zeros(len(good["t"]))})
    with pytest.raises(TraceError, match="too short"):
        named({name: each[:130] for name, each in good.items()})


def test_a_full_command_is_the_same_in_a_recording_of_small_ones() -> None:
    """A dead band that leaves 11 of 12 V left 5 of 6 V of the other recording, and did not help there."""
    time = 0.01 * np.arange(400.0)
    pulses = np.where(time % 1.0 < 0.5, 12.0, 0.0)
    large: Columns = {"t": time, "motor.0.voltage": pulses, "motor.0.speed": 0.5 * pulses}
    small = large | {"motor.0.voltage": 0.5 * pulses}
    log, other = axis_log(large, 0), axis_log(small, 0)
    assert with_channels_of(log, other).full_effort == 12.0
    assert with_channels_of(other, log).full_effort == 6.0
    battery = axis_log(small | {"battery.voltage": np.full(400, 11.0)}, 0)
    assert with_channels_of(log, battery).full_effort == 11.0


def test_a_real_axis_with_a_worn_screw() -> None:
    """Published: viscous friction 166.7 N s/m forwards, 240.4 backwards, so an asymmetry of -0.181."""
    folder = data_path("emps")
    train, pulses = (
        load_run(folder / f"{name}.mat").recording.columns for name in ("DATA_EMPS", "DATA_EMPS_PULSES")
    )
    found = diagnose_recording(train, RobotConfig(), holdout=pulses)
    assert [each.name for each in found.causes] == ["friction.direction_dependent"]
    assert -0.21 <= found.causes[0].parameters["viscous_asymmetry"].value <= -0.17
    assert found.channels[0].rmse_after <= 1.40e-3
    assert found.channels[0].rmse_before > 1.9e-3
    # The pulses shake a flexibility that no candidate has: that is said as well.
    assert found.verdict is Verdict.PARTLY
    assert found.unexplained.depends_on
