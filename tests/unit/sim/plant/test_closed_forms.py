"""The plant against what can be worked out with pencil and paper."""

import math
from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.core.schema import Measured
from raccoon.model.motor import steady_speed
from raccoon.model.paper import MOTORS
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import Rollout, rollout

TIME = np.arange(1001) * 0.002
ONES = np.ones_like(TIME)
MODEL = RobotConfig().model
R, K = MODEL.left.armature_resistance.value, MODEL.left.back_emf_constant.value
COULOMB, VISCOUS = MODEL.friction.coulomb.value, MODEL.friction.viscous.value
VOLTAGE = MODEL.battery.open_circuit_voltage.value


def stiff() -> Parameters:
    return Parameters.from_robot(RobotConfig()).with_effect("battery.internal_resistance", resistance=0.0)


def time_constant(inertia: float) -> float:
    """s in which the speed covers 63 % of a step."""
    return inertia / (K * K / R + VISCOUS)


def run(robot: Parameters, left: float, right: float, brake: bool = True, **initial: float) -> Rollout:
    commands = Commands.of_wheels(TIME, left * ONES, right * ONES, brake)
    return rollout(robot, commands, initial=initial, longest_step=0.0005)


@pytest.mark.parametrize("duty", [1.0, 0.5, -0.7])
def test_steady_speed(duty: float) -> None:
    expected = steady_speed(duty * VOLTAGE, R, K, COULOMB, VISCOUS)
    assert run(stiff(), duty, duty)["motor.0.speed"][0, -1] == pytest.approx(expected, rel=1e-9)
    friction = math.copysign(COULOMB, expected) + VISCOUS * expected
    assert K * expected + R * friction / K == pytest.approx(duty * VOLTAGE)


def test_the_paper_s_motors_turn_as_it_measured() -> None:
    for motor in MOTORS:
        k = motor.back_emf_constant
        speed = steady_speed(6.6, motor.armature_resistance, k, k * motor.current)
        assert speed == pytest.approx(motor.speed, rel=1e-3)


def test_below_its_friction_it_stays_where_it_is() -> None:
    duty = 0.99 * COULOMB * R / (K * VOLTAGE)
    assert np.all(run(stiff(), duty, duty)["motor.0.speed"] == 0.0)
    assert np.all(run(stiff(), 1.02 * duty, 1.02 * duty)["motor.0.speed"][0, 1:] > 0.0)


def test_a_stalled_motor_draws_the_stall_current_and_the_battery_sags_by_it() -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.coulomb", torque=5.0)
    sag = MODEL.battery.internal_resistance.value
    current = VOLTAGE / (R + 2 * sag)
    ended = run(robot, 1.0, 1.0)
    assert ended["motor.0.current"][0, -1] == pytest.approx(current)
    assert ended["battery.voltage"][0, -1] == pytest.approx(VOLTAGE - 2 * sag * current)


def test_a_limit_of_the_current_is_that_of_a_motor_while_it_is_driven() -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.coulomb", torque=5.0)
    robot = robot.with_effect("motor.current_limit", None, limit=1.5)
    for share in (0.0, 0.24):
        ended = run(robot.with_chain(Chain(coast_share=share)), 1.0, 1.0)
        assert ended["motor.0.current"][0, -1] == pytest.approx((1.0 - share) * 1.5)


def test_motors_that_coast_together_load_the_battery_with_all_of_their_current_in_between() -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.coulomb", torque=5.0)
    alone = run(robot, 1.0, 1.0)
    together = run(robot.with_chain(Chain(coast_share=0.24, together=True)), 1.0, 1.0)
    for name in ("motor.0.current", "motor.1.current"):
        assert together[name][0, -1] == pytest.approx(0.76 * alone[name][0, -1], rel=1e-9)
    assert together["battery.voltage"][0, -1] == pytest.approx(alone["battery.voltage"][0, -1], rel=1e-9)


@pytest.mark.parametrize(
    ("chain", "given"),
    [(Chain(), 0.4 / 0.9), (Chain(threshold=True), 0.5), (Chain(cut=True), 0.4)],
)
def test_what_a_command_beyond_a_deadband_does(chain: Chain, given: float) -> None:
    robot = stiff().with_effect("actuation.deadband", None, duty=0.1).with_chain(chain)
    ended = run(robot, 0.5, -0.0999)
    assert ended["motor.0.speed"][0, -1] == pytest.approx(
        steady_speed(given * VOLTAGE, R, K, COULOMB, VISCOUS), abs=0.05
    )
    assert ended["motor.1.current"][0, -1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("command", [(-0.8, 0.8), (0.8, 0.2)])
def test_scrub_takes_its_torque_from_the_first_step_of_a_turn_on(command: tuple[float, float]) -> None:
    """Of wheels that turn from rest at once, and of those that turn while they drive."""
    scrubbing = stiff().with_effect("drive.turn_scrub", None, torque=0.03)
    duty = np.where(TIME[:, None] < 0.5, 0.0, command)
    commands = Commands.of_wheels(TIME, duty[:, 0], duty[:, 1], True)
    ways = [
        [rollout(robot, commands, longest_step=step) for robot in (stiff(), scrubbing)]
        for step in (0.002, 5e-5)
    ]
    coarse, fine = ([each["motor.1.speed"][0] for each in pair] for pair in ways)
    lost, exact = coarse[0] - coarse[1], fine[0] - fine[1]
    assert np.abs(exact).max() > 0.03
    np.testing.assert_allclose(lost, exact, atol=0.004)


def test_a_battery_may_carry_all_of_each_current_whichever_way_it_flows() -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.coulomb", torque=5.0)
    robot = robot.with_effect("battery.discharge", volts_per_coulomb=0.01).with_chain(Chain(whole=True))
    sag = MODEL.battery.internal_resistance.value
    ended = run(robot, 0.5, -0.25)
    drawn = np.abs(ended["motor.0.current"][0]) + np.abs(ended["motor.1.current"][0])
    charge = 0.002 * (np.sum(drawn) - 0.5 * (drawn[0] + drawn[-1]))
    # Rows have the current of the step before.
    expected = VOLTAGE - 0.01 * charge - sag * drawn[-1]
    assert ended["battery.voltage"][0, -1] == pytest.approx(expected, abs=1e-4)
    assert ended["motor.0.current"][0, -1] == pytest.approx(0.5 * expected / R, rel=1e-4)
    assert ended["motor.1.current"][0, -1] == pytest.approx(-0.25 * expected / R, rel=1e-4)


def test_a_reading_that_is_held_follows_a_falling_voltage_and_stays_below_a_rising_one() -> None:
    robot = Parameters.from_robot(RobotConfig()).with_effect("friction.coulomb", torque=5.0)
    duty = np.where(TIME < 1.0, 1.0, 0.2)
    held = robot.with_chain(Chain(battery_time_constant=0.02, battery_held=0.1))
    commands = Commands.of_wheels(TIME, duty, duty, True)
    plain = rollout(robot, commands)["battery.voltage"][0]
    reading = rollout(held, commands)["battery.voltage"][0]
    at_full, after = int(np.searchsorted(TIME, 0.99)), -1
    assert reading[at_full] == pytest.approx(plain[at_full], abs=1e-9)
    assert plain[after] - plain[at_full] > 0.2
    assert reading[after] == pytest.approx(plain[after] - 0.1, abs=1e-9)


def test_speeding_up_follows_the_time_constant() -> None:
    ended = run(stiff(), 0.8, 0.8)["motor.0.speed"][0]
    tau = time_constant(MODEL.drive.inertia_straight.value)
    final = steady_speed(0.8 * VOLTAGE, R, K, COULOMB, VISCOUS)
    np.testing.assert_allclose(ended, final * (1.0 - np.exp(-TIME / tau)), atol=1e-3 * final)


def test_turning_on_the_spot_follows_the_inertia_of_turning() -> None:
    ended = run(stiff(), -0.8, 0.8)["motor.1.speed"][0]
    tau = time_constant(MODEL.drive.inertia_turn.value)
    final = steady_speed(0.8 * VOLTAGE, R, K, COULOMB, VISCOUS)
    np.testing.assert_allclose(ended, final * (1.0 - np.exp(-TIME / tau)), atol=1e-3 * final)


def test_coasting_down_stops_when_friction_has_eaten_the_speed() -> None:
    # J w' = -(T_c + B w) from w0: stops after J / B ln(1 + B w0 / T_c).
    ended = run(stiff(), 0.0, 0.0, brake=False, speed_left=5.0, speed_right=5.0)["motor.0.speed"][0]
    inertia = MODEL.drive.inertia_straight.value
    stop = inertia / VISCOUS * math.log(1.0 + VISCOUS * 5.0 / COULOMB)
    assert TIME[np.flatnonzero(ended == 0.0)[0]] == pytest.approx(stop, abs=0.002)


def test_it_turns_on_a_circle_of_the_radius_that_the_speeds_give() -> None:
    ended = run(stiff(), 0.5, 1.0)
    left, right = (ended[f"motor.{port}.speed"][0, -1] for port in (0, 1))
    radius = 0.5 * MODEL.drive.track_width.value * (right + left) / (right - left)
    rows = slice(500, None)
    heading = ended["truth.heading"][0, rows]
    x = ended["truth.x"][0, rows] - radius * np.sin(heading)
    y = ended["truth.y"][0, rows] + radius * np.cos(heading)
    np.testing.assert_allclose(x, x[0], atol=1e-9)
    np.testing.assert_allclose(y, y[0], atol=1e-9)


def test_the_reading_follows_the_speed_through_its_filter() -> None:
    ended = run(stiff(), 1.0, 1.0)
    speed = ended["motor.0.speed"][0, -1]
    assert ended["motor.0.bemf"][0, -1] == pytest.approx(K * speed / BEMF_VOLTS_PER_COUNT, rel=1e-9)
    counter = np.cumsum(ended["motor.0.bemf"][0, 1:] * np.diff(TIME))
    np.testing.assert_allclose(ended["motor.0.position"][0, 1:], counter, rtol=1e-9)


def test_leaving_out_the_inductance_costs_less_than_its_time_constant() -> None:
    # With L, current and speed are a linear second-order system; a motor of this size has L / R = 1 ms.
    inductance, inertia = 0.0018, MODEL.drive.inertia_straight.value
    step = 1e-5
    current = speed = 0.0
    with_inductance = []
    for row in range(int(0.2 / step)):
        if row % 200 == 0:
            with_inductance.append(speed)
        current += step * (VOLTAGE - R * current - K * speed) / inductance
        speed += step * (K * current - VISCOUS * speed) / inertia
    smooth = stiff().with_effect("friction.coulomb", torque=0.0)
    ours = run(smooth, 1.0, 1.0)["motor.0.speed"][0, : len(with_inductance)]
    # A delay of L / R on a rise with the slope final / tau.
    share = inductance / R / time_constant(inertia)
    assert np.max(np.abs(ours - with_inductance)) < share * ours[-1]


def test_halving_the_step_quarters_the_error() -> None:
    duty = np.where((TIME * 4).astype(int) % 2 == 0, 0.9, 0.3)
    commands = Commands.of_wheels(TIME[::5], duty[::5], duty[::5])
    fine, half, whole = (
        rollout(stiff(), commands, longest_step=step)["truth.x"][0] for step in (0.0001, 0.0025, 0.005)
    )
    assert np.max(np.abs(half - fine)) < 0.35 * np.max(np.abs(whole - fine))


def test_a_measured_motor_can_be_named_in_the_robot() -> None:
    strong = replace(MODEL.left, back_emf_constant=Measured(1.2))
    robot = Parameters.from_robot(replace(RobotConfig(), model=replace(MODEL, left=strong)))
    ended = run(robot, 1.0, 1.0)
    assert ended["motor.0.speed"][0, -1] < ended["motor.1.speed"][0, -1]


def test_a_motor_is_sampled_when_its_pause_has_taken_half_of_what_the_wheel_gains_between() -> None:
    """Two motors that drag the same: half a pause of their torque over the inertia, off the mean speed."""
    pause, chain = 0.001, Chain(coast_share=0.2, together=True, pause=0.001)
    robot = Parameters.from_robot(RobotConfig())
    drive = robot.robot.model.drive
    for duty in ((0.6, 0.6), (0.6, -0.6)):
        inertia = drive.inertia_straight.value if duty[0] == duty[1] else drive.inertia_turn.value
        ended = run(robot.with_chain(chain), *duty)
        dip = 0.5 * pause * K * ended["motor.0.current"][0, -1] / inertia
        low = ended["motor.0.speed"][0, -1] - ended["motor.0.bemf"][0, -1] * BEMF_VOLTS_PER_COUNT / K
        assert low == pytest.approx(dip, rel=1e-3)
    stalled = run(robot.with_effect("friction.coulomb", torque=5.0).with_chain(chain), 1.0, 1.0)
    assert stalled["motor.0.bemf"][0, -1] == 0.0
