"""A program that keeps the robot from reading for a while: nothing makes up for the pause at once."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from raccoon import (
    Action,
    MotionResult,
    Robot,
    RobotConfig,
    after_time,
    arc,
    deg,
    do,
    drive,
    follow_line,
    move,
    open_robot,
    parallel,
    race,
    seq,
    servo,
    straight,
    turn,
    wait,
    when,
)
from raccoon.core.clock import SteppedClock
from raccoon.core.config import MechanismConfig, ServoConfig
from raccoon.core.readings import STOP, Inputs
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.table import World
from robots import CONFIG, InterceptingPort, simulated_port, tophat_calibration

ARM = RobotConfig(motors=CONFIG.motors, tophats=CONFIG.tophats, mechanisms={"arm": MechanismConfig(motor=2)})


class Pausing(InterceptingPort):
    """The simulated robot, which a test can let go on by itself."""

    def __init__(self, config: RobotConfig = ARM) -> None:
        super().__init__(simulated_port(config=config))

    def pause(self, seconds: float, *, stopped: bool = False) -> None:
        """Nobody reads. stopped: as the supervisor does it, the motors are stopped meanwhile."""
        if stopped:
            self.port.write(STOP)
        for _ in range(round(seconds * 200)):
            self.port.read()

    def duties(self) -> list[float]:
        return [max(abs(each) for each in written.duty) for written in self.written]


def first_duties(action: Action[Any], seconds: float) -> list[float]:
    port = Pausing()
    with open_robot(ARM, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(wait(0.5))
        port.pause(seconds)
        port.written.clear()
        robot.run(action.until(after_time(0.05)))
    return port.duties()[:8]


@pytest.mark.parametrize("seconds", [0.3, 5.0])
@pytest.mark.parametrize("action", [drive(0.15), drive(0.0, 1.0), follow_line("left")], ids=repr)
def test_a_drive_after_a_pause_speeds_up_as_after_none(action: Action[None], seconds: float) -> None:
    assert first_duties(action, seconds) == pytest.approx(first_duties(action, 0.0), abs=0.02)


def test_a_drive_whose_motors_were_stopped_in_a_pause_speeds_up_again() -> None:
    port = Pausing()

    def think(_robot: Robot) -> None:
        port.pause(1.0, stopped=True)
        port.written.clear()

    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        robot.run(race(drive(0.15), seq(wait(0.6), do(think), wait(1.2))))
    before, *after = port.duties()  # the first is of the tick in which it thought
    assert after[0] < 0.4 * before
    assert max(after) < before + 0.05


@pytest.mark.parametrize(
    ("action", "seconds"),
    [
        (turn(deg(60), 0.4), 2.5),
        (straight(-0.12, 0.05), 2.5),
        (arc(0.15, deg(60), 0.08), 1.0),
    ],
    ids=repr,
)
def test_a_motion_whose_motors_were_stopped_in_a_pause_makes_up_for_nothing(
    action: Action[MotionResult], seconds: float
) -> None:
    port = Pausing()

    def think(_robot: Robot) -> None:
        before.extend(port.duties())
        port.pause(seconds, stopped=True)
        port.written.clear()

    before: list[float] = []
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        result, _ = robot.run(parallel(action, seq(wait(1.0), do(think))))
    assert max(port.duties()) < max(before) + 0.05
    assert abs(result.along) < 0.002
    assert abs(result.heading) < 0.006


def test_an_arm_whose_motor_was_stopped_in_a_pause_makes_up_for_nothing() -> None:
    port = Pausing()
    rates: list[float] = []

    def look(robot: Robot) -> bool:
        rates.append(abs(robot.mechanism("arm").rate))
        return False

    with open_robot(ARM, port=port) as robot:
        thinks = seq(wait(1.0), do(lambda _: port.pause(1.5, stopped=True)))
        angle, *_ = robot.run(parallel(move("arm", 1.0, 0.3), thinks, wait(6.0).until(when(look))))
    assert angle == pytest.approx(1.0, abs=0.05)
    assert max(rates) < 0.5


def test_a_servo_that_goes_slowly_does_not_jump_after_a_pause() -> None:
    config = RobotConfig(servos={"claw": ServoConfig(port=0)})
    port = Pausing(config)
    with open_robot(config, port=port) as robot:
        robot.run(servo("claw", 1000))
        begin = robot.time
        robot.run(parallel(servo("claw", 2000, seconds=2.0), seq(wait(0.5), do(lambda _: port.pause(1.0)))))
        assert robot.time - begin == pytest.approx(3.0, abs=0.02)
    pulses = [each.servo_us[0] or 0 for each in port.written]
    assert max(after - before for before, after in pairwise(pulses[1:]) if before) <= 3


@pytest.mark.parametrize("seconds", [0.3, 5.0])
def test_an_arm_that_is_held_through_a_pause_is_not_torn_back(seconds: float) -> None:
    port = Pausing()
    with open_robot(ARM, port=port) as robot:
        robot.run(move("arm", 1.0))
        assert port.written[-1].duty[2] == 0.0  # a duty that nobody watches would turn it away
        assert port.written[-1].brake[2]
        port.pause(seconds)
        port.written.clear()
        robot.run(wait(1.0))
        assert max(abs(each.duty[2]) for each in port.written) < 0.12
        assert robot.mechanism("arm").angle == pytest.approx(1.0, abs=0.05)


def test_a_pause_counts_as_one_cycle_and_is_known_for_one_tick() -> None:
    port = Pausing()
    with open_robot(ARM, port=port) as robot:
        seen = []
        for pause in (0.0, 0.05, 1.0, 0.0):
            port.pause(pause)
            robot.tick()
            seen.append((robot.paused, round(robot.dt, 6)))
    # What delays a tick or two counts in full, as the motors went on meanwhile.
    assert seen == [(False, 0.0), (False, 0.055), (True, 0.005), (False, 0.005)]


def test_a_straight_goes_on_through_a_short_pause() -> None:
    port = Pausing()
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        thinks = seq(wait(1.0), do(lambda _: port.pause(0.3)), wait(0.1))
        result, _ = robot.run(parallel(straight(0.3), thinks))
        assert result.along == pytest.approx(0.0, abs=0.002)
    assert max(port.duties()) < 0.9


@pytest.mark.parametrize(("firmware", "milliseconds"), [("stock", 30), (21, 13)])
def test_wheels_do_not_ring_where_code_is_slow_in_every_cycle(firmware: Firmware, milliseconds: int) -> None:
    """RaccoonOS shows speeds 28 ms late: 13 ms more a cycle, and a straight ended 60 mm off in a timeout."""
    clock, config = SteppedClock(), RobotConfig()
    plant = SimulatedPlant(Parameters.from_robot(config), World.empty())
    port = WombatPort(Emulator(plant, firmware, clock=clock), clock=clock)

    def computes(_: Robot) -> bool:
        clock.advance(milliseconds / 1000)
        return False

    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        for action in (straight(0.2), turn(deg(90)), straight(0.1)):
            robot.run(action.until(when(computes)))
        robot.run(wait(0.2))
    x, y, heading = plant.pose
    assert math.dist((x, y), (0.2, 0.1)) < 0.008
    assert heading == pytest.approx(deg(90), abs=0.03)


@pytest.mark.parametrize(("cycles", "said"), [(1, 0), (3, 0), (6, 1)])
def test_a_program_that_is_slow_in_every_cycle_is_told_once(cycles: int, said: int) -> None:
    port = Pausing()

    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.5))
        for _ in range(60):
            port.pause((cycles - 1) / 200)
            robot.tick()
        told = [each for each in robot.drive.remarks.values() if each.startswith("a cycle takes")]
        assert len(told) == said
        assert all("30 ms" in each and "instead of 5 (rate_hz)" in each for each in told)


def test_time_that_runs_back_makes_no_jerk() -> None:
    """No port of ours does that; a recording or another's may. Wheels got full power, or an overflow."""

    def jump(inputs: Inputs) -> Inputs:
        return replace(inputs, time=inputs.time - 3.0) if inputs.time > 1.5 else inputs

    port = InterceptingPort(simulated_port(config=CONFIG), seen=jump)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.5))
        before = len(port.written)
        robot.run(drive(0.15).until(when(lambda _: len(port.written) > before + 400)))
    duties = [each.duty[0] for each in port.written[before + 100 : before + 390]]
    assert 0.4 < min(duties) < max(duties) < 0.8


@pytest.mark.parametrize(("speed", "said"), [(0.1, 1), (0.0, 0)], ids=["drives", "stands"])
def test_a_loop_that_sleeps_in_every_cycle_is_told_where_it_drives(speed: float, said: int) -> None:
    port = Pausing()
    with open_robot(RobotConfig(), port=port) as robot:
        for _ in range(25):
            port.pause(0.15)
            robot.drive.velocity(speed)
            robot.tick()
        told = [each for each in robot.drive.remarks.values() if each.startswith("a cycle takes 155 ms")]
        assert len(told) == said
