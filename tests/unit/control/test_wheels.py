"""The two wheels together, on simulated motors written here."""

import math

import pytest

from raccoon.control.feedforward import WheelModel
from raccoon.control.tuning import speed_loop_gains
from raccoon.control.wheels import REST, WheelLoop, WheelTarget
from raccoon.model.paper import MOTORS

NOMINAL = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)


def make_loop() -> WheelLoop:
    return WheelLoop(NOMINAL, NOMINAL, speed_loop_gains(NOMINAL, 0.0225, 0.0075), 0.0225, 6.8)


class Motor:
    """A motor with Coulomb friction and the controller's speed filter, stepped at 1 kHz."""

    def __init__(self, resistance: float, constant: float, coulomb: float) -> None:
        self.resistance, self.constant, self.coulomb = resistance, constant, coulomb
        self.speed = self.measured = 0.0

    def advance(self, voltage: float) -> None:
        for _ in range(5):
            drive = self.constant * (voltage - self.constant * self.speed) / self.resistance
            drive -= 0.004 * self.speed
            if self.speed == 0.0 and abs(drive) <= self.coulomb:
                continue
            change = 1e-3 / 0.02 * (drive - math.copysign(self.coulomb, self.speed or drive))
            self.speed = 0.0 if self.speed * (self.speed + change) < 0.0 else self.speed + change
            self.measured += 1e-3 / 0.0225 * (self.speed - self.measured)


def drive(left: Motor, right: Motor, battery: float, target: WheelTarget, seconds: float) -> list[float]:
    loop, history = make_loop(), []
    for _ in range(int(seconds / 0.005)):
        duties = loop.step(target, left.measured, right.measured, 0.005, battery)
        left.advance(duties[0] * battery)
        right.advance(duties[1] * battery)
        history.append(left.speed)
    return history


@pytest.mark.parametrize("battery", [5.8, 6.1, 6.6, 7.2])
def test_unequal_motors_turn_alike_on_every_battery(battery: float) -> None:
    left, right = (
        Motor(MOTORS[i].armature_resistance, MOTORS[i].back_emf_constant, MOTORS[i].friction_torque)
        for i in (0, 2)
    )
    history = drive(left, right, battery, WheelTarget(4.0, 4.0), 2.0)
    assert left.speed == pytest.approx(4.0, abs=0.01)
    assert right.speed == pytest.approx(4.0, abs=0.01)
    assert max(history) < 4.0 * 1.08


def test_a_nominal_motor_follows_a_step_without_overshoot() -> None:
    history = drive(Motor(1.8, 1.08, 0.18), Motor(1.8, 1.08, 0.18), 6.8, WheelTarget(4.0, 4.0), 1.0)
    assert max(history) < 4.0 * 1.05
    settled = next(i for i, speed in enumerate(history) if abs(speed - 4.0) < 0.2)
    assert settled * 0.005 <= 3 * NOMINAL.time_constant + 0.01


def test_saturation_keeps_the_ratio_and_says_what_is_missing() -> None:
    for wanted in (WheelTarget(12.0, 6.0), WheelTarget(-6.0, -12.0)):
        loop, left, right = make_loop(), Motor(1.8, 1.08, 0.18), Motor(1.8, 1.08, 0.18)
        for _ in range(200):
            duties = loop.step(wanted, left.measured, right.measured, 0.005, 6.1)
            left.advance(duties[0] * 6.1)
            right.advance(duties[1] * 6.1)
        assert left.speed / right.speed == pytest.approx(wanted.left / wanted.right, rel=0.01)
        assert loop.saturated
        assert loop.missing_speed == pytest.approx(12.0 - NOMINAL.top_speed(6.1))


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_what_is_a_little_too_fast_is_missing_as_well(share: float) -> None:
    loop, top = make_loop(), NOMINAL.top_speed(6.1)
    loop.step(WheelTarget(-share * top, 0.5), -share * top, 0.5, 0.005, 6.1)
    assert loop.saturated is (share > 1.0)
    assert loop.missing_speed == pytest.approx(max(0.0, share - 1.0) * top)


def test_a_wheel_that_friction_holds_where_it_is_to_stand_is_not_stalled() -> None:
    """It is corrected by a hair while the other one turns, as in a pivot, and takes 1.2 V to break loose."""
    loop, other = make_loop(), Motor(1.8, 1.08, 0.18)
    for _ in range(400):
        duties = loop.step(WheelTarget(0.1, 4.0), 0.0, other.measured, 0.005, 6.8)
        other.advance(duties[1] * 6.8)
        assert loop.standing == ("left",)
        assert loop.stalled == ()
    assert duties[0] * 6.8 > 1.2
    for _ in range(100):
        loop.step(WheelTarget(1.0, 4.0), 0.0, 4.0, 0.005, 6.8)
    assert loop.standing == ()
    assert loop.stalled == ("left",)
    for target, stands in ((WheelTarget(-4.0, 0.1), "right"), (WheelTarget(0.1, -4.0), "left")):
        backwards = make_loop()
        backwards.step(target, target.left, target.right, 0.005, 6.8)
        assert backwards.standing == (stands,)


@pytest.mark.parametrize(("left", "right"), [(12.0, -12.0), (-12.0, -12.0)])
def test_wheels_that_do_not_turn_are_stalled_until_they_rest(left: float, right: float) -> None:
    loop, told = make_loop(), []
    for wanted in (*[WheelTarget(left, right)] * 100, REST):
        loop.step(wanted, 0.0, 0.0, 0.005, 6.8)
        assert loop.standing == ()
        told.append((loop.stalled, loop.saturated, loop.missing_speed > 0.0))
    assert told[-2:] == [(("left", "right"), True, True), ((), False, False)]


def known_after(loop: WheelLoop, target: WheelTarget, seconds: float = 2.0) -> tuple[bool, bool]:
    """What the loop knows of its motors after it has driven like that, with wheels that follow."""
    for _ in range(round(seconds / 0.005)):
        loop.step(target, target.left, target.right, 0.005, 6.8)
    left, right = loop.states
    return left.known, right.known


def test_wheels_tell_of_their_motors_once_they_drive_straight_on() -> None:
    loop, turn, straight = make_loop(), WheelTarget(3.0, 4.0), WheelTarget(4.0, 4.0)
    assert known_after(loop, turn) == (False, False)
    assert known_after(loop, straight, 0.3) == (False, False)
    assert known_after(loop, straight) == (True, True)


def test_wheels_that_push_tell_nothing_until_they_have_rested() -> None:
    loop, straight = make_loop(), WheelTarget(4.0, 4.0)
    nominal = [each.speed_factor for each in loop.states]
    for _ in range(50):  # it has pushed for 0.25 s before that is known
        loop.step(straight, 3.0, 3.0, 0.005, 6.8)
    loop.hold()
    assert known_after(loop, straight) == (False, False)
    known_after(loop, REST, 0.005)
    assert [each.speed_factor for each in loop.states] == nominal
    assert known_after(loop, straight) == (True, True)


def test_rest_is_no_power_and_forgets() -> None:
    loop = make_loop()
    for _ in range(100):
        loop.step(WheelTarget(3.0, 3.0), 0.0, 0.0, 0.005, 6.6)
    assert loop.step(REST, 1.0, -1.0, 0.005, 6.6) == (0.0, 0.0)
    first = loop.step(WheelTarget(3.0, 3.0), 0.0, 0.0, 0.0, 6.6)
    assert first == make_loop().step(WheelTarget(3.0, 3.0), 0.0, 0.0, 0.0, 6.6)


def test_a_missing_speed_leaves_the_feedforward() -> None:
    duties = make_loop().step(WheelTarget(3.0, 3.0), None, None, 0.005, 6.0)
    assert duties[0] == pytest.approx(NOMINAL.voltage(3.0) / 6.0)


def test_a_speed_that_goes_missing_leaves_what_was_learnt_as_well() -> None:
    loop = make_loop()
    for _ in range(100):
        loop.step(WheelTarget(3.0, 3.0), 2.9, 2.9, 0.005, 6.8)
    kept = loop.step(WheelTarget(3.0, 3.0), None, None, 0.005, 6.8)[0]
    assert kept > NOMINAL.voltage(3.0) / 6.8 + 0.01


def test_a_nominal_motor_that_speeds_up_needs_nothing_but_its_feedforward() -> None:
    loop, acceleration = make_loop(), 8.0
    speed = reading = 0.0
    lag, smooth = (math.exp(-0.005 / each) for each in (NOMINAL.time_constant, 0.0225))
    for cycle in range(60):
        target = acceleration * cycle * 0.005
        wanted = WheelTarget(target, target, acceleration, acceleration)
        duty = loop.step(wanted, reading, reading, 0.005, 6.8)[0]
        assert 6.8 * duty == pytest.approx(NOMINAL.voltage(target, acceleration), abs=1e-9)
        settles = NOMINAL.gain * (6.8 * duty - NOMINAL.static_voltage)
        before, speed = speed, settles + lag * (speed - settles)
        reading += (1.0 - smooth) * (0.5 * (before + speed) - reading)


def test_an_absurd_battery_reading_is_not_used() -> None:
    expected = NOMINAL.voltage(3.0) / 6.8
    for reading in (None, 0.0, 0.5):
        assert make_loop().step(WheelTarget(3.0, 3.0), None, None, 0.005, reading)[0] == pytest.approx(
            expected
        )


def test_after_a_pause_it_starts_from_what_the_wheels_do_and_knows_what_it_learnt() -> None:
    loop = make_loop()
    strong, weak = Motor(1.8, 1.08, 0.18), Motor(2.7, 1.08, 0.30)
    wanted = WheelTarget(4.0, 4.0)
    for _ in range(200):
        duties = loop.step(wanted, strong.measured, weak.measured, 0.005, 6.8)
        strong.advance(duties[0] * 6.8)
        weak.advance(duties[1] * 6.8)
    loop.resume()
    left, right = loop.step(wanted, 0.0, 0.0, 0.005, 6.8)
    assert left == pytest.approx(NOMINAL.voltage(4.0, 0.0) / 6.8, abs=0.02)  # no error is made up for
    assert right == pytest.approx(duties[1], abs=0.02)  # what the weaker motor needs beyond it is still known
