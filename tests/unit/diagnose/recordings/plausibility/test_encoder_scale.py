"""An encoder with a wrong number of ticks a turn is one fault."""

from __future__ import annotations

import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.plausibility.encoder_scale import explain_by_encoder_scale
from raccoon.diagnose.result import CauseResult, ChannelResult

ROBOT = RobotConfig()


def told(*causes: CauseResult, kind: str = "speed") -> list[str]:
    seen = tuple(ChannelResult(f"motor.{port}.{kind}", "", 0.1, 0.004, 0.004, 0.5) for port in (0, 1))
    found = explain_by_encoder_scale(make_diagnosis(*causes, channels=seen), ROBOT)
    return [each.explanation for each in found.causes]


CONSTANT = make_cause("motor.back_emf_constant@left", factor_parameters(0.944, 0.002))
RADIUS = make_cause("drive.wheel_radius@left", factor_parameters(0.940, 0.006))


def test_two_names_of_one_encoder_are_one_sentence() -> None:
    first, second = told(CONSTANT, RADIUS)
    assert first.startswith(
        "motor.0.speed reads 5.9 +- 0.2 % too much, which alone explains motor.back_emf_constant@left and "
        "drive.wheel_radius@left: check the encoder's ticks per turn"
    )
    assert second.startswith(RADIUS.explanation)
    assert second.endswith("see motor.back_emf_constant@left first.")


@pytest.mark.parametrize("twin", [("imu.gyro_scale", 0.94), ("drive.track_width", 1.064)])
def test_both_encoders_show_in_what_compares_wheels_and_gyro(twin: tuple[str, float]) -> None:
    first, _ = told(
        make_cause(CONSTANT.id, factor_parameters(0.94, 0.003)),
        make_cause(twin[0], factor_parameters(twin[1], 0.006)),
    )
    assert first.startswith("motor.0.speed and motor.1.speed read 6.4")


@pytest.mark.parametrize(
    "other",
    [
        make_cause("drive.wheel_radius@right", factor_parameters(0.944, 0.006)),
        make_cause("drive.wheel_radius@left", factor_parameters(0.98, 0.006)),
        make_cause("drive.track_width", factor_parameters(1.06, 0.006)),
    ],
)
def test_causes_of_another_place_or_size_are_their_own(other: CauseResult) -> None:
    assert told(CONSTANT, other) == [CONSTANT.explanation, other.explanation]


def test_back_emf_has_no_ticks() -> None:
    assert told(CONSTANT, RADIUS, kind="bemf") == [CONSTANT.explanation, RADIUS.explanation]
