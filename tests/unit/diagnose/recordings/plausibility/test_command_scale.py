"""Commands in another scale than -1 to 1 are one fault."""

from __future__ import annotations

import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.plausibility.command_scale import explain_by_command_scale
from raccoon.diagnose.result import CauseResult, ParameterResult

ROBOT = RobotConfig()


def told(*causes: CauseResult) -> list[str]:
    return [each.explanation for each in explain_by_command_scale(make_diagnosis(*causes), ROBOT).causes]


# What a sound robot was found to have whose full power was 100 of 127 in the recording.
SCALE = make_cause("bemf.scale", factor_parameters(1.27, 0.007))
TRACK = make_cause("drive.track_width", factor_parameters(0.788, 0.005))
FRICTION = make_cause("friction.coulomb", {"torque": ParameterResult(0.1416, 0.0039, "N m", 0.18)})
BATTERY = make_cause(
    "battery.internal_resistance", {"resistance": ParameterResult(0.081, 0.011, "ohm", 0.05)}
)


def test_four_names_of_one_scale_are_one_sentence() -> None:
    first, *others = told(SCALE, TRACK, FRICTION, BATTERY)
    assert first.startswith(
        "The commands motor.0.duty and motor.1.duty are 21.3 +- 0.4 % too small, which alone explains "
        "bemf.scale, drive.track_width, friction.coulomb and battery.internal_resistance: before"
    )
    for each, said in zip((TRACK, FRICTION, BATTERY), others, strict=True):
        assert said.startswith(each.explanation)
        assert said.endswith("see bemf.scale first.")


@pytest.mark.parametrize(
    "causes",
    [
        (SCALE, TRACK),  # by chance, or the battery's reading
        (SCALE, TRACK, make_cause(FRICTION.id, {"torque": ParameterResult(0.22, 0.004, "N m", 0.18)})),
        (make_cause("bemf.scale@left", factor_parameters(1.27, 0.007)), TRACK, FRICTION),
        (TRACK, FRICTION, BATTERY),
    ],
    ids=["one beside it", "another size", "one wheel's", "no scale"],
)
def test_other_causes_are_their_own(causes: tuple[CauseResult, ...]) -> None:
    assert told(*causes) == [each.explanation for each in causes]
