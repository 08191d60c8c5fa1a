"""The PID loop on plants whose answer is known."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.control.pid import Pid, PidGains


def test_proportional_part_alone() -> None:
    assert Pid(PidGains(kp=2.0)).step(3.0, 1.0, 0.01, 0.5, 10.0) == 4.5


def test_integral_is_the_sum_of_the_error_over_time() -> None:
    pid = Pid(PidGains(kp=0.0, ki=3.0))
    for _ in range(100):
        output = pid.step(1.0, 0.5, 0.01, 0.0, 10.0)
    assert output == pytest.approx(3.0 * 0.5 * 1.0)


def test_derivative_acts_on_the_measurement_only() -> None:
    pid = Pid(PidGains(kp=0.0, kd=1.0, derivative_time_constant=0.0))
    pid.step(0.0, 0.0, 0.01, 0.0, 100.0)
    assert pid.step(50.0, 0.0, 0.01, 0.0, 100.0) == 0.0  # a step of the setpoint does not kick
    assert pid.step(50.0, 0.2, 0.01, 0.0, 100.0) == pytest.approx(-20.0)


def test_the_derivative_of_a_ramp_is_its_slope_behind_a_filter_of_the_first_order() -> None:
    pid, slope, tau, dt = Pid(PidGains(kp=0.0, kd=2.0, derivative_time_constant=0.1)), 3.0, 0.1, 1e-3
    for cycle in range(1, 301):
        output = pid.step(0.0, 5.0 + slope * cycle * dt, dt, 0.0, 100.0)
        assert output == pytest.approx(-2.0 * slope * (1.0 - math.exp(-(cycle - 1) * dt / tau)), abs=0.02)


def test_a_reset_loop_is_a_new_one() -> None:
    gains = PidGains(kp=1.0, ki=20.0, kd=0.5)
    used, fresh = Pid(gains), Pid(gains)
    for measurement in (0.0, 3.0, 7.0):
        used.step(9.0, measurement, 0.005, 0.0, 1.0)
    used.reset()
    assert (used.saturated, used.integral) == (fresh.saturated, fresh.integral) == (0, 0.0)
    for measurement in (1.0, 1.2):
        assert used.step(2.0, measurement, 0.005, 0.0, 10.0) == fresh.step(2.0, measurement, 0.005, 0.0, 10.0)


def test_nothing_integrates_against_a_limit_and_all_of_it_away_from_there() -> None:
    pid = Pid(PidGains(kp=1.0, ki=0.1))
    for error in (9.0, -9.0):
        pid.step(error, 0.0, 0.005, 0.0, 1.0)
        assert pid.integral == 0.0
    pid.reset(5.0)
    pid.step(-1.0, 0.0, 0.005, 0.0, 1.0)  # still above the limit, but on its way back
    assert pid.saturated == 1
    assert pid.integral == pytest.approx(5.0 - 0.1 * 0.005)


def test_closed_loop_settles_without_error_on_a_motor_with_load() -> None:
    pid, speed = Pid(PidGains(kp=0.5, ki=10.0)), 0.0
    for _ in range(2000):
        voltage = pid.step(4.0, speed, 0.005, 0.0, 7.0)
        speed += 0.005 * (voltage / 1.08 - 0.3 - speed) / 0.03
    assert speed == pytest.approx(4.0, abs=1e-6)


def test_recovers_at_once_from_long_saturation() -> None:
    pid = Pid(PidGains(kp=1.0, ki=5.0))
    for _ in range(10_000):
        pid.step(100.0, 0.0, 0.005, 0.0, 6.0)  # 50 s against the stop
    assert pid.saturated == 1
    assert pid.step(0.0, 1.0, 0.005, 0.0, 6.0) < 0.5  # a wound-up integral would still push


def test_a_repeated_reading_changes_nothing() -> None:
    pid = Pid(PidGains(kp=1.0, ki=1.0, kd=1.0))
    first = pid.step(1.0, 0.0, 0.005, 0.0, 10.0)
    assert pid.step(1.0, 0.0, 0.0, 0.0, 10.0) == first


@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=200),
    st.floats(0.0, 20.0),
    st.floats(0.0, 200.0),
    st.floats(0.1, 12.0),
)
def test_never_winds_up_and_never_leaves_its_limits(
    steps: list[tuple[float, float]], kp: float, ki: float, limit: float
) -> None:
    pid = Pid(PidGains(kp=kp, ki=ki))
    largest = max(abs(setpoint - measurement) for setpoint, measurement in steps)
    for setpoint, measurement in steps:
        output = pid.step(setpoint, measurement, 0.005, 0.0, limit)
        assert abs(output) <= limit
        # What the integral can hold is what keeps the sum at the limit, plus one increment.
        assert abs(pid.integral) <= limit + (kp + 0.005 * ki) * largest + 1e-9


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["kp", "ki", "kd", "derivative_time_constant"])
def test_impossible_gains_are_refused(name: str, bad: float) -> None:
    with pytest.raises(ValueError, match=f"{name} is .*allowed are numbers from 0"):
        PidGains(**{"kp": 1.0, name: bad})
