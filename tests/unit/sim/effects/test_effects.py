"""What each effect does, against what can be worked out by hand."""

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from raccoon.core.config import MotorConfig, RobotConfig, TophatConfig
from raccoon.core.errors import ConfigError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, Outputs
from raccoon.core.schema import Measured
from raccoon.model.motor import steady_speed
from raccoon.sim.effects.catalogue import CATALOGUE
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import MIN_CREEP
from raccoon.sim.plant.equations import rolled
from raccoon.sim.plant.friction import let_go
from raccoon.sim.plant.series import lagging
from raccoon.sim.port import SimPort
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import Rollout, rollout
from raccoon.sim.world.table import Box, Light, Line, World

TIME = np.arange(601) * 0.005
ONES = np.ones_like(TIME)
MODEL = RobotConfig().model
R, K = MODEL.left.armature_resistance.value, MODEL.left.back_emf_constant.value
COULOMB, VISCOUS = MODEL.friction.coulomb.value, MODEL.friction.viscous.value
VOLTAGE = MODEL.battery.open_circuit_voltage.value
Floats = NDArray[np.float64]


def with_effect(id: str, where: str | None = None, **values: float) -> Parameters:  # noqa: A002
    """A robot on a stiff battery with one effect."""
    stiff = Parameters.from_robot(RobotConfig()).with_effect("battery.internal_resistance", resistance=0.0)
    return stiff.with_effect(id, where, **values)


def run(robot: Parameters, left: Floats | float, right: Floats | float, **initial: float) -> Rollout:
    commands = Commands.of_wheels(TIME, left * ONES, right * ONES)
    return rollout(robot, commands, initial=initial, longest_step=0.001)


def end(robot: Parameters, duty: float, channel: str = "motor.0.speed") -> float:
    return float(run(robot, duty, duty)[channel][0, -1])


def test_a_discharging_battery_loses_voltage_by_the_charge_drawn() -> None:
    ended = run(with_effect("battery.discharge", volts_per_coulomb=0.01), 0.8, 0.8)
    drawn = 0.8 * 2 * np.sum(ended["motor.0.current"][0, 1:] * np.diff(TIME))
    assert ended["battery.voltage"][0, -1] == pytest.approx(VOLTAGE - 0.01 * drawn, abs=1e-3)


@pytest.mark.parametrize("pauses", [0.0, 0.24])
def test_a_stalled_winding_heats_up_with_its_time_constant(pauses: float) -> None:
    """And by the current that flows in it, which a mean over pauses for samples is less than."""
    robot = with_effect("motor.heating", gain=0.1, time_constant=1.0).with_effect(
        "friction.coulomb", torque=5.0
    )
    driven = 1.0 - pauses
    current = run(robot.with_chain(Chain(coast_share=pauses)), 0.5, 0.5)["motor.0.current"][0]
    cold = 0.5 * VOLTAGE / R
    assert current[1] == pytest.approx(driven * cold, rel=2e-2)
    # h' = (driven I^2 - h) / tau and I = I0 / (1 + gain h): stepped finely by hand.
    heat, step = 0.0, 1e-4
    for _ in range(round(TIME[-1] / step)):
        heat += step * (driven * (cold / (1.0 + 0.1 * heat)) ** 2 - heat)
    assert current[-1] == pytest.approx(driven * cold / (1.0 + 0.1 * heat), rel=1e-3)


def test_a_current_limit_holds_the_current() -> None:
    current = run(with_effect("motor.current_limit", limit=1.2), 1.0, 1.0)["motor.0.current"][0]
    assert np.max(current) == pytest.approx(1.2)
    assert np.max(run(with_effect("motor.current_limit"), 1.0, 1.0)["motor.0.current"][0]) > 2.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_that_depends_on_direction(sign: float) -> None:
    robot = with_effect("friction.direction_dependent", asymmetry=0.3, viscous_asymmetry=0.5)
    expected = steady_speed(
        sign * 0.6 * VOLTAGE, R, K, COULOMB * (1.0 + sign * 0.3), VISCOUS * (1.0 + sign * 0.5)
    )
    assert end(robot, sign * 0.6) == pytest.approx(expected, rel=1e-6)


def test_friction_that_depends_on_the_load() -> None:
    speed = end(with_effect("friction.load_dependent", coefficient=0.2), 0.7)
    moment = K * (0.7 * VOLTAGE - K * speed) / R
    assert moment == pytest.approx(COULOMB + VISCOUS * speed + 0.2 * moment, rel=1e-6)


def test_quadratic_drag() -> None:
    speed = end(with_effect("friction.quadratic", coefficient=0.01), 0.7)
    moment = K * (0.7 * VOLTAGE - K * speed) / R
    assert moment == pytest.approx(COULOMB + VISCOUS * speed + 0.01 * speed**2, rel=1e-6)


def test_stiction_holds_at_rest_and_vanishes_at_speed() -> None:
    robot = with_effect("friction.stiction", torque=0.1, speed=0.3)
    free = (COULOMB + 0.05) * R / (K * VOLTAGE)
    assert end(robot, free) == 0.0
    assert end(robot, (COULOMB + 0.101) * R / (K * VOLTAGE)) > 0.0
    assert end(robot, 0.8) == pytest.approx(steady_speed(0.8 * VOLTAGE, R, K, COULOMB, VISCOUS), rel=1e-6)


@pytest.mark.parametrize("break_away", [0.0, 0.7, 0.95])
def test_a_wheel_gives_before_it_slides_as_far_as_bristles_do(break_away: float) -> None:
    """Loaded slowly up to `part` of the friction, it has turned by -compliance level ln(1 - part), whatever
    the speed: compliance dT = (1 - T / level) dx. Below the part at which it breaks away it gives as a spring
    does, compliance dT = dx, and then (1 - break_away) compliance dT = (1 - T / level) dx."""
    part, compliance = 0.9, 0.001
    smoothly = 0.5 - 0.5 * np.cos(np.pi * np.minimum(TIME / 2.8, 1.0))  # no corner: it would swing on
    duty = part * COULOMB * R / (K * VOLTAGE) * smoothly
    ended = run(with_effect("friction.presliding", compliance=compliance, break_away=break_away), duty, duty)
    turned = ended["truth.x"][0, -1] / MODEL.drive.wheel_radius.value
    spring, beyond = min(part, break_away), max(part - break_away, 0.0) / (1.0 - break_away)
    parts = spring - (1.0 - break_away) * math.log(1.0 - beyond)
    assert turned == pytest.approx(compliance * COULOMB * parts, rel=3e-3)


def test_a_wheel_that_sticks_swings_on_its_bristles() -> None:
    """At sqrt(1 / (compliance J)) rad/s, with motors that coast."""
    robot = with_effect("friction.presliding", compliance=0.002, damping=0.0)
    commands = Commands.of_wheels(TIME[:101], 0.0 * TIME[:101], 0.0 * TIME[:101], brake=False)
    speed = rollout(robot, commands, initial={"speed_left": 1e-3, "speed_right": 1e-3}, longest_step=2e-4)
    crossings = np.count_nonzero(np.diff(np.sign(speed["motor.0.speed"][0])))
    swings = 0.5 / (2.0 * math.pi * math.sqrt(0.002 * MODEL.drive.inertia_straight.value))
    assert crossings == pytest.approx(2.0 * swings, abs=1.0)


@pytest.mark.parametrize("tail", [0.0, 0.4, 1.0])
def test_what_creeps_turns_as_fast_as_its_curve_bears_the_torque(tail: float) -> None:
    """U K / R = (K^2 / R + B) w + level w / let_go(w), below what dry friction would hold."""
    creep, speed = 0.1, 0.06
    level = COULOMB * speed / let_go(speed, creep, tail)
    duty = ((K**2 / R + VISCOUS) * speed + level) * R / (K * VOLTAGE)
    robot = with_effect("friction.presliding", creep=creep, creep_tail=tail)
    ended = run(robot, duty * ONES, duty * ONES)
    assert ended["motor.0.speed"][0, -1] == pytest.approx(speed, rel=1e-6)


@given(st.floats(1e-9, 50.0), st.floats(MIN_CREEP, 1.0), st.floats(0.0, 1.0))
def test_friction_that_creeps_is_a_curve_from_0_to_its_level(speed: float, creep: float, tail: float) -> None:
    assert let_go(speed, 0.0, 0.0) == speed
    share = speed / let_go(speed, creep, tail)
    assert 0.0 <= share <= 1.0 + 1e-12
    assert 1.1 * speed / let_go(1.1 * speed, creep, tail) >= share - 1e-12
    assert speed / let_go(speed, creep, 0.0) == pytest.approx(math.tanh(speed / creep), abs=0.08)
    assert speed / let_go(speed, creep, 1.0) == pytest.approx(speed / (speed + creep))


def test_the_less_it_creeps_the_more_a_robot_is_one_that_does_not() -> None:
    duty = 0.5 * np.sin(4.0 * TIME)
    commands = Commands.of_wheels(TIME, duty, 0.3 * duty)
    plain = Parameters.from_robot(RobotConfig())
    rigid, *creeping = (
        rollout(plain.with_effect("friction.presliding", creep=creep), commands, longest_step=1e-4)
        for creep in (0.0, 0.1, 0.03, 0.005)
    )
    far = [float(np.abs(each["motor.0.speed"] - rigid["motor.0.speed"]).max()) for each in creeping]
    assert all(nearer < 0.6 * farther for farther, nearer in pairwise(far))
    assert far[-1] < 0.01


def test_the_stiffer_its_bristles_the_more_a_robot_is_a_rigid_one() -> None:
    """Where it reverses, its friction turns over within a way that is as long as bristles give, and in a time
    that is about as the root of that way: so is what it differs in speed."""
    duty = np.where(TIME < 1.0, 0.6, np.where(TIME < 2.0, -0.4, 0.0))
    commands = Commands.of_wheels(TIME, duty, 0.5 * duty)
    rigid, *giving = (
        rollout(
            Parameters.from_robot(RobotConfig()).with_effect("friction.presliding", compliance=compliance),
            commands,
            longest_step=5e-5,
        )["motor.0.speed"][0]
        for compliance in (0.0, 1e-3, 1e-4, 2e-5)
    )
    far, near, nearest = (float(np.abs(each - rigid).max()) for each in giving)
    assert near < 1.5 * math.sqrt(0.1) * far
    assert nearest < 1.5 * math.sqrt(0.2) * near


@pytest.mark.parametrize("values", [{"compliance": 0.001}, {"creep": 0.05}])
def test_bristles_are_exact_to_a_thousandth_of_a_rad_per_second_and_more_with_shorter_steps(
    values: dict[str, float],
) -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.presliding", None, **values)
    duty = 0.5 * np.sin(4.0 * TIME)
    commands = Commands.of_wheels(TIME, duty, 0.3 * duty)
    fine, *coarse = (
        rollout(robot, commands, longest_step=h)["motor.0.speed"][0] for h in (2e-5, 1e-3, 5e-4, 2.5e-4)
    )
    errors = [float(np.sqrt(np.mean((each - fine) ** 2))) for each in coarse]
    assert errors[0] < 1e-3
    assert all(finer < 0.6 * coarser for coarser, finer in pairwise(errors))


def test_backlash_loses_its_angle_once_a_reversal() -> None:
    duty = np.where(TIME < 1.5, 0.6, -0.6)
    plain, loose = (run(with_effect("drive.backlash", angle=each), duty, duty) for each in (0.0, 0.1))
    radius = MODEL.drive.wheel_radius.value
    halfway, last = 300, -1
    # The play starts in its middle: half of it is lost at once, the whole of it after the reversal.
    lost = plain["truth.x"][0] - loose["truth.x"][0]
    assert lost[halfway] == pytest.approx(radius * 0.05, rel=1e-9)
    assert lost[last] == pytest.approx(-radius * 0.05, rel=1e-9)
    np.testing.assert_array_equal(plain["motor.0.bemf"], loose["motor.0.bemf"])


def test_a_wheel_between_the_teeth_rolls_on_for_its_coasting_time() -> None:
    """A motor that brakes by a rad/s2 leaves its wheel once that slows down less than it, at a * coasting;
    from there the wheel rolls a * coasting^2 more, until the motor comes back through the gap. What it
    slipped while it sped up, it gives back."""
    braking, coasting, h = 50.0, 0.02, 2e-5
    speed, play, wheel, rolling, angle = 8.0, 10.0, 8.0, 8.0, 0.0  # at a tooth; the other is out of reach
    for _ in range(round(0.3 / h)):
        after = speed - braking * h
        turned, rim, play, wheel, rolling, *_ = rolled(
            speed, after, play, wheel, rolling, 10.0, coasting, 0.01, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, h, 1 / h
        )
        speed, angle = after, angle + turned
    apart = braking * coasting
    pushed = (8.0**2 - apart**2) / (2 * braking)
    assert angle == pytest.approx(pushed + apart * coasting + 0.01 * 8.0, rel=2e-3)
    assert rim == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("coasting", [0.0, 0.002, 0.01, 0.03])
def test_a_wheel_in_loose_gears_gets_as_far_at_steps_of_a_millisecond_as_at_tiny_ones(
    coasting: float,
) -> None:
    """Motors that go to and fro part from a tooth and reach the next one within a step. The error is of
    second order: 0.2 % of the gap at most, where ending each play with its step made 3 %."""

    def ways(h: float) -> Floats:
        speeds = 8.0 * np.tanh(4.0 * np.sin(2.0 * np.pi * np.arange(round(1.3 / h) + 1) * h / 0.41))
        play, wheel, rolling, way = 0.04, 0.0, 0.0, [0.0]
        for before, after in pairwise(speeds.tolist()):
            turned, _, play, wheel, rolling, *_ = rolled(
                before,
                after,
                play,
                wheel,
                rolling,
                0.04,
                coasting,
                0.0,
                0.0,
                1.0,
                0.0,
                1.0,
                0.0,
                0.0,
                h,
                1 / h,
            )
            way.append(way[-1] + turned)
        return np.array(way)

    fine = ways(2e-5)
    errors = [np.abs(ways(h) - fine[:: round(h / 2e-5)]).max() for h in (0.001, 0.0005)]
    assert errors[0] < 0.002 * 0.08
    assert errors[1] < 0.3 * errors[0]


@given(
    lag=st.floats(0.0005, 0.2), before=st.floats(-20, 20), after=st.floats(-20, 20), start=st.floats(-20, 20)
)
def test_a_slipping_wheel_follows_as_a_lag_of_first_order_does(
    lag: float, before: float, after: float, start: float
) -> None:
    h, steps = 0.05, 400
    rolling = start
    for step in range(steps):
        here, there = (before + (after - before) * (step + each) / steps for each in (0, 1))
        rolling = lagging(rolling, here, there, lag, h / steps, steps / h)
    ramp = lag * (after - before) / h
    exact = after - ramp + (start - before + ramp) * math.exp(-h / lag)
    assert rolling == pytest.approx(exact, abs=1e-3)


def test_a_wheel_that_does_not_slip_rolls_as_it_turns() -> None:
    assert lagging(3.0, 1.0, 2.0, 0.0, 0.001, 1000.0) == 2.0


@pytest.mark.parametrize("angle", [0.0, 0.1])
def test_a_slipping_robot_never_jumps(angle: float) -> None:
    """Not where duties do, not where a tooth meets the wheel: creep pushes as hard as it is large."""
    duty = np.where(TIME < 1.5, 0.6, -0.6)
    robot = with_effect("drive.backlash", angle=angle, coasting=0.007)
    robot = robot.with_effect("drive.wheel_slip", time=0.02)
    out = run(robot, -duty, duty)
    fastest = np.abs(out["motor.1.speed"][0]).max() - out["motor.1.speed"][0].min()
    rate = fastest * 2.0 * MODEL.drive.wheel_radius.value / MODEL.drive.track_width.value
    steps = np.abs(np.diff(out["imu.gyro.z"][0]))
    assert steps.max() < rate * float(np.diff(TIME).max()) / 0.02


@pytest.mark.parametrize("latency", [0.0012, 0.0074, 0.0231])
@pytest.mark.parametrize("play", [0.0, 0.02])
def test_a_late_gyro_is_late_by_what_is_said_and_no_duller(latency: float, play: float) -> None:
    """Its reading lies between the rows of a recording, where a command changes or a tooth meets its wheel
    within a row. Any curve through the rows' ends would be wrong then: the one that also turns as far as the
    robot did, by 0.003 rad/s, and by 0.3 with play."""
    robot = with_effect("imu.latency", seconds=latency)
    robot = robot.with_effect("drive.backlash", angle=play, coasting=0.007)

    def rates(rows_each: int) -> Floats:
        time = np.arange(400 * rows_each + 1) * 0.005 / rows_each
        duty = np.where(np.floor(time / 0.235 + 1e-9) % 2.0 < 1.0, 0.7, -0.7)
        commands = Commands.of_wheels(time, -duty, duty)
        run = rollout(robot, commands, channels=["imu.gyro.z"], longest_step=0.0005)
        return run["imu.gyro.z"][0, ::rows_each]

    coarse, fine = rates(1), rates(10)
    assert np.abs(coarse - fine).max() < 1e-6


def test_a_late_gyro_is_late_by_what_is_said_where_time_stamps_jitter_and_rows_are_lost() -> None:
    time = np.arange(801) * 0.0025
    kept = np.arange(0, 801, 2) + np.random.default_rng(1).integers(-1, 2, 401) * (np.arange(401) % 7 == 3)
    kept = np.delete(kept, [100, 200, 201, 202, 300])  # rows of 2.5, 5, 7.5, 10 and 20 ms
    duty = np.where(np.arange(801) // 94 % 2 == 0, 0.7, -0.7)
    robot = with_effect("imu.latency", seconds=0.0074)

    def rates(rows: NDArray[np.int64]) -> Floats:
        held = duty[kept][np.searchsorted(kept, rows, side="right") - 1]
        commands = Commands.of_wheels(time[rows], -held, held)
        run = rollout(robot, commands, channels=["imu.gyro.z"], longest_step=0.0005)
        return np.asarray(run["imu.gyro.z"][0], float)

    error = np.abs(rates(kept) - rates(np.arange(801))[kept])
    assert np.median(error) < 1e-3
    assert error.max() < 0.1 * np.abs(rates(kept)).max()


def test_a_gyro_that_is_late_by_next_to_nothing_reads_what_one_does_that_is_not() -> None:
    """A fit came to 3e-19 s: no look then lies before the end of its row, and the last reading was none."""
    commands = Commands.of_wheels(TIME, np.full(len(TIME), -0.5), np.full(len(TIME), 0.5))
    robots = [with_effect("imu.latency", seconds=each) for each in (0.0, 2.8e-19)]
    at_once, late = (rollout(each, commands, channels=["imu.gyro.z"])["imu.gyro.z"][0] for each in robots)
    assert late == pytest.approx(at_once, abs=1e-12)


@pytest.mark.parametrize("seconds", [0.0015, 0.0039, 0.02])
@pytest.mark.parametrize("latency", [0.0, 0.0074])
def test_a_gyro_that_smooths_is_a_filter_of_first_order(seconds: float, latency: float) -> None:
    """tau y' = rate - y, exact where the rate goes straight from one of very short rows to the next."""
    fine = np.arange(20 * (len(TIME) - 1) + 1) * 0.00025
    duty = np.where(np.floor(fine / 0.235 + 1e-9) % 2.0 < 1.0, 0.7, -0.7)
    plain = with_effect("imu.latency", seconds=latency)
    rate = rollout(plain, Commands.of_wheels(fine, -duty, duty), channels=["imu.gyro.z"])["imu.gyro.z"][0]
    stays, expected = math.exp(-0.00025 / seconds), [0.0]
    for before, after in pairwise(rate):
        behind = seconds * (after - before) / 0.00025
        expected.append(after - behind + stays * (expected[-1] - before + behind))
    smooth = plain.with_effect("imu.low_pass", time_constant=seconds)
    commands = Commands.of_wheels(TIME, -duty[::20], duty[::20])
    run = rollout(smooth, commands, channels=["imu.gyro.z"], longest_step=0.00105)
    np.testing.assert_allclose(run["imu.gyro.z"][0], expected[::20], atol=0.004 * np.abs(rate).max())


def test_a_controller_by_its_own_clock_samples_half_a_cycle_before_the_row() -> None:
    """Without a filter its reading is the speed of then, of both motors whatever their ports."""
    fine = np.arange(2 * (len(TIME) - 1) + 1) * 0.0025
    duty = np.where(np.floor(fine / 0.235 + 1e-9) % 2.0 < 1.0, 0.7, -0.7)
    plain = with_effect("bemf.filter_lag", "left", time_constant=0.0)
    plain = plain.with_effect("bemf.filter_lag", "right", time_constant=0.0)
    speeds = rollout(plain, Commands.of_wheels(fine, duty, -duty), longest_step=0.00125)
    free = plain.with_chain(Chain(free_running=True))
    read = rollout(free, Commands.of_wheels(TIME, duty[::2], -duty[::2]), longest_step=0.00125)
    for port in (0, 1):
        then = speeds[f"motor.{port}.bemf"][0, 1::2]
        np.testing.assert_allclose(read[f"motor.{port}.bemf"][0, 1:], then, atol=1e-6 * np.abs(then).max())


def test_the_simulated_robot_s_gyro_is_late_in_the_same_way() -> None:
    robot = with_effect("imu.latency", seconds=0.0074).with_effect("imu.low_pass", time_constant=0.004)
    duty = np.where(np.arange(300) // 47 % 2 == 0, 0.7, -0.7)
    port, read = SimPort(robot, noise=False), []
    for each in duty:
        inputs = port.read()
        assert inputs.gyro is not None
        read.append(inputs.gyro[2] * inputs.device.gyro_rad_s)
        port.write(Outputs(duty=(-each, each, 0.0, 0.0)))
    commands = Commands.of_wheels(np.arange(300) * 0.005, -duty, duty)
    rolled_out = rollout(robot, commands, channels=["imu.gyro.z"])["imu.gyro.z"][0]
    assert np.abs(np.array(read[1:]) - rolled_out[1:]).max() < 0.004


def test_slip_that_follows_acceleration_at_once_takes_time_times_it_from_the_speed() -> None:
    """v = w - time * w'. The way that is lost is the same as with the lag: time times the speed reached."""
    duty = np.where(TIME < 0.1, 0.0, 0.8)
    plain = run(with_effect("drive.wheel_slip", time=0.0), -duty, duty)
    kicked = run(with_effect("drive.wheel_slip", time=0.02, at_once=1.0), -duty, duty)
    speed = plain["motor.1.speed"][0]
    np.testing.assert_array_equal(kicked["motor.1.speed"][0], speed)
    per_wheel = 2.0 * MODEL.drive.wheel_radius.value / MODEL.drive.track_width.value
    rolling = kicked["imu.gyro.z"][0] / per_wheel
    foretold = speed - 0.02 * np.gradient(speed, TIME)
    late = slice(30, None)  # past the kink of the start, over which a gradient says nothing
    np.testing.assert_allclose(rolling[late], foretold[late], atol=0.01 * speed.max())
    lost = (plain["truth.heading"][0] - kicked["truth.heading"][0])[-1] / per_wheel
    assert lost == pytest.approx(0.02 * speed[-1], rel=1e-3)


def test_slip_costs_time_times_the_speed_reached() -> None:
    plain, slipping = (run(with_effect("drive.wheel_slip", time=each), 0.6, 0.6) for each in (0.0, 0.02))
    lost = plain["truth.x"][0, -1] - slipping["truth.x"][0, -1]
    assert lost == pytest.approx(MODEL.drive.wheel_radius.value * 0.02 * plain["motor.0.speed"][0, -1])


def test_scrub_slows_turning_but_not_driving_straight() -> None:
    robot = with_effect("drive.turn_scrub", torque=0.05)
    expected = steady_speed(0.6 * VOLTAGE, R, K, COULOMB + 0.05, VISCOUS)
    assert run(robot, -0.6, 0.6)["motor.1.speed"][0, -1] == pytest.approx(expected, rel=1e-6)
    straight = steady_speed(0.6 * VOLTAGE, R, K, COULOMB, VISCOUS)
    assert end(robot, 0.6) == pytest.approx(straight, rel=1e-9)


def test_scrub_is_the_same_forward_and_back_where_one_wheel_rests() -> None:
    robot = with_effect("drive.turn_scrub", torque=0.05)
    duty = np.where(TIME % 0.5 < 0.3, 0.5, 0.0)
    ahead, back = (run(robot, 0.0, way * duty)["motor.1.speed"][0] for way in (1.0, -1.0))
    np.testing.assert_array_equal(ahead, -back)


def test_a_slope_pulls_along_its_direction() -> None:
    uphill = with_effect("drive.slope", along_x=-0.05)
    assert end(uphill, 0.6) == pytest.approx(steady_speed(0.6 * VOLTAGE, R, K, COULOMB + 0.05, VISCOUS))
    sideways = with_effect("drive.slope", along_y=-0.05)
    assert end(sideways, 0.6) == pytest.approx(steady_speed(0.6 * VOLTAGE, R, K, COULOMB, VISCOUS))
    turned = run(sideways, 0.6, 0.6, heading=math.pi / 2)["motor.0.speed"][0, -1]
    assert turned == pytest.approx(end(uphill, 0.6))


def test_a_wheel_that_runs_out_of_round_sways_the_heading_once_a_turn() -> None:
    robot = with_effect("drive.wheel_eccentricity", "left", amplitude=0.05, phase=0.7)
    heading = run(robot, 0.8, 0.8)["truth.heading"][0]
    turned = np.cumsum(run(robot, 0.8, 0.8)["motor.0.speed"][0]) * 0.005
    radius, track = MODEL.drive.wheel_radius.value, MODEL.drive.track_width.value
    expected = radius / track * 0.05 * (np.cos(turned + 0.7) - math.cos(0.7))
    np.testing.assert_allclose(heading, expected, atol=2e-4)


@pytest.mark.parametrize(
    ("name", "channel", "ratio"),
    [("drive.track_width", "truth.heading", 1 / 1.1), ("drive.wheel_radius", "truth.heading", 1.1)],
)
def test_geometry(name: str, channel: str, ratio: float) -> None:
    plain, changed = (run(with_effect(name, factor=each), -0.5, 0.5)[channel][0, -1] for each in (1.0, 1.1))
    assert changed / plain == pytest.approx(ratio, rel=1e-9)


def test_more_inertia_slows_the_rise_alone() -> None:
    light, heavy = (
        run(with_effect("drive.inertia", factor=each), 0.6, 0.6)["motor.0.speed"][0] for each in (1.0, 2.0)
    )
    assert light[-1] == pytest.approx(heavy[-1], rel=1e-9)
    np.testing.assert_allclose(heavy[2:201:2], light[1:101], rtol=5e-3)


def test_a_deadband_swallows_small_duties_and_leaves_full_ones() -> None:
    robot = with_effect("actuation.deadband", duty=0.2)
    assert end(robot, 0.19) == 0.0
    assert end(robot, 1.0) == pytest.approx(steady_speed(VOLTAGE, R, K, COULOMB, VISCOUS))
    assert end(robot, 0.6) == pytest.approx(steady_speed(0.5 * VOLTAGE, R, K, COULOMB, VISCOUS))


def test_readings_are_scaled_shifted_and_cut_off() -> None:
    speed = end(with_effect("bemf.scale", factor=1.0), 0.6)
    counts = K * speed / BEMF_VOLTS_PER_COUNT
    assert end(with_effect("bemf.scale", factor=1.1), 0.6, "motor.0.bemf") == pytest.approx(1.1 * counts)
    assert end(with_effect("bemf.offset", counts=31.5), 0.6, "motor.0.bemf") == pytest.approx(counts + 31.5)
    assert end(with_effect("bemf.offset", counts=20.0), 0.0, "motor.0.bemf") == 20.0
    both = with_effect("bemf.offset", counts=20.0).with_effect("bemf.dead_zone", counts=25.0)
    assert end(both, 0.0, "motor.0.bemf") == 0.0
    assert end(both, 0.6, "motor.0.bemf") == pytest.approx(counts + 20.0)


def test_an_offset_is_the_board_s_whatever_the_wiring() -> None:
    robot = RobotConfig(motors={0: MotorConfig(inverted=True, bemf_offset=Measured(31.5))})
    standing = rollout(Parameters.from_robot(robot), Commands.of_wheels(TIME, 0.0 * ONES, 0.0 * ONES))
    assert standing["motor.0.bemf"][0, -1] == 31.5
    assert standing["motor.1.bemf"][0, -1] == 0.0


def test_a_slower_filter_lags_by_its_time_constant() -> None:
    # On a ramp, the lag of a filter that is stepped every dt is dt (1 - a) / a with a = 1 - exp(-dt / tau).
    plain, slow = (with_effect("bemf.filter_lag", time_constant=each) for each in (0.0, 0.05))
    ramp = np.clip(TIME / 2.0, 0.0, 1.0)
    share = 1.0 - math.exp(-0.005 / 0.05)
    lag = 0.005 * (1.0 - share) / share
    prompt, late = (run(each, ramp, ramp)["motor.0.bemf"][0] for each in (plain, slow))
    np.testing.assert_allclose(late[300:380], np.interp(TIME[300:380] - lag, TIME, prompt), rtol=1e-3)


def test_the_firmware_s_median_forgets_a_spike() -> None:
    spike = Noise(bemf=0.0, gyro=0.0, gyro_bias=0.0, accel=0.0, battery=0.0, analog=0.0)
    robot = Parameters.from_robot(RobotConfig()).with_chain(Chain.firmware())
    port = SimPort(robot, World.empty(), noise=spike)
    port.write(Outputs(duty=(0.6, 0.6, 0.0, 0.0)))
    steady = [port.read() for _ in range(300)][-1]
    # 10 % of coasting weakens the motor like a winding of R / 0.9; the battery sags by both currents.
    counts = float(steady.bemf[0] or 0)
    weak = steady_speed(0.6 * (steady.battery_voltage or 0.0), R / 0.9, K, COULOMB, VISCOUS)
    assert counts == pytest.approx(K * weak / BEMF_VOLTS_PER_COUNT, rel=5e-3)


def black_under_front(**effects: Mapping[str, float]) -> float:
    """Counts of a tophat that stands over black."""
    robot = RobotConfig(tophats={"front": TophatConfig(analog=2, forward=0.1)})
    parameters = Parameters.from_robot(robot)
    for name, values in effects.items():
        parameters = parameters.with_effect(name.replace("__", "."), "2", **values)
    world = World(lines=(Line(((0.1, -1.0), (0.1, 1.0))),))
    inputs = SimPort(parameters, world, noise=False).read()
    assert inputs.truth is not None
    assert inputs.truth.surface[2] is True
    return float(inputs.analog[2] or 0)


def test_tophats_read_the_paper_s_values() -> None:
    assert black_under_front() == pytest.approx(3800, abs=2)
    assert black_under_front(tophat__height={"height": 0.023}) == pytest.approx(4030, abs=2)
    assert black_under_front(tophat__gain={"factor": 0.5}) == pytest.approx(1900, abs=1)
    assert black_under_front(tophat__ambient_light={"offset": -500.0}) == pytest.approx(3300, abs=2)


def test_a_tophat_under_the_sun_of_a_table() -> None:
    robot = RobotConfig(tophats={"front": TophatConfig(analog=2, forward=0.1)})
    sun = Light(Box((0.0, -1.0), (1.0, 1.0)), ambient=1.0)
    inputs = SimPort(Parameters.from_robot(robot), World(lights=(sun,)), noise=False).read()
    assert inputs.analog[2] == pytest.approx(140, abs=2)


def test_every_effect_names_units_bounds_and_a_size() -> None:
    for entry in CATALOGUE.values():
        assert entry.sentence.endswith(".")
        assert entry.parameters
        for each in entry.parameters:
            assert each.prior_width > 0.0
            for value in (each.neutral, each.initial):
                assert value is None or each.bounds.allows(value)


@pytest.mark.parametrize(
    ("id", "where", "values", "message"),
    [
        ("motor.magic", None, {}, "no such id"),
        ("motor.heating", "front", {"gain": 1.0}, "where is 'front': allowed are left, right, 0, 1"),
        ("battery.discharge", "left", {}, "belongs to the whole robot"),
        ("battery.internal_resistance", None, {"resistance": -1.0}, r"resistance is -1 ohm: allowed are"),
        ("friction.coulomb", None, {"torque": math.nan}, "torque is nan N m"),
        ("drive.track_width", None, {"factor": 0.0}, "factor is 0"),
        ("drive.inertia", None, {"mass": 2.0}, "no parameter mass; allowed are factor"),
    ],
)
def test_impossible_effects_are_named(
    id: str,  # noqa: A002
    where: str | None,
    values: dict[str, float],
    message: str,
) -> None:
    with pytest.raises(ConfigError, match=message):
        Parameters.from_robot(RobotConfig()).with_effect(id, where, **values)


def test_a_side_can_be_named_by_its_motor_port() -> None:
    robot = Parameters.from_robot(RobotConfig())
    assert robot.with_effect("drive.backlash", "1", angle=0.1) == robot.with_effect(
        "drive.backlash", "right", angle=0.1
    )


def test_an_effect_everywhere_replaces_what_was_said_for_one_side() -> None:
    robot = with_effect("drive.backlash", "left", angle=0.1).with_effect("drive.backlash", angle=0.2)
    assert robot.value("drive.backlash", "angle", "left") == 0.2
    one = robot.with_effect("drive.backlash", "left", angle=0.3)
    assert (one.value("drive.backlash", "angle", "left"), one.value("drive.backlash", "angle", "right")) == (
        0.3,
        0.2,
    )
    assert effect("drive.backlash").group == "drive"
