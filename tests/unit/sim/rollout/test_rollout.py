"""Open-loop runs: one robot, many robots, and what they must agree on."""

from time import process_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import MotorConfig, RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest
from raccoon.sim.plant.compiled import advance_cells
from raccoon.sim.plant.lanes import (
    GIVING_KIND,
    GIVING_SELDOM_KIND,
    PLAIN_KIND,
    READ_KIND,
    ROLLING_KIND,
    SELDOM,
    SELDOM_KIND,
)
from raccoon.sim.plant.stepped import Steps
from raccoon.sim.rollout import running
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import Lanes, rollout

TIME = np.arange(400) * 0.005
LEFT = np.where((np.arange(400) // 80) % 2 == 0, 0.7, -0.4)
STEPS = Commands.of_wheels(TIME, LEFT, 0.5 * LEFT)


def nominal() -> Parameters:
    return Parameters.from_robot(RobotConfig())


def some_robots(count: int) -> list[Parameters]:
    random = np.random.default_rng(7)
    return [
        nominal()
        .with_effect("friction.stiction", torque=random.uniform(0.0, 0.1))
        .with_effect("drive.backlash", "left", angle=random.uniform(0.0, 0.2))
        .with_effect("motor.heating", gain=random.uniform(0.0, 1.0))
        .with_effect("actuation.latency", seconds=random.uniform(0.0, 0.02))
        .with_effect("imu.latency", seconds=random.uniform(0.0, 0.02))
        for _ in range(count)
    ]


@pytest.mark.parametrize("count", [2, 5, 40])
def test_a_robot_in_a_lane_does_the_same_as_alone(count: int) -> None:
    robots = some_robots(count)
    together = rollout(robots, STEPS)
    for index in sorted({0, 1, min(31, count - 1), count - 1}):
        alone = rollout(robots[index], STEPS)
        for name, values in alone.channels.items():
            np.testing.assert_array_equal(values[0], together[name][index], err_msg=name)


@pytest.mark.parametrize("begin", [0, 37])
def test_an_order_that_all_motors_have_is_as_one_that_is_asked_for_anew(begin: int) -> None:
    """Robots in lanes keep an order until a command changes that the latest of them has not got yet."""
    random = np.random.default_rng(11)
    levels = np.repeat(random.uniform(-1.0, 1.0, 400), random.choice([1, 2, 3, 9], 400))[:400]
    commands = Commands.of_wheels(TIME, levels, np.where(random.random(400) < 0.1, 0.0, levels), brake=False)
    latencies = (0.0, 0.0012, 0.005, 0.0201)
    robots = [nominal().with_effect("actuation.latency", seconds=each) for each in latencies]
    together = rollout(robots, commands, begin=begin)
    for index, robot in enumerate(robots):
        for name, values in rollout(robot, commands, begin=begin).channels.items():
            np.testing.assert_array_equal(values[0], together[name][index], err_msg=name)


def test_plain_robots_and_others_side_by_side_do_the_same_as_one_by_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those without seldom effects run in a text of their own, or fill the others' vectors."""
    robots = [each for pair in zip(some_robots(21), [nominal()] * 21, strict=True) for each in pair]
    robots = [each.with_effect("friction.coulomb", torque=0.05 + 0.002 * i) for i, each in enumerate(robots)]
    together = rollout(robots, STEPS, noise=Noise(), seed=3)
    monkeypatch.setattr(running, "FEW", len(robots))
    alone = rollout(robots, STEPS, noise=Noise(), seed=3)
    for name, values in alone.channels.items():
        np.testing.assert_array_equal(together[name], values, err_msg=name)
    np.testing.assert_array_equal(together.final, alone.final)


@pytest.mark.parametrize("count", [2, 9, 40])
def test_threads_change_no_bit(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "SHORT", 0)
    robots = some_robots(count) + [nominal()] * count
    results = []
    for threads in (1, 3):
        monkeypatch.setattr(running, "_threads", lambda threads=threads: threads)
        results.append(rollout(robots, STEPS, noise=Noise(), seed=3))
    for name, values in results[0].channels.items():
        np.testing.assert_array_equal(results[1][name], values, err_msg=name)
    np.testing.assert_array_equal(results[1].final, results[0].final)


@pytest.mark.parametrize(
    ("said", "threads"),
    [
        ({}, 4),
        ({"OMP_NUM_THREADS": "1"}, 1),
        ({"OPENBLAS_NUM_THREADS": "2"}, 2),
        ({"OMP_NUM_THREADS": "16"}, 4),
        ({"OMP_NUM_THREADS": "0"}, 1),
        ({"OMP_NUM_THREADS": "", "OPENBLAS_NUM_THREADS": "3"}, 3),
    ],
)
def test_no_more_threads_than_cores_and_than_linear_algebra_may_have(
    said: dict[str, str], threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "usable_cores", lambda: 4)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    for name, value in said.items():
        monkeypatch.setenv(name, value)
    assert running._threads() == threads


def giving_robots(count: int) -> list[Parameters]:
    random = np.random.default_rng(8)
    return [
        nominal()
        .with_effect("friction.presliding", compliance=random.uniform(5e-4, 2e-3), damping=1.0)
        .with_effect("friction.quadratic", coefficient=random.uniform(0.0, 1e-4))
        .with_effect("drive.slope", along_x=random.uniform(0.0, 0.05))
        .with_effect("battery.discharge", volts_per_coulomb=random.uniform(0.0, 0.01))
        for _ in range(count)
    ]


def test_readings_alone_are_the_same_bits() -> None:
    names = [f"motor.{port}.{kind}" for port in (0, 1) for kind in ("bemf", "position", "current", "speed")]
    names += ["imu.gyro.z", "battery.voltage", "truth.heading"]
    giving = giving_robots(9)
    robots = [*giving, nominal(), *some_robots(2)]
    seldom: dict[str, dict[str, float]] = {
        "motor.heating": {"gain": 0.5},
        "motor.current_limit": {"limit": 0.4},
        "friction.stiction": {"torque": 0.02},
        "drive.turn_scrub": {"torque": 0.02},
        "drive.backlash": {"angle": 0.1},
        "drive.wheel_slip": {"time": 0.01},
        "drive.wheel_eccentricity": {"amplitude": 0.01},
    }
    assert set(seldom) == set(SELDOM)
    robots += [giving[0].with_effect(name, None, **numbers) for name, numbers in seldom.items()]
    robots += [robots[-1].with_effect("motor.current_limit", limit=0.5)]
    whole = rollout(robots, STEPS, longest_step=0.001)
    asked = rollout(robots, STEPS, channels=names, longest_step=0.001, readings_only=True)
    alone = [rollout(each, STEPS, channels=names, longest_step=0.001, readings_only=True) for each in robots]
    assert set(asked.channels) == set(names)
    for name in names:
        np.testing.assert_array_equal(asked[name], whole[name], err_msg=name)
        np.testing.assert_array_equal(
            np.concatenate([each[name] for each in alone]), whole[name], err_msg=name
        )


def test_vectors_of_a_block_lie_in_one_line_of_the_cache_each() -> None:
    """Across two of 64 bytes, lanes took twice as long."""
    for _ in range(4):
        block = running._block()
        assert [row.ctypes.data % 64 for row in block] == [0] * len(block)


def kinds_of(plant: NDArray[np.float64], readings_only: bool) -> list[str]:
    found = {}
    for kind, places in running._blocks(plant, readings_only):
        for each in places.tolist():
            assert each not in found
            found[each] = kind
    return [found[each] for each in range(len(plant))]


def test_each_robot_runs_once_and_where_least_is_computed_for_it() -> None:
    giving = giving_robots(8)  # whole vectors
    scrubbing, loose = (
        [each.with_effect(name, None, **{number: 0.02}) for each in giving]
        for name, number in (("drive.turn_scrub", "torque"), ("drive.backlash", "angle"))
    )
    robots = {
        READ_KIND: giving,
        ROLLING_KIND: scrubbing,
        GIVING_SELDOM_KIND: loose,
        SELDOM_KIND: some_robots(8),
    }
    plant = Lanes.of([*(each for some in robots.values() for each in some), nominal()]).plant
    kinds = [*(kind for kind in robots for _ in range(8)), PLAIN_KIND]
    assert kinds_of(plant, readings_only=True) == kinds
    kinds = [*[GIVING_KIND] * 8, *[GIVING_SELDOM_KIND] * 16, *[SELDOM_KIND] * 8, PLAIN_KIND]
    assert kinds_of(plant, readings_only=False) == kinds
    idle = kinds_of(plant[[0, 1, 2, 16, 32]], readings_only=True)
    assert idle == [*[GIVING_SELDOM_KIND] * 4, PLAIN_KIND]
    whole = Lanes.of([each.with_chain(Chain(whole=True)) for each in giving]).plant
    for readings_only in (True, False):
        assert kinds_of(whole, readings_only) == [GIVING_SELDOM_KIND] * 8
    for other in ({"creep": 0.1}, {"break_away": 0.9}):
        bristles = Lanes.of([giving[0].with_effect("friction.presliding", None, **other)] * 8).plant
        assert kinds_of(bristles, readings_only=True) == [ROLLING_KIND] * 8


def test_what_is_no_reading_cannot_be_asked_for_with_readings_only() -> None:
    with pytest.raises(ConfigError, match=r"truth\.x is no reading"):
        rollout(nominal(), STEPS, channels=("truth.x",), readings_only=True)


def test_a_final_state_of_readings_only_is_nothing_to_go_on_from() -> None:
    end = rollout(nominal(), STEPS, channels=("imu.gyro.z",), readings_only=True).final
    with pytest.raises(ConfigError, match="allowed are finite numbers"):
        rollout(nominal(), STEPS, initial=dict(zip(_fields(), end[0], strict=True)))


def test_robots_in_lanes_cost_a_fraction_of_robots_alone() -> None:
    pytest.importorskip("numba")
    one, few, many = (Lanes.of([nominal()] * count) for count in (1, 8, 128))
    duty = np.tile(LEFT, 10)  # long, so that what every rollout costs, long or short, is little of it
    steps = Commands.of_wheels(np.arange(len(duty)) * 0.005, duty, 0.5 * duty)

    def cost(lanes: Lanes) -> float:
        begun = process_time()
        rollout(lanes, steps, channels=("motor.0.bemf",), longest_step=0.001)
        return process_time() - begun

    cost(one), cost(many)  # compiles
    alone, some, together = (min(cost(each) for _ in range(5)) for each in (one, few, many))
    assert together / 128 < alone / 4  # measured: a tenth
    assert some < together / 8  # measured: a fourteenth; a block is no wider than it has robots


def test_robots_alone_step_by_step_and_in_a_rollout_are_compiled_once() -> None:
    pytest.importorskip("numba")
    rollout(nominal(), STEPS)
    plant = plant_numbers(nominal())
    Steps().after(state_at_rest(plant), plant, 0.001, 0.5, None)
    made: Any = advance_cells()
    assert len(made.signatures) == 1


def test_it_goes_on_from_a_final_state_as_if_it_had_not_stopped() -> None:
    whole = rollout(nominal(), STEPS)
    first = rollout(nominal(), STEPS, end=200)
    fields = dict(zip(_fields(), first.final[0], strict=True))
    second = rollout(nominal(), STEPS, begin=200, initial=fields)
    for name in ("motor.0.bemf", "motor.1.position", "truth.heading", "battery.voltage"):
        np.testing.assert_array_equal(second[name][0], whole[name][0, 200:])


def _fields() -> tuple[str, ...]:
    from raccoon.sim.plant.quantities import State

    return State._fields


def test_rows_are_at_the_times_of_the_commands_and_start_with_the_initial_state() -> None:
    run = rollout(nominal(), STEPS, initial={"speed_left": 2.0, "heading": 0.5}, begin=10, end=30)
    np.testing.assert_array_equal(run.time, TIME[10:31])
    assert run["motor.0.speed"].shape == (1, 21)
    assert run["motor.0.speed"][0, 0] == 2.0
    assert run["motor.0.bemf"][0, 0] == pytest.approx(2.0 * 1.08 / run_volts_per_count())
    assert run["truth.heading"][0, 0] == 0.5


def test_a_robot_that_begins_in_motion_goes_on_as_if_it_had_always_moved() -> None:
    robot = nominal().with_effect("drive.wheel_slip", time=0.02, at_once=1.0)
    robot = robot.with_effect("bemf.dead_zone", "right", counts=400.0)
    run = rollout(robot, STEPS, initial={"speed_left": 3.0, "speed_right": 1.0}, begin=10, end=30)
    turning = np.diff(run["truth.heading"][0]) / np.diff(run.time)
    assert turning[0] == pytest.approx(run["imu.gyro.z"][0, 0], rel=0.3)
    radius = robot.robot.model.drive.wheel_radius.value
    assert run["truth.x"][0, 1] / (run.time[1] - run.time[0]) == pytest.approx(2.0 * radius, rel=0.3)
    assert run["motor.0.bemf"][0, 0] > 0.0
    assert run["motor.1.bemf"][0, 0] == 0.0  # as it is where it is no more than the dead zone


def test_a_channel_that_is_asked_for_twice_is_made_once() -> None:
    robot = nominal().with_effect("imu.gyro_bias", rate=0.1)
    twice = rollout(robot, STEPS, channels=("imu.gyro.z", "imu.gyro.z"))["imu.gyro.z"]
    np.testing.assert_array_equal(twice, rollout(robot, STEPS)["imu.gyro.z"])


def run_volts_per_count() -> float:
    return 3.3 / 4096 * 9.0 / 2.2


def test_board_signs_of_an_inverted_motor() -> None:
    robot = RobotConfig(motors={1: MotorConfig(inverted=True)})
    inverted = rollout(Parameters.from_robot(robot), STEPS)
    straight = rollout(nominal(), STEPS)
    np.testing.assert_array_equal(inverted["motor.1.bemf"], -straight["motor.1.bemf"])
    np.testing.assert_array_equal(inverted["truth.x"], straight["truth.x"])


def test_a_latency_shifts_the_response_by_just_that() -> None:
    late = nominal().with_effect("actuation.latency", seconds=0.015)
    shifted = rollout(late, STEPS)["motor.0.bemf"][0]
    prompt = rollout(nominal(), STEPS)["motor.0.bemf"][0]
    np.testing.assert_allclose(shifted[3:], prompt[:-3], atol=1e-9)


@pytest.mark.parametrize("latency", [0.0004, 0.0035, 0.0137])
def test_a_late_command_may_come_within_a_step(latency: float) -> None:
    """A motor that coasted gets all of its volts from then on, and one that is let go none."""
    duty = np.where((np.arange(400) // 40) % 2 == 0, 0.0, LEFT)
    commands = Commands.of_wheels(TIME, duty, -0.7 * duty, brake=False)
    late = nominal().with_effect("actuation.latency", seconds=latency)
    coarse, fine = (rollout(late, commands, longest_step=each) for each in (0.001, 0.00005))
    for name in ("motor.0.bemf", "motor.1.bemf"):
        assert np.std(coarse[name] - fine[name]) < 1.0  # counts of some 1000


def test_noise_differs_between_robots_and_is_that_of_the_seed() -> None:
    robots = [nominal()] * 40
    first, again, other = (rollout(robots, STEPS, noise=Noise(), seed=seed) for seed in (1, 1, 2))
    plain = rollout(nominal(), STEPS)
    for name, sd in (("imu.gyro.z", 0.001), ("battery.voltage", 1.5 * 0.00886)):
        assert np.std(first[name] - plain[name]) == pytest.approx(sd, rel=0.05)
        np.testing.assert_array_equal(first[name], again[name])
        assert np.any(first[name] != other[name])
    # An exponential filter with the share a lets a / (2 - a) of the power of white noise through.
    share = 1.0 - np.exp(-0.005 / 0.0225)
    scatter = (first["motor.0.bemf"] - plain["motor.0.bemf"])[:, 100:]
    assert np.std(scatter) == pytest.approx(6.0 * np.sqrt(share / (2.0 - share)), rel=0.05)


def test_the_filter_takes_the_same_share_of_a_sample_whose_time_stamp_is_a_little_off() -> None:
    """The firmware counts samples; a row of another rate is longer by what its time says."""
    random = np.random.default_rng(4)
    still = np.zeros(400)
    regular = Commands.of_wheels(TIME, still, still)
    shaken = Commands.of_wheels(TIME + random.uniform(-4e-4, 4e-4, 400), still, still)
    robots = [nominal()] * 3
    scatter, shaken_scatter = (
        rollout(robots, each, noise=Noise(), seed=5)["motor.0.bemf"] for each in (regular, shaken)
    )
    np.testing.assert_allclose(shaken_scatter, scatter, rtol=1e-12)
    slower = rollout(robots, Commands.of_wheels(1.4 * TIME, still, still), noise=Noise(), seed=5)
    share = 1.0 - np.exp(-0.007 / 0.0225)
    assert np.std(slower["motor.0.bemf"][:, 100:]) == pytest.approx(
        6.0 * np.sqrt(share / (2.0 - share)), rel=0.1
    )


def test_gyro_effects() -> None:
    robot = (
        nominal()
        .with_effect("imu.gyro_scale", factor=1.1)
        .with_effect("imu.gyro_bias", rate=0.01)
        .with_effect("imu.gyro_drift", rate_per_second=0.002)
    )
    plain = rollout(nominal(), STEPS)["imu.gyro.z"][0]
    np.testing.assert_allclose(rollout(robot, STEPS)["imu.gyro.z"][0], 1.1 * plain + 0.01 + 0.002 * TIME)


def test_a_stiff_robot_is_stepped_finely_enough_to_stay_stable() -> None:
    light = nominal().with_effect("drive.inertia", factor=0.1)
    coarse = rollout(light, STEPS, longest_step=0.005)["motor.0.speed"][0]
    fine = rollout(light, STEPS, longest_step=0.0001)["motor.0.speed"][0]
    np.testing.assert_allclose(coarse, fine, atol=0.05)


def test_a_gyro_that_filters_little_is_followed_in_steps_that_its_series_bears() -> None:
    """In steps of four time constants it grew to 1e122 rad/s within a second."""
    quick = nominal().with_effect("imu.low_pass", time_constant=0.00125)
    coarse = rollout(quick, STEPS, channels=["imu.gyro.z"], longest_step=0.02)["imu.gyro.z"]
    fine = rollout(quick, STEPS, channels=["imu.gyro.z"], longest_step=0.0002)["imu.gyro.z"]
    np.testing.assert_allclose(coarse, fine, atol=0.005)


@pytest.mark.parametrize(
    ("left", "message"), [(np.full(400, np.nan), r"left\[0\] is nan"), (LEFT * 2, "duties from -1 to 1")]
)
def test_impossible_commands_are_named(left: np.ndarray, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Commands.of_wheels(TIME, left, LEFT)


def test_commands_are_of_the_kind_that_the_plant_is_compiled_for() -> None:
    """Read-only columns, as pandas gives them, had it compiled anew: 40 s each time."""
    duty, still = LEFT.copy(), np.zeros(400)
    for each in (duty, still):
        each.flags.writeable = False
    every_second = np.repeat(TIME, 2)[::2]
    by_wheels = Commands.of_wheels(every_second, duty, still)
    for commands in (by_wheels, Commands(every_second, duty, duty, still, still)):
        for each in (commands.time, *commands.rows):
            assert each.flags.writeable
            assert each.flags.c_contiguous


def test_times_that_do_not_rise_are_named() -> None:
    with pytest.raises(ConfigError, match=r"time\[2\]"):
        Commands.of_wheels([0.0, 0.1, 0.1], [0, 0, 0], [0, 0, 0])


def test_unknown_channels_fields_and_rows_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"motor\.7\.bemf"):
        rollout(nominal(), STEPS, channels=["motor.7.bemf"])
    with pytest.raises(ConfigError, match="no field speed"):
        rollout(nominal(), STEPS, initial={"speed": 1.0})
    with pytest.raises(ConfigError, match="rows 5 to 900"):
        rollout(nominal(), STEPS, begin=5, end=900)
    with pytest.raises(ConfigError, match="longest_step"):
        rollout(nominal(), STEPS, longest_step=0.0)
    with pytest.raises(ConfigError, match="no robot"):
        Lanes.of([])
