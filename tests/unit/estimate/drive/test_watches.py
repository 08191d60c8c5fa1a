"""What watches the drive and the battery, one by one: bumps, a gyro of another full scale, the voltage."""

import math

import pytest

from raccoon.core.readings import GRAVITY
from raccoon.estimate.battery.voltage import BatteryVoltage
from raccoon.estimate.drive.bump import BumpWatch
from raccoon.estimate.drive.turn_share import TurnShare

LEAN = 1.5
"""m/s2 forwards that the accelerometer of a robot on the floor reads: its controller leans by 9 degrees."""
PITCH_BIAS = 0.6
"""rad/s that the gyro reads about the axis of a robot that stands."""


@pytest.mark.parametrize("pitch_rate", [2.0, -2.0])
def test_a_robot_that_pitches_at_the_end_of_a_ramp_was_not_bumped(pitch_rate: float) -> None:
    """As its nose comes down the floor holds up less of its weight: that much less is felt ahead. Nor was one
    that stops there for a moment and drives on."""
    watch, lean = BumpWatch(), 0.0
    for _ in range(25):
        assert not watch.update(0.02, LEAN, 0.0, still=True, sample_period=0.005, pitch_rate=PITCH_BIAS)
    for _ in range(50):
        assert not watch.update(0.02, LEAN, 0.0, still=False, sample_period=0.005, pitch_rate=PITCH_BIAS)
    for _ in range(8):
        lean -= GRAVITY * pitch_rate * 0.02
        assert not watch.update(
            0.02, LEAN + lean, 0.0, still=False, sample_period=0.005, pitch_rate=pitch_rate + PITCH_BIAS
        )
    for still in (True,) * 5 + (False,) * 20:
        assert not watch.update(0.02, LEAN + lean, 0.0, still, sample_period=0.005, pitch_rate=PITCH_BIAS)
    assert watch.update(
        0.02, LEAN + lean - 12.0, 0.0, still=False, sample_period=0.005, pitch_rate=PITCH_BIAS
    )


def test_a_gyro_of_another_full_scale_is_found_and_slip_is_none() -> None:
    half, slips = TurnShare(), TurnShare()
    for step in range(400):
        wheels = 1.5 * math.copysign(1.0, math.sin(0.1 * step))
        half.update(0.02, wheels, 0.5 * wheels)
        slips.update(0.02, wheels, wheels if step % 2 else 0.0)  # half of it, but not always
        assert step > 90 or half.value == 1.0  # not sure before 3 rad
    assert half.value == pytest.approx(0.5)
    assert slips.value == 1.0


def test_a_voltage_follows_a_load_with_its_time_constant() -> None:
    battery = BatteryVoltage()
    battery.update(0.0, 7.0)
    for cycle in range(1, 101):
        battery.update(0.001 * cycle, 6.0)
    assert battery.voltage == pytest.approx(6.0 + math.exp(-1.0), abs=0.003)


def test_a_voltage_after_a_pause_is_the_new_one_and_before_a_reading_there_is_none() -> None:
    battery = BatteryVoltage()
    battery.update(0.0, None)
    assert battery.voltage is None
    for time, volts in ((0.1, 7.0), (5.1, 6.0)):
        battery.update(time, volts)
        assert battery.voltage == volts
