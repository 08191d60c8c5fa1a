"""The words that cross a port."""

import math
from dataclasses import FrozenInstanceError, replace
from typing import Any

import pytest

from raccoon.core.readings import SIMULATOR, STOP, Fault, Inputs, Outputs, quick_inputs


@pytest.mark.parametrize("duty", [1.01, -1.01, math.nan, math.inf])
def test_impossible_duty_is_refused_with_port_and_value(duty: float) -> None:
    with pytest.raises(ValueError, match=r"duty of motor 2 is .*allowed are numbers from -1 to 1"):
        Outputs(duty=(0.0, 0.0, duty, 0.0))


def test_impossible_pulse_is_refused() -> None:
    with pytest.raises(ValueError, match="pulse of servo 1 is 2500 us"):
        Outputs(servo_us=(None, 2500, None, None))


@pytest.mark.parametrize("given", [{"duty": (0.5, 0.5)}, {"brake": (True,)}, {"servo_us": (1500,) * 5}])
def test_a_command_for_fewer_or_more_ports_than_there_are_is_refused(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="there are 4 motors and 4 servos"):
        Outputs(**given)


def test_stop_is_everything_off() -> None:
    assert STOP.duty == (0.0,) * 4
    assert STOP.servo_us == (None,) * 4


def test_conversions_follow_the_device() -> None:
    inputs = Inputs(time=0.0, device=SIMULATOR, battery=748, gyro=(0, 0, 738))
    # Worked reply of the stock firmware: 748 counts are 6.629 V by the divider, 738 are 45.0 deg/s.
    assert inputs.battery_voltage == pytest.approx(6.629, abs=5e-4)
    assert inputs.turn_rate == pytest.approx(math.radians(45.0), rel=1e-9)
    assert SIMULATOR.bemf_volts * 303.4 == pytest.approx(1.0, rel=1e-4)  # V at the motor


def test_absent_readings_stay_absent() -> None:
    inputs = Inputs(time=0.0, device=SIMULATOR)
    assert inputs.battery_voltage is None
    assert inputs.turn_rate is None


def test_inputs_made_quickly_are_inputs() -> None:
    words = (1, 2, 3, 4)
    fields: dict[str, Any] = {
        "bemf": words, "position": words, "gyro": (1, 2, 3), "accel": (4, 5, 6), "analog": (7,) * 6,
        "digital": (True,) * 10, "battery": 748, "faults": (Fault.TORN,), "extra": {"button": 1.0},
    }  # fmt: skip
    made, usual = quick_inputs(0.5, SIMULATOR, **fields), Inputs(0.5, SIMULATOR, **fields)
    assert type(made) is Inputs
    assert made == usual
    assert replace(made, battery=None) == replace(usual, battery=None)
    with pytest.raises(FrozenInstanceError):
        made.battery = 5  # type: ignore[misc]
