"""A cause whose number of [model] no program looks at is told with the calibration that goes before it."""

from dataclasses import replace

import pytest

from blind.generator import make
from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.diagnose.recordings import drive as drive_diagnosis
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.plausibility.overridden_model import overridden_model_notes

TICKS = Measured(0.00305, 0.00001)
ROBOT = RobotConfig(
    motors={
        0: MotorConfig(inverted=True),
        1: MotorConfig(radians_per_tick=TICKS, bemf_offset=Measured(3.0)),
        2: MotorConfig(static_voltage=Measured(0.3)),
    }
)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("motor.back_emf_constant@left", ""),
        ("motor.back_emf_constant@right", "has motor.1.radians_per_tick, which programs use instead of"),
        ("motor.back_emf_constant", "instead of model.motor.back_emf_constant: a new value there"),
        ("bemf.offset@right", "has motor.1.bemf_offset, which programs use instead of model.bemf.offset:"),
        ("friction.coulomb", ""),
        ("drive.wheel_radius@right", ""),
    ],
)
def test_only_what_is_calibrated_and_named(name: str, said: str) -> None:
    notes = overridden_model_notes([make_cause(name, said="")], ROBOT)
    assert len(notes) == bool(said)
    assert said in "".join(notes)


def test_inertia_is_that_of_driving_straight() -> None:
    robot = RobotConfig(motors={0: MotorConfig(acceleration_voltage=Measured(0.03))})
    assert (
        "instead of model.drive.inertia_straight"
        in overridden_model_notes([make_cause("drive.inertia", said="")], robot)[0]
    )


def test_a_diagnosis_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    named = make_diagnosis(make_cause("friction.coulomb", said=""))
    monkeypatch.setattr(drive_diagnosis, "diagnose", lambda *_, **__: named)
    robot = RobotConfig(motors={0: MotorConfig(static_voltage=Measured(0.3, 0.01))})
    found = diagnose_recording(dict(make(3, seconds=4.0).columns), robot)
    assert any("motor.0.static_voltage, which programs use" in note for note in found.notes)
    plain = replace(robot, motors={})
    assert not any("which programs use" in note for note in overridden_model_notes(found.causes, plain))
