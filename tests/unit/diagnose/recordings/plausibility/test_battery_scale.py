"""A battery that is read too high is one fault."""

from __future__ import annotations

import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.plausibility.battery_scale import SEE_BATTERY, explain_by_battery_scale
from raccoon.diagnose.reports.cause_text import describe_cause
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import ChannelResult, Diagnosis, ParameterResult

ROBOT = RobotConfig()
FULL = ROBOT.model.battery.open_circuit_voltage.value


def three(voltage: float, scale: float, gyro: float = 0.962, channel: str = "battery.voltage") -> Diagnosis:
    causes = (
        make_cause("battery.open_circuit_voltage", {"voltage": ParameterResult(voltage, 0.005, "", FULL)}),
        make_cause("bemf.scale", factor_parameters(scale, 0.002), rank=2),
        make_cause("imu.gyro_scale", factor_parameters(gyro, 0.008), rank=3),
    )
    seen = (ChannelResult(channel, "V", 0.1, 0.004, 0.004, 0.5),)
    return make_diagnosis(*causes, channels=seen)


def test_three_names_of_one_fault_are_one_sentence() -> None:
    found = explain_by_battery_scale(three(7.01, 0.9645), ROBOT)
    first, second, third = found.causes
    assert first.explanation.startswith(
        "The battery's reading is 3.7 +- 0.2 % too high, which alone explains battery.open_circuit_voltage, "
        "bemf.scale and imu.gyro_scale: compare it with a multimeter"
    )
    assert (
        "KIPR's library assumes 0.009175 V a count, the controller's divider gives 0.008862."
        in first.explanation
    )
    assert describe_cause(first).todo == ""  # not to put a voltage into robot.toml that is none
    assert second.explanation.endswith(SEE_BATTERY)
    assert third.explanation.endswith(SEE_BATTERY)
    assert "1. The battery's reading is 3.7" in terminal_report(found)


def test_what_goes_the_other_way_is_too_low() -> None:
    (first, *_) = explain_by_battery_scale(three(FULL / 1.1, 1.1, gyro=1.0), ROBOT).causes
    assert (
        "9.1 +- 0.2 % too low, which alone explains battery.open_circuit_voltage and bemf.scale:"
        in first.explanation
    )
    assert "KIPR" not in first.explanation


@pytest.mark.parametrize(
    "other",
    [
        three(7.01, 1.036),  # a full battery, and a reading that is too large
        three(7.01, 0.90),
        three(6.83, 0.996),  # next to nothing
        three(7.01, 0.9645, channel="motor.0.bemf"),  # no reading of the battery
    ],
)
def test_what_is_not_of_one_size_is_not_one_fault(other: Diagnosis) -> None:
    assert explain_by_battery_scale(other, ROBOT) is other
