"""Motors that are not what robot.toml says: still controlled, and reported with their port."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from raccoon import (
    Action,
    ConfigError,
    MotionTimeout,
    Robot,
    RobotConfig,
    after_time,
    arc,
    calibrate_drive,
    deg,
    drive,
    motors,
    open_robot,
    race,
    seq,
    straight,
    turn,
    wait,
    wait_for,
    when,
)
from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, MotorConfig, TophatConfig
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs
from raccoon.hal.wombat.emulator import Emulator
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Line, Wall, World
from robots import CONFIG, FULL_RATE, InterceptingPort, run, simulated_port

BARE = replace(CONFIG, motors={})


def test_half_the_magnet_is_calibrated_away_and_reported() -> None:
    effects = {"motor.back_emf_constant@left": {"factor": 0.5}}
    with Robot(simulated_port(config=BARE, effects=effects), BARE) as robot:

        def taped() -> float:
            assert robot.inputs is not None
            assert robot.inputs.truth is not None
            return robot.inputs.truth.x

        calibrated = calibrate_drive(robot, taped, distance=0.6)
    result, end, robot = run(straight(0.5), simulated_port(seed=2, config=BARE, effects=effects), calibrated)
    assert end.x == pytest.approx(0.5, abs=0.005)
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.5)
    assert any("left motor (port 0) has 0.5" in said for said in robot.drive.find_oddities())
    assert any("left motor (port 0) has 0.5" in said for said in result.remarks)


def test_half_as_much_resistance_again_is_controlled_and_reported() -> None:
    """A straight of 1 m is as much as tells: of 14 draws of the noise 13 did. Late readings are a part of the
    load, and alike on both sides."""
    told: list[str] = []
    for seed in (1, 2, 3):
        effects = {"motor.armature_resistance@left": {"factor": 1.5}}
        port = simulated_port(seed=seed, effects=effects, config=FULL_RATE)
        _, end, robot = run(straight(1.0), port, FULL_RATE)
        assert end.x == pytest.approx(1.0, abs=0.004)
        assert end.y == pytest.approx(0.0, abs=0.005)
        told += robot.drive.find_oddities()
    assert len(told) >= 2
    assert all(re.search(r"left motor \(port 0\) needs 1\.[345]", each) for each in told)


@pytest.mark.parametrize(("factor", "config"), [(0.5, CONFIG), (2.0, BARE)])
def test_a_gyro_of_another_full_scale_is_named_and_no_motor(factor: float, config: RobotConfig) -> None:
    port = simulated_port(config=config, effects={"imu.gyro_scale": {"factor": factor}})
    turns = seq(*(turn(math.radians(angle)) for angle in (90.0, -90.0) * 3), straight(0.2))
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(turns)
        said = tuple(robot.drive.remarks.values())
    assert any(f"the gyro reads {factor:.1f}" in each for each in said)
    assert not any("motor" in each for each in said)


def gives_up(port: Port, action: Action[Any], config: RobotConfig = CONFIG) -> str:
    """What a motion says that does not come to its end."""
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        with pytest.raises(MotionTimeout) as found:
            robot.run(action)
        return str(found.value)


def test_only_a_battery_that_is_low_is_blamed() -> None:
    full = gives_up(
        simulated_port(world=World(walls=(Wall((0.2, -1.0), (0.2, 1.0)),))), arc(0.25, math.radians(90.0))
    )
    assert "battery is too weak" not in full
    assert "something holds the robot or a wheel" in full
    flat = simulated_port(effects={"battery.open_circuit_voltage": {"voltage": 4.0}})
    assert "the battery is too weak, 3." in gives_up(flat, drive(0.3).timeout(1.0))


def test_ticks_that_no_motor_has_are_named() -> None:
    """A quarter of what a tick is, and a point in the wrong place: 100 times."""
    odd, wrong = (
        replace(CONFIG, motors={port: MotorConfig(radians_per_tick=Measured(ticks)) for port in (0, 1)})
        for ticks in (0.0008, 0.35)
    )
    said = gives_up(simulated_port(), straight(0.8, 0.2), odd)
    assert "battery is too weak" not in said
    assert "radians_per_tick of motor 0 makes its K_E 3.8 times that of [model]" in said
    with pytest.raises(
        ConfigError, match=r"motor\.0\.radians_per_tick is 0\.35, .* digit in the wrong place"
    ):
        run(straight(0.5), config=wrong)


def test_a_wall_that_keeps_a_robot_from_turning_is_no_gyro() -> None:
    with open_robot(
        CONFIG, port=simulated_port(world=World(walls=(Wall((0.12, -1.0), (0.12, 1.0)),)))
    ) as robot:
        robot.run(wait(0.5))
        for turn_rate in (0.8, -0.8):
            with pytest.raises(MotionTimeout):
                robot.run(drive(0.12, turn_rate).timeout(3.0))
        assert robot.odometry.turn_share == 1.0


def test_a_nominal_robot_is_not_complained_about() -> None:
    result, _, robot = run(straight(1.0))
    assert robot.drive.find_oddities() == ()
    assert result.remarks == ()


def test_a_wheel_that_was_changed_is_told_by_the_gyro_and_a_distance_is_unsure_by_half_of_it() -> None:
    """Which of the two it was nobody knows: one that is larger, or the other one smaller."""
    result, _, _ = run(straight(1.0), simulated_port(effects={"drive.wheel_radius@right": {"factor": 1.06}}))
    (said,) = result.remarks
    told = re.search(r"right wheel \(motor port 1\) turns ([\d.]+) times what its calibration says", said)
    assert told is not None
    assert float(told[1]) == pytest.approx(1.06, abs=0.01)
    assert result.std == pytest.approx(0.5 * 0.06 * 1.0, rel=0.15)


@pytest.mark.parametrize("chain", [None, Chain.firmware()], ids=["plain", "firmware"])
def test_unequal_motors_as_the_paper_has_them_are_not_complained_about(chain: Chain | None) -> None:
    factors = {"motor.armature_resistance@left": {"factor": 2.0 / 1.7}}
    results, _, _ = run(seq(straight(0.3), turn(deg(90))), simulated_port(effects=factors, chain=chain))
    assert [result.remarks for result in results] == [(), ()]


def test_a_motor_changed_after_the_calibration_is_said_once_everywhere(
    caplog: pytest.LogCaptureFixture,
) -> None:
    port = on_battery(6.6, **{"motor.back_emf_constant@right": {"factor": 1.04}})
    results, end, robot = run(seq(straight(0.3), straight(0.3)), port)
    assert end.x < 0.595  # only a tape can tell how far a changed motor drives
    assert results[1].std > 0.005  # and the result says how unsure it is
    said = "compared with the gyro, the right wheel (motor port 1) turns 0.96"
    assert all(any(each.startswith(said) for each in result.remarks) for result in results)
    assert sum(note.startswith(f"remark: {said}") for note in port.notes) == 1
    assert [record.name for record in caplog.records] == ["raccoon"]
    assert len(robot.drive.remarks) == 1


class Held(InterceptingPort):
    """An emulated Wombat whose right wheel somebody holds for `seconds` from `begin` s on."""

    def __init__(self, begin: float, seconds: float) -> None:
        self._begin, self._end, self._clock = begin, begin + seconds, SteppedClock()
        plant = SimulatedPlant(Parameters.from_robot(RobotConfig()), World.empty())
        self._emulator = Emulator(plant, 21, clock=self._clock)
        super().__init__(WombatPort(self._emulator, clock=self._clock))

    def read(self) -> Inputs:
        holds = self._begin <= self._clock.now() < self._end
        self._emulator.faults.stalled = {1} if holds else set()
        return super().read()


@pytest.mark.parametrize(("begin", "seconds"), [(0.9, 0.05), (1.5, 0.3)])
def test_a_wheel_that_was_held_for_a_moment_is_no_odd_motor(
    begin: float, seconds: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Let go, its reading jumps by the filter's law: the other was said to take 1.5 times the voltage."""
    with open_robot(RobotConfig(), port=Held(begin, seconds)) as robot:
        robot.run(wait(0.5))
        for motion in (straight(0.25), turn(deg(60)), straight(0.2)):
            assert not any("voltage" in said for said in robot.run(motion).remarks)
        left, right = robot.drive.wheels.states
    assert caplog.records == []
    assert left.known
    assert right.load_factor == pytest.approx(left.load_factor, rel=0.1)


def test_wheels_that_spin_at_a_wall_are_no_odd_motors(caplog: pytest.LogCaptureFixture) -> None:
    """On a long way at one speed the fit forgets, and the quarter second until the wall is known sufficed to
    say 0.7 times the voltage. So did the time after it, when the wall is taken for carpet."""
    port = simulated_port(world=World.default(), config=RobotConfig())
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(wait(1.0))
        remarks = robot.run(straight(2.4)).remarks
        assert any(said.startswith("held") for said in remarks)
        assert not any("voltage" in said for said in remarks)
    assert not any("voltage" in record.message for record in caplog.records)


def without_right(outputs: Outputs) -> Outputs:
    """As where the plug of the right motor is out: it coasts."""
    return replace(outputs, duty=(outputs.duty[0], 0.0, 0.0, 0.0), brake=(True, False) * 2)


def test_an_unplugged_motor_ends_the_motion_early_and_is_named() -> None:
    port: Port = InterceptingPort(sent=without_right)
    with Robot(port, CONFIG) as robot:
        robot.run(wait(0.5))
        begin = robot.time
        with pytest.raises(MotionTimeout, match=r"no motion at right \(motor port 1\): blocked, unplugged"):
            robot.run(straight(0.5))
        assert robot.time - begin < 2.0


@pytest.mark.parametrize("distance", [0.03, -0.03])
@pytest.mark.parametrize(
    "effect",
    [
        {"actuation.deadband": {"duty": 0.10}},
        {"friction.stiction": {"torque": 0.2, "speed": 0.5}},
    ],
    ids=["dead band", "stiction"],
)
def test_a_small_move_settles_in_a_second(distance: float, effect: dict[str, dict[str, float]]) -> None:
    result, end, _ = run(straight(distance), simulated_port(effects=effect))
    assert result.duration <= 1.0
    assert end.x == pytest.approx(distance, abs=0.0015)


def test_a_speed_beyond_the_weakest_battery_is_planned_down_and_said() -> None:
    strong = simulated_port(effects={"battery.open_circuit_voltage": {"voltage": 7.2}})
    result, _, robot = run(straight(0.3, speed=0.5), strong)
    assert result.planned < 0.25 / 0.5
    assert not result.saturated
    weak = simulated_port(effects={"battery.open_circuit_voltage": {"voltage": robot.config.battery.weakest}})
    again, _, _ = run(straight(0.3, speed=0.5), weak)
    assert not again.saturated
    assert again.duration == pytest.approx(result.duration, abs=0.05)


def test_a_speed_of_robot_toml_is_planned_down_as_one_of_a_motion_is() -> None:
    fast = replace(CONFIG, motion=replace(CONFIG.motion, speed=1.0))
    results = [run(arc(0.1, deg(90)), config=fast)[0], run(arc(0.1, deg(90), speed=1.0))[0]]
    assert results[0] == results[1]
    assert results[0].planned < 0.2
    assert not results[0].saturated


def test_more_acceleration_makes_no_motion_slower() -> None:
    hard = replace(CONFIG, motion=replace(CONFIG.motion, acceleration=5.0, turn_acceleration=60.0))
    for motion in (
        straight(0.25, speed=0.5),
        straight(0.25, speed=0.15),
        turn(deg(60), turn_rate=10.0),
        arc(0.2, deg(60), speed=0.5),
    ):
        usual, quick = run(motion)[0], run(motion, config=hard)[0]
        assert quick.planned >= usual.planned - 1e-9
        assert quick.duration <= usual.duration + 0.05


def on_battery(volts: float, **effects: Mapping[str, float]) -> InterceptingPort:
    return InterceptingPort(
        simulated_port(effects={"battery.open_circuit_voltage": {"voltage": volts}, **effects})
    )


def remarks(port: InterceptingPort) -> list[str]:
    """What was remarked on the way, without the steps."""
    return [note for note in port.notes if note.startswith("remark: ")]


def test_scaled_duties_drive_alike_at_80_percent_and_say_what_is_missing_at_100() -> None:
    ways: dict[tuple[float, float], float] = {}
    for duty in (0.8, 1.0):
        for battery in (6.1, 7.0):
            port = on_battery(battery)
            _, end, _ = run(motors(duty, duty, tuned_at=7.0).until(after_time(1.0)), port)
            ways[duty, battery] = end.x
            assert duty == 1.0 or not remarks(port)
    assert ways[0.8, 6.1] == pytest.approx(ways[0.8, 7.0], rel=0.01)
    assert ways[1.0, 6.1] < 0.9 * ways[1.0, 7.0]


def test_the_missing_speed_is_noted() -> None:
    port = on_battery(6.1)
    run(motors(1.0, 1.0, tuned_at=7.0).until(after_time(0.2)), port)
    # 0.9 V of 7.0 V are missing, at 0.92 (rad/s)/V and 34.5 mm: 28.6 mm/s.
    (note,) = remarks(port)
    said, _, speed = note.split(" m/s")[0].rpartition(", ")
    assert said == "remark: voltage scaling: 13 % missing"
    assert float(speed) == pytest.approx(0.0286, abs=0.001)


def test_a_loop_that_follows_a_line_to_and_fro_makes_no_motor_odd(caplog: pytest.LogCaptureFixture) -> None:
    """Its speeds jump with every look at the tophat: motors "needed half the voltage for it", or stood
    still against their duty, and a straight after it was held at a wall that was not there."""
    config = replace(RobotConfig(), tophats={"left": TophatConfig(0, 0.10, 0.035)})
    line = Line(((-1.0, 0.01), (3.0, 0.01)), 0.05)
    port = open_emulated(config, 21, seed=1, world=World(lines=(line,)))
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        for _ in range(700):
            dark = (robot.analog(0) or 0.0) > 2400.0
            robot.drive.velocity(0.10, 0.9 if dark else -0.9)
            robot.tick()
        after = robot.run(straight(0.1))
        assert after.arrived
        assert not [each for each in after.remarks if "motor" in each or "wheel" in each]
        assert robot.estimate.y == pytest.approx(0.0, abs=0.03)
    assert [record.message for record in caplog.records] == []


def test_wheels_that_spin_at_a_wall_say_nothing_of_their_motors() -> None:
    port = simulated_port(config=BARE, world=World(walls=(Wall((0.3, -1.0), (0.3, 1.0)),)))
    with open_robot(BARE, port=port) as robot:
        robot.run(seq(wait(0.5), straight(0.1), straight(-0.1)))
        with pytest.raises(MotionTimeout):
            robot.run(drive(0.15).timeout(9.0))
        robot.run(seq(straight(-0.2), straight(0.1, speed=0.1)))
        assert robot.drive.find_oddities() == ()


def test_what_scrubs_in_turns_makes_no_motor_odd() -> None:
    """The outer wheel carries it, the inner one is pushed: the right motor was said to be odd."""
    scrub = Parameters.from_robot(CONFIG).with_effect("drive.turn_scrub", torque=0.06)
    curve = race(drive(0.2, 1.5), wait(1.0))
    said: set[str] = set()

    def listen(robot: Robot) -> bool:
        said.update(robot.drive.find_oddities())
        return False

    with open_robot(CONFIG, port=SimPort(scrub, World.empty(), seed=1)) as robot:
        robot.run(race(seq(wait(0.6), curve, straight(0.3), curve, straight(0.3)), wait_for(when(listen))))
        known = [state.known for state in robot.drive.wheels.states]
    assert known == [True, True]
    assert not said


def test_a_motor_is_found_odd_between_turns_too() -> None:
    effects = {"motor.armature_resistance@left": {"factor": 1.6}}
    parts = [part for _ in range(3) for part in (straight(0.3), turn(deg(60)))]
    _, _, robot = run(seq(*parts), simulated_port(effects=effects))
    (said,) = robot.drive.find_oddities()
    assert said.startswith("the left motor (port 0) needs 1.")
