"""The gains give the margins they promise."""

import math

import pytest

from raccoon.control.feedforward import WheelModel, wheel_models
from raccoon.control.pid import Pid, PidGains
from raccoon.control.tuning import SlowCycleGains, margins, speed_loop_gains
from raccoon.core.config import RobotConfig
from raccoon.model.paper import MOTORS

LAG, DEAD_TIME = 0.0225, 0.0075


@pytest.mark.parametrize("wanted_deg", [45.0, 55.0, 65.0, 75.0])
def test_the_phase_margin_is_the_wanted_one(wanted_deg: float) -> None:
    wheel = wheel_models(RobotConfig())[0]
    gains = speed_loop_gains(wheel, LAG, DEAD_TIME, math.radians(wanted_deg))
    assert math.degrees(margins(gains, wheel, LAG, DEAD_TIME).phase) == pytest.approx(wanted_deg, abs=0.5)


@pytest.mark.parametrize("motor", range(3))
def test_the_papers_motors_keep_their_margins_with_nominal_gains(motor: int) -> None:
    nominal = wheel_models(RobotConfig())[0]
    gains = speed_loop_gains(nominal, LAG, DEAD_TIME)
    real = MOTORS[motor]
    wheel = WheelModel(
        real.armature_resistance, real.back_emf_constant, real.friction_torque, 0.004, nominal.inertia
    )
    found = margins(gains, wheel, LAG, DEAD_TIME)
    assert found.gain_db >= 6.0
    assert math.degrees(found.phase) >= 45.0


def test_margins_of_a_loop_known_in_closed_form() -> None:
    # A pure integrator k/s with dead time T: crossover k, phase margin 90 deg - k T, gain margin pi/(2 k T).
    wheel = WheelModel(resistance=1.0, back_emf_constant=1.0, coulomb=0.0, viscous=0.0, inertia=1e-9)
    found = margins(PidGains(kp=0.0, ki=10.0), wheel, 0.0, 0.02)
    assert found.crossover == pytest.approx(10.0, rel=5e-3)
    assert found.phase == pytest.approx(math.pi / 2 - 0.2, abs=5e-3)
    assert found.gain == pytest.approx(math.pi / (2 * 10.0 * 0.02), rel=1e-2)


def test_a_filtered_derivative_leads_by_what_its_filter_leaves() -> None:
    # Behind lags T1 and T2, kd s / (tau s + 1) of a gain k crosses 1 twice; the second time far above all of
    # them, where k kd / (T1 T2 tau) = w^2 and each lag has taken 90 deg of what s gave.
    wheel = WheelModel(resistance=1.0, back_emf_constant=1.0, coulomb=0.0, viscous=0.0, inertia=0.1)
    gains = PidGains(kp=0.0, kd=100.0, derivative_time_constant=0.2)
    found = margins(gains, wheel, 0.1, 0.0)
    assert found.crossover == pytest.approx(math.sqrt(100.0 / (0.1 * 0.1 * 0.2)), rel=5e-3)
    assert found.phase == pytest.approx(0.0, abs=0.15)


def test_the_delay_that_a_loop_bears_takes_all_of_its_phase() -> None:
    wheel = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)
    gains = speed_loop_gains(wheel, LAG, DEAD_TIME)
    bears = margins(gains, wheel, LAG, DEAD_TIME).delay
    assert margins(gains, wheel, LAG, DEAD_TIME + bears).phase == pytest.approx(0.0, abs=0.01)
    assert margins(PidGains(kp=1e-6), wheel, LAG, DEAD_TIME).delay == math.inf  # it corrects nothing


def test_the_gain_margin_is_where_the_loop_starts_to_oscillate() -> None:
    wheel = WheelModel(1.8, 1.08, 0.0, 0.004, 0.02)
    gains = speed_loop_gains(wheel, LAG, 0.01)
    margin = margins(gains, wheel, LAG, 0.01).gain

    def swing(factor: float) -> float:
        pid = Pid(PidGains(gains.kp * factor, gains.ki * factor))
        speed = measured = 0.0
        delayed, dt, late = [0.0] * 100, 1e-4, []
        for step in range(60_000):
            delayed.append(pid.step(1.0, measured, dt, 0.0, 1e9))
            current = (delayed[-101] - 1.08 * speed) / 1.8
            speed += dt * (1.08 * current - 0.004 * speed) / 0.02
            measured += dt * (speed - measured) / LAG
            if step > 50_000:
                late.append(measured)
        return max(late) - min(late)

    assert swing(0.8 * margin) < 1e-2
    assert swing(1.2 * margin) > 1.0


@pytest.mark.parametrize("cycle", [0.01, 0.02, 0.05])
def test_a_loop_with_slow_cycles_keeps_its_margin_by_a_share_of_its_gains(cycle: float) -> None:
    wheel, lag = wheel_models(RobotConfig())[0], 0.005
    gains, slow = speed_loop_gains(wheel, lag, DEAD_TIME), SlowCycleGains(0.005, DEAD_TIME + lag)
    for _ in range(200):
        share = slow.share(cycle)
    late = DEAD_TIME + 2.0 * (cycle - SlowCycleGains.FORGIVEN * 0.005)
    kept = margins(PidGains(share * gains.kp, share * gains.ki), wheel, lag, late)
    assert math.degrees(kept.phase) == pytest.approx(65.0, abs=2.0)


def test_cycles_in_time_and_one_that_is_a_little_late_cost_nothing() -> None:
    slow = SlowCycleGains(0.005, 0.0125)
    assert [slow.share(dt) for dt in (0.005, 0.005, 0.01, 0.005)] == [1.0] * 4
    assert slow.share(0.0) == 1.0
