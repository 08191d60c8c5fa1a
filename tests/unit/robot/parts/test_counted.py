"""The angle of a mechanism, across cycles in which its controller says nothing or restarts."""

import math
from dataclasses import replace

import pytest

from raccoon import (
    RobotConfig,
    after_time,
    deg,
    move,
    move_by,
    open_robot,
    parallel,
    repeat,
    spin,
    straight,
    wait,
    zero,
)
from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, MechanismConfig, MotorConfig
from raccoon.core.readings import SIMULATOR, Fault, Inputs
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.parts.counted_angle import CountedAngle
from raccoon.sim.effects.parameters import Parameters

CONFIG = RobotConfig(mechanisms={"arm": MechanismConfig(motor=3)})
CYCLE = 0.005


class Emulated(WombatPort):
    """An emulated Wombat with an arm."""

    def __init__(self, firmware: Firmware, config: RobotConfig = CONFIG, offset: float = 0.0) -> None:
        clock = SteppedClock()
        self.config = config
        self.plant = SimulatedPlant(Parameters.from_robot(config))
        self.emulator = Emulator(self.plant, firmware, clock=clock)
        self.emulator.faults.bemf_offset = (0.0, 0.0, 0.0, offset)
        clock.advance(0.5)  # it was switched on before the program began
        super().__init__(self.emulator, clock=clock)
        self.cycle = 0


class Restarting(Emulated):
    """One that restarts in its 40th cycle, in the middle of a move."""

    def read(self) -> Inputs:
        self.cycle += 1
        if self.cycle == 40:
            self.emulator.reset()
        return super().read()


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_an_arm_arrives_across_a_restart_and_it_is_said(firmware: Firmware) -> None:
    port = Restarting(firmware)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(move("arm", deg(90.0)))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(90.0, abs=2.0)
        (said,) = robot.drive.remarks.values()
        assert "restarted" in said
        assert "how far arm turned" in said


@pytest.mark.parametrize(
    ("firmware", "offset", "rest"),
    [
        ("stock", -77.0, 0.005),
        (17, 31.5, 0.005),
        (21, -77.0, 0.5),
    ],
)
def test_an_offset_that_nobody_calibrated_does_not_make_an_arm_creep(
    firmware: Firmware, offset: float, rest: float
) -> None:
    """As they were measured on real boards."""
    port = Emulated(firmware, offset=offset)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(rest))
        robot.run(move("arm", deg(45.0)))
        arrived = math.degrees(port.plant.free_motors[3].angle)
        assert arrived == pytest.approx(45.0, abs=3.0)
        robot.run(wait(2.0))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(arrived, abs=2.0)


def test_an_offset_that_a_dead_zone_hides_does_not_make_an_arm_creep() -> None:
    port = Emulated(21, replace(CONFIG, motors={3: MotorConfig(bemf_offset=Measured(20.0, 1.0))}))
    with open_robot(port.config, port=port) as robot:
        robot.run(move("arm", deg(45.0)))
        robot.run(wait(2.0))
        assert robot.mechanism("arm").angle == pytest.approx(deg(45.0), abs=deg(2.0))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(45.0, abs=4.0)


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_an_arm_that_comes_fast_stands_where_it_arrives(firmware: Firmware) -> None:
    """What it reads while it rolls out is no offset."""
    port = Emulated(firmware)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.3))
        robot.run(move("arm", deg(120.0), 5.0))
        arrived = math.degrees(port.plant.free_motors[3].angle)
        robot.run(wait(1.0))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(arrived, abs=2.0)
        assert arrived == pytest.approx(120.0, abs=3.0)


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_an_arm_is_no_slower_than_it_is_counted(firmware: Firmware) -> None:
    """In the dead zone it would turn on until something is counted."""
    port = Emulated(firmware)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.1))
        robot.run(move("arm", deg(20.0), 0.02))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(20.0, abs=2.5)
        (said,) = robot.drive.remarks.values()
        assert "arm is turned at 0.1" in said
        assert "rad/s at least: the controller cannot count slower" in said


def test_a_spin_at_no_speed_turns_nothing() -> None:
    port = Emulated("stock")
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.1))
        robot.run(spin("arm", 0.0).until(after_time(0.5)))
        assert port.plant.free_motors[3].angle == 0.0
        assert not robot.drive.remarks


def test_steps_one_after_the_other_do_not_add_up_what_each_is_off() -> None:
    """As of a wheel with a pocket every 60 degrees."""
    with open_robot(CONFIG, port=Emulated("stock")) as robot:
        arm, near = robot.mechanism("arm"), 2.0 * CONFIG.mechanisms["arm"].tolerance
        robot.run(wait(0.1))
        robot.run(repeat(move_by("arm", deg(60.0)), 5))
        assert arm.angle == pytest.approx(deg(300.0), abs=near)
        robot.run(zero("arm", deg(20.0)))
        robot.run(move_by("arm", deg(-60.0)))
        assert arm.angle == pytest.approx(deg(-40.0), abs=near)


def test_an_arm_is_no_faster_than_it_is_read_and_costs_the_wheels_nothing() -> None:
    """On a battery that would turn it beyond the 2000 counts that RaccoonOS reads."""
    port = Emulated(21)
    pack = replace(CONFIG.model.battery, open_circuit_voltage=Measured(7.4, 0.1))
    model = replace(CONFIG.model, battery=pack)
    port.plant.become(Parameters.from_robot(replace(CONFIG, model=model)))
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.3))
        robot.run(parallel(straight(0.15), move("arm", deg(330.0), 12.0)))
        robot.run(spin("arm", 12.0).until(after_time(0.4)))
        assert port.plant.pose[0] == pytest.approx(robot.pose.x, abs=0.003)
        assert port.plant.pose[0] == pytest.approx(0.15, abs=0.005)
        assert any("arm is turned at 5.80 rad/s at most" in said for said in robot.drive.remarks.values())


def test_an_arm_that_is_turned_by_hand_is_followed() -> None:
    counted, ticks = CountedAngle(CONFIG, CONFIG.mechanisms["arm"], 1.0), 0.0
    for cycle in range(400):
        turning = 100 <= cycle < 200
        bemf = 30.0 + (250.0 if turning else 0.0)
        ticks += bemf * CYCLE / SIMULATOR.position_counts_seconds
        words = Inputs(CYCLE * cycle, SIMULATOR, bemf=(0.0, 0.0, 0.0, bemf), position=(0.0, 0.0, 0.0, ticks))
        counted.sense(words, CYCLE, powered=False)
    scale = SIMULATOR.bemf_volts / CONFIG.model.left.back_emf_constant.value
    assert counted.angle == pytest.approx(250.0 * 100 * CYCLE * scale, rel=0.02)


def test_one_word_after_a_pause_is_no_offset() -> None:
    """Somebody turns it then."""
    counted = CountedAngle(CONFIG, CONFIG.mechanisms["arm"], 1.0)
    cycles = (0.0, CYCLE, 300.0, True), (5.0, 5.0, 100.0, False), (5.005, CYCLE, 100.0, False)
    for time, dt, bemf, powered in cycles:
        words = Inputs(time, SIMULATOR, bemf=(0.0, 0.0, 0.0, bemf), position=(0.0, 0.0, 0.0, 0.0))
        counted.sense(words, dt, powered)
    scale = SIMULATOR.bemf_volts / CONFIG.model.left.back_emf_constant.value
    assert counted.rate == pytest.approx(100.0 * scale)


def test_a_known_offset_adds_nothing_in_a_gap() -> None:
    motor = MotorConfig(bemf_offset=Measured(50.0, 1.0))
    config = RobotConfig(motors={3: motor}, mechanisms=CONFIG.mechanisms)
    counted = CountedAngle(config, config.mechanisms["arm"], 1.0)
    ticks = 0.0
    for cycle in range(100):
        ticks += 50.0 * CYCLE / SIMULATOR.position_counts_seconds
        read = cycle % 10 == 0
        words = (None, None, None, ticks if read else None)
        counted.sense(Inputs(CYCLE * cycle, SIMULATOR, position=words), CYCLE, powered=True)
    assert counted.angle == pytest.approx(0.0, abs=1e-9)


def test_a_counter_that_jumped_goes_on_at_the_rate_before() -> None:
    counted = CountedAngle(CONFIG, CONFIG.mechanisms["arm"], 1.0)
    bemf = (None, None, None, 300.0)
    for cycle in range(2):
        faults = (Fault.POSITION_JUMP,) if cycle else ()
        position = (None, None, None, 7.0)
        counted.sense(
            Inputs(CYCLE * cycle, SIMULATOR, bemf=bemf, position=position, faults=faults), CYCLE, True
        )
    assert counted.angle == pytest.approx(counted.rate * CYCLE)
