"""Identifying wheels, and noticing the ones that are not as they should be, on motors stepped here."""

import math
from dataclasses import replace

import numpy as np
import pytest

from raccoon.control.feedforward import WheelModel
from raccoon.control.voltage_fit import RecursiveFit, Windows, fit_voltages
from raccoon.control.wheel_watch import WheelState, WheelWatch, describe_oddities

NOMINAL = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)


def motion(motor: WheelModel, seconds: float, seed: int = 0) -> list[tuple[float, float]]:
    """(voltage, speed) a cycle of 5 ms of a motor that is driven up and down, always forwards."""
    random = np.random.default_rng(seed)
    speed, rows = 1.0, []
    for cycle in range(int(seconds / 0.005)):
        voltage = 3.5 + 2.0 * math.copysign(1.0, math.sin(cycle * 0.005 * 8.0))
        for _ in range(5):
            torque = motor.back_emf_constant * (voltage - motor.back_emf_constant * speed) / motor.resistance
            speed += 1e-3 / motor.inertia * (torque - motor.viscous * speed - motor.coulomb)
        rows.append((voltage, speed + 0.02 * random.standard_normal()))
    return rows


def watched(motor: WheelModel) -> WheelState:
    watch = WheelWatch(NOMINAL)
    for voltage, speed in motion(motor, 6.0):
        watch.update(voltage, speed, 0.005)
    return watch.state


def test_the_voltages_of_a_motor_are_found() -> None:
    windows, rows = Windows(), []
    for voltage, speed in motion(NOMINAL, 6.0):
        row = windows.add(voltage, speed, 0.005)
        if row is not None:
            rows.append(row)
    found = fit_voltages(rows)
    assert found.static == pytest.approx(NOMINAL.static_voltage, abs=0.05)
    assert found.speed == pytest.approx(1.0 / NOMINAL.gain, rel=0.02)
    assert found.acceleration == pytest.approx(NOMINAL.acceleration_voltage, rel=0.06)
    assert found.speed_std < 0.02
    # In units of which a reading has 10 and 1000 times as many, two of the three are so much smaller.
    other = fit_voltages(
        [((sign, 10.0 * speed, 1e3 * change), volts) for (sign, speed, change), volts in rows]
    )
    assert (other.static, other.static_std) == pytest.approx((found.static, found.static_std))
    assert (10.0 * other.speed, 10.0 * other.speed_std) == pytest.approx((found.speed, found.speed_std))
    assert 1e3 * other.acceleration_std == pytest.approx(found.acceleration_std)


def pushing(volts: float) -> WheelWatch:
    """A wheel at 3 rad/s that took `volts` more than it should for four windows."""
    watch = WheelWatch(NOMINAL)
    for _ in range(41):
        watch.update(NOMINAL.voltage(3.0) + volts, 3.0, 0.005)
    return watch


def learnt(watch: WheelWatch) -> bool:
    """Whether anything was, once the motor is off."""
    watch.stop_learning()
    return (watch.state.speed_factor, watch.state.load_factor) != (1.0, 1.0)


def test_what_was_seen_last_is_not_learnt_of_a_wheel_that_pushed_then() -> None:
    assert learnt(pushing(1.0))
    doubted = pushing(1.0)
    doubted.drop_recent()
    assert not learnt(doubted)


def test_a_wheel_of_which_somebody_knows_that_it_is_held_teaches_nothing() -> None:
    held = WheelWatch(NOMINAL)
    held.held = True
    for _ in range(200):
        held.update(NOMINAL.voltage(3.0) + 1.0, 3.0, 0.005)
    assert not learnt(held)


def test_the_windows_before_and_after_a_wheel_is_held_are_not_learnt() -> None:
    """It was braked in them, or its reading was not yet its speed."""
    watches = WheelWatch(NOMINAL), WheelWatch(NOMINAL)
    for watch in watches:
        for _ in range(13):
            watch.update(NOMINAL.voltage(3.0) + 1.0, 3.0, 0.005)
    free, held = watches
    for _ in range(20):
        held.update(4.0, 0.0, 0.005)
    assert learnt(free)
    for _ in range(19):  # released: for 0.1 s the reading follows its filter
        held.update(NOMINAL.voltage(3.0) + 1.0, 3.0, 0.005)
    assert not learnt(held)
    for _ in range(13):
        held.update(NOMINAL.voltage(3.0) + 1.0, 3.0, 0.005)
    assert learnt(held)


@pytest.mark.parametrize(("memory", "doubt"), [(120.0, 0.0), (120.0, 0.3), (30.0, 0.0)])
def test_a_fit_that_forgets_is_as_sure_as_what_it_remembers(memory: float, doubt: float) -> None:
    """Of three numbers seen in turn, a third of the rows tells of each: sigma sqrt(3 / memory)."""
    fit = RecursiveFit((0.0, 0.0, 0.0), (1e3, 1e3, 1e3), noise=0.1, memory=memory)
    for number in range(int(12 * memory)):
        row = (float(number % 3 == 0), float(number % 3 == 1), float(number % 3 == 2))
        fit.add(row, 2.0, doubt)
    for index in range(3):
        assert fit.values[index] == pytest.approx(2.0)
        assert fit.std(index) == pytest.approx(math.hypot(0.1, doubt) * math.sqrt(3.0 / memory), rel=0.06)


def test_what_is_forgotten_is_known_as_well_as_before_any_data_and_no_worse() -> None:
    """Of rows that tell the first two numbers only together; the covariance stays one."""
    spread = (1.0, 2.0, 3.0)
    fit = RecursiveFit((0.0, 0.0, 0.0), spread, noise=0.1, memory=5.0)
    for _ in range(200):
        fit.add((1.0, 0.5, 0.0), 1.0)
        covariance = np.array(fit.covariance)
        assert (np.diag(covariance) <= np.square(spread) * (1.0 + 1e-9)).all()
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
        assert np.linalg.eigvalsh(covariance).min() > -1e-9
    assert fit.std(2) == pytest.approx(3.0)


def test_what_the_rows_do_not_tell_stays_within_what_was_known_of_it() -> None:
    """Of a wheel at one speed for five minutes. The noise of each row used to move the rest a step further,
    up to a motor that turns against its voltage."""
    prior, noise = (0.3, 1.09, 0.033), np.random.default_rng(1)
    fit = RecursiveFit(prior, (0.34, 0.33, 0.027), noise=0.06, memory=120.0)
    for _ in range(6000):
        row = (1.0, 0.58, 2.0 * float(noise.standard_normal()))
        fit.add(row, float(np.dot(row, prior)) + 0.06 * noise.standard_normal())
        assert all(abs(fit.values[i] - prior[i]) < 4.0 * fit.std(i) for i in range(3))
        assert 0.25 < fit.std(1) < 0.3301


@pytest.mark.parametrize(
    ("motor", "speed"),
    [(WheelModel(1.8, 0.3, 0.18, 0.004, 0.02), 4.3), (WheelModel(4.5, 0.5, 0.01, 0.004, 0.021), 0.8)],
)
def test_a_motor_geared_up_whose_speed_is_read_coarsely_is_not_odd(motor: WheelModel, speed: float) -> None:
    """Its windows differ mostly by the noise of their ends, which the loop answers with volts."""
    watch, off, noise = WheelWatch(motor), 0.0, np.random.default_rng(1)
    for _ in range(200 * 5):
        off += 0.2 * (0.036 / motor.back_emf_constant * noise.standard_normal() - off)  # 0.012 V of it
        watch.update(motor.voltage(speed) - 4.0 * off, speed + off, 0.005)
        assert describe_oddities(watch.state, watch.state) == ("", "")
    assert watch.state.speed_factor == pytest.approx(1.0, abs=0.25)


def test_late_readings_of_wheels_that_speed_up_at_once_make_no_robot_heavy() -> None:
    """Its time constant is 5 ms: what is read 10 ms late takes three times the voltage to speed up."""
    motor = WheelModel(1.8, 2.0, 0.1, 0.004, 0.011)
    watch, speed = WheelWatch(motor), 2.0
    for cycle in range(200 * 6):
        change = 6.0 if cycle % 200 < 100 else -6.0
        speed += 0.005 * change
        watch.update(motor.voltage(speed, change), speed - 0.010 * change, 0.005)
    assert watch.state.load_factor > 2.5
    assert describe_oddities(watch.state, watch.state) == ("", "")


def test_data_that_cannot_tell_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 6 are needed"):
        fit_voltages([((1.0, 2.0, 0.0), 3.0)] * 3)
    with pytest.raises(ValueError, match="too much alike"):
        fit_voltages([((1.0, 2.0, 0.0), 3.0)] * 20)


def test_a_nominal_motor_is_not_odd() -> None:
    state = watched(NOMINAL)
    assert describe_oddities(state, state) == ("", "")
    assert state.speed_factor == pytest.approx(1.0, abs=0.05)


def test_half_as_much_resistance_again_is_odd() -> None:
    state = watched(WheelModel(2.7, 1.08, 0.18, 0.004, 0.02))
    assert state.load_factor == pytest.approx(1.5, abs=0.15)
    left, right = describe_oddities(state, watched(NOMINAL))
    assert "of the other wheel under load" in left
    assert right == ""
    assert describe_oddities(watched(NOMINAL), state) == (right, left)


def test_a_weak_magnet_is_odd() -> None:
    state = watched(WheelModel(1.8, 0.54, 0.18, 0.004, 0.02))
    assert "K_E" in state.odd_speed
    assert describe_oddities(watched(NOMINAL), state) == ("", state.odd_speed)
    assert describe_oddities(state, watched(NOMINAL)) == (state.odd_speed, "")
    assert state.speed_factor == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("factor", [-14.39, -0.5])
def test_a_wheel_that_turns_against_its_voltage_takes_no_negative_times_of_it(factor: float) -> None:
    state = replace(watched(NOMINAL), speed_factor=factor)
    assert state.odd_speed.startswith("turns against its voltage")
    assert "act so late that it oscillates" in state.odd_speed  # 30 ms do, and no sign is wrong then
    assert "times" not in state.odd_speed


def late(state: WheelState, by: float) -> WheelState:
    """What the watch makes of the same wheel where readings come so late, s."""
    return replace(state, load_factor=state.load_factor + by / NOMINAL.gain / NOMINAL.acceleration_voltage)


def test_late_readings_make_no_motor_odd() -> None:
    state = watched(NOMINAL)
    assert describe_oddities(late(state, 0.010), late(state, 0.012)) == ("", "")


def test_a_robot_of_more_than_twice_its_weight_is_odd_on_both_sides() -> None:
    state = late(watched(WheelModel(1.8, 1.08, 0.18, 0.004, 0.05)), 0.005)  # speeds are smoothed
    left, right = describe_oddities(state, state)
    assert left == right
    assert "weight, inertia_straight" in left


def test_too_little_to_go_by_is_no_verdict() -> None:
    state = replace(watched(WheelModel(2.7, 0.54, 0.18, 0.004, 0.02)), known=False)
    assert describe_oddities(state, state) == ("", "")
    heavy = replace(state, speed_factor=1.0)
    assert (
        describe_oddities(heavy, watched(NOMINAL)) == describe_oddities(watched(NOMINAL), heavy) == ("", "")
    )


@pytest.mark.parametrize("speed", [0.01, None])
def test_a_driven_wheel_that_stands_or_is_mute_is_stalled_and_forgets_at_rest(speed: float | None) -> None:
    watch = WheelWatch(NOMINAL)
    for _ in range(100):
        watch.update(3.0, speed, 0.005)
    assert watch.stalled
    watch.stop_learning()
    assert not watch.stalled


def test_a_wheel_that_reads_all_the_time_that_it_turns_against_its_voltage_is_stalled() -> None:
    """Its reading is frozen: it would be driven the faster the longer it lasts."""
    watch, told = WheelWatch(NOMINAL), []
    for voltage in (*(-3.0,) * 100, 3.0):
        watch.update(voltage, 4.0, 0.005)
        told.append(watch.stalled)
    assert not any(told[:60])  # as long as a robot takes that is braked from full speed
    assert told[99:] == [True, False]


@pytest.mark.parametrize("volts", [1.5, -6.0])
def test_a_wheel_far_below_the_speed_of_its_voltage_is_stalled(volts: float) -> None:
    """A tenth of it is a stall. Less than half, as with a heavy load, is none."""
    nominal = math.copysign(NOMINAL.top_speed(abs(volts)), volts)
    for share, stalled in ((0.1, True), (0.4, False)):
        watch = WheelWatch(NOMINAL)
        for _ in range(75):
            watch.update(volts, share * nominal, 0.005)
        assert watch.stalled is stalled


def test_too_little_voltage_to_move_is_no_stall() -> None:
    watch = WheelWatch(NOMINAL)
    for _ in range(1000):
        watch.update(NOMINAL.static_voltage + 0.3, 0.0, 0.005)
    assert not watch.stalled


def test_a_load_that_is_hardly_known_is_not_odd() -> None:
    """At one speed for a minute the fit forgets what an acceleration took."""
    unsure = WheelState(True, 1.0, 0.01, 0.24, 0.54)
    assert describe_oddities(unsure, unsure) == ("", "")
    sure = WheelState(True, 1.0, 0.01, 0.24, 0.03)
    assert all("times the voltage for its load" in each for each in describe_oddities(sure, sure))
    nominal = WheelState(True, 1.0, 0.01, 1.0, 0.02)
    for std, is_odd in ((0.15, False), (0.02, True)):  # within three deviations of the other, and far beyond
        light = WheelState(True, 1.0, 0.01, 0.6, std)
        told = describe_oddities(light, nominal), describe_oddities(nominal, light)
        assert told[0][0] == told[1][1] == ""
        assert ("1.67 times" in told[0][1]) is ("1.67 times" in told[1][0]) is is_odd


def test_a_load_below_nothing_is_no_comparison() -> None:
    nominal, driven = WheelState(True, 1.0, 0.01, 1.0, 0.02), WheelState(True, 1.0, 0.01, -0.2, 0.02)
    assert describe_oddities(nominal, driven) == describe_oddities(driven, nominal) == ("", "")


@pytest.mark.parametrize(
    ("factor", "std", "is_odd"), [(1.3, 0.1, False), (1.3, 0.06, True), (1.2, 0.01, False)]
)
def test_a_speed_is_odd_only_beyond_its_deviation(factor: float, std: float, is_odd: bool) -> None:
    assert bool(WheelState(True, factor, std, 1.0, 0.02).odd_speed) is is_odd
