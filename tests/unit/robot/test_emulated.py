"""The simulated robot as the plant of an emulated Wombat."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import pytest

from raccoon import (
    Robot,
    after_time,
    calibrate_drive,
    calibrate_tophats,
    motors,
    open_robot,
    seq,
    straight,
    turn,
    wait,
)
from raccoon.core.clock import SteppedClock
from raccoon.core.config import BumperConfig, Measured, MotorConfig, RobotConfig, TophatConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Fault, Inputs, Outputs, Status
from raccoon.hal.wombat.emulator import COAST, Drive, Emulator, Firmware, PlantState
from raccoon.hal.wombat.port import WombatPort
from raccoon.model.motor import steady_speed
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.table import Box, Line, Ramp, World
from robots import InterceptingPort

TOPHATS = RobotConfig(tophats={"left": TophatConfig(0, 0.10, 0.035), "right": TophatConfig(1, 0.10, -0.035)})
LINE = World(lines=(Line(((0.3, -1.0), (0.3, 1.0)), 0.05),))


def driven(
    config: RobotConfig, drives: tuple[Drive, ...], seconds: float = 1.0
) -> tuple[SimulatedPlant, PlantState]:
    plant = SimulatedPlant(Parameters.from_robot(config), World.empty())
    for _ in range(round(seconds / 0.001)):
        state = plant.advance(0.001, drives)
    return plant, state


def test_a_motor_settles_at_the_speed_of_its_equation() -> None:
    _, state = driven(RobotConfig(), (0.5, 0.5, None, None))
    speed = steady_speed(0.5 * state.battery_voltage, 1.8, 1.08, 0.18, 0.004)
    assert state.bemf_volts[:2] == pytest.approx((1.08 * speed, 1.08 * speed), rel=0.002)
    assert state.bemf_volts[2:] == (0.0, 0.0)
    assert state.battery_voltage < 6.8


def test_the_right_wheel_alone_turns_left() -> None:
    plant, state = driven(RobotConfig(), (None, 0.5, None, None))
    assert state.gyro[2] > 0.3
    assert plant.pose[2] > 0.2


def test_walls_and_ramps_of_a_table_that_is_handed_in_count() -> None:
    """As on the simulator's own port: a program ended 0.4 m behind the wall that it drove at."""
    bumpers = {"front": BumperConfig(3), "back": BumperConfig(9, "back")}
    plant = SimulatedPlant(Parameters.from_robot(RobotConfig(bumpers=bumpers)), World.default())
    for _ in range(300):
        state = plant.advance(0.01, (-0.8, -0.8, None, None))
    assert plant.pose[0] == pytest.approx(-0.3 + 0.09, abs=5e-4)
    assert [port for port, closed in enumerate(state.digital) if closed] == [9]
    steep = Ramp(Box((-1.0, -1.0), (1.0, 1.0)), along_x=0.5)
    plant = SimulatedPlant(Parameters.from_robot(RobotConfig()), replace(World.empty(), ramps=(steep,)))
    for _ in range(100):
        plant.advance(0.01, COAST)
    assert plant.pose[0] > 0.05


def test_an_inverted_motor_turns_its_wheel_backwards() -> None:
    config = RobotConfig(motors={0: MotorConfig(inverted=True)})
    plant, state = driven(config, (-0.5, 0.5, None, None))
    assert plant.pose[0] > 0.05
    assert plant.pose[2] == pytest.approx(0.0, abs=1e-9)
    assert state.bemf_volts[0] < -1.0  # the board's sign, not the wheel's


def test_a_short_brakes_and_an_open_terminal_does_not() -> None:
    plant, _ = driven(RobotConfig(), (0.8, 0.8, None, None))
    rolling, _ = driven(RobotConfig(), (0.8, 0.8, None, None))
    for _ in range(20):
        braked = plant.advance(0.001, (0.0, 0.0, None, None))
        coasting = rolling.advance(0.001, COAST)
    assert braked.bemf_volts[0] < 0.8 * coasting.bemf_volts[0]


def test_no_time_changes_nothing() -> None:
    plant = SimulatedPlant(Parameters.from_robot(RobotConfig()))
    assert plant.advance(0.0, COAST) == PlantState(
        battery_voltage=6.8, bemf_volts=(0.0,) * 4, analog=(2000.0,) * 6
    )


def test_a_tophat_sees_the_line_it_stands_on() -> None:
    line = next(iter(World.default().lines)).points[0]
    config = RobotConfig(tophats={"front": TophatConfig(analog=2, forward=line[0], left=line[1])})
    black = SimulatedPlant(Parameters.from_robot(config), World.default()).advance(0.0, COAST).analog[2]
    white = SimulatedPlant(Parameters.from_robot(config), World.empty()).advance(0.0, COAST).analog[2]
    assert black > white + 500.0


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_the_whole_chain_drives_straight(firmware: Firmware) -> None:
    port = open_emulated(RobotConfig(), firmware)
    turn_rates = []
    for _ in range(100):
        inputs = port.read()
        turn_rates += [] if inputs.turn_rate is None else [inputs.turn_rate]
        port.write(Outputs(duty=(0.5, 0.5, 0.0, 0.0)))
    left, right = inputs.bemf[:2]
    assert left is not None
    assert right is not None
    assert left == pytest.approx(right, abs=20.0)
    assert left > 600.0
    assert turn_rates[-1] == pytest.approx(0.0, abs=0.02)
    port.close()


def test_an_offset_that_is_calibrated_leaves_nothing_uncertain() -> None:
    config = RobotConfig(motors={0: MotorConfig(bemf_offset=Measured(-30.0, 1.0))})
    port = open_emulated(config, 17)
    emulator = port._link
    assert isinstance(emulator, Emulator)
    emulator.faults.bemf_offset = (30.0, 0.0, 0.0, 0.0)  # the wire's sign is the other one
    with Robot(port, config) as robot:
        robot.run(wait(1.0))
        assert robot.inputs is not None
        assert robot.inputs.bemf[0] == pytest.approx(-30.0, abs=3.0)
        assert robot.inputs.faults == ()
        assert robot.estimate.status is Status.OK


def test_an_offset_that_the_firmware_hides_at_rest_is_not_taken_for_none() -> None:
    """Standing, such a motor reads 0 however long one looks; driven out and back it was 5 sigma off."""
    clock, config = SteppedClock(), RobotConfig()
    plant = SimulatedPlant(Parameters.from_robot(config), World.empty())
    emulator = Emulator(plant, "stock", clock=clock)
    emulator.faults.bemf_offset = (30.0, 0.0, 0.0, 0.0)
    with open_robot(config, port=WombatPort(emulator, clock=clock)) as robot:
        robot.run(seq(wait(1.0), straight(0.5), straight(-0.5)))
        here = robot.estimate
    x, y, _ = plant.pose
    assert here.status is Status.OK
    assert 0.005 < math.hypot(here.x - x, here.y - y) < 3.0 * math.hypot(here.x_std, here.y_std)


def test_a_calibration_does_not_call_a_hidden_offset_none() -> None:
    """It took 30 counts for 0 +- 0.1 and put them into the scale: driven back, that is 3 % the wrong way."""
    calibrated = RobotConfig()
    for step in (None, straight(-0.5)):
        clock = SteppedClock()
        plant = SimulatedPlant(Parameters.from_robot(RobotConfig()), World.empty())
        emulator = Emulator(plant, 21, clock=clock)
        emulator.faults.bemf_offset = (20.0, 0.0, 0.0, 0.0)
        with open_robot(calibrated, port=WombatPort(emulator, clock=clock)) as robot:
            if step is None:
                calibrated = calibrate_drive(robot, partial(_taped, plant), distance=0.5)
            else:
                robot.run(seq(wait(1.0), step))
            here = robot.estimate
    offset = calibrated.motor(0).bemf_offset
    assert offset is not None
    assert abs(offset.value - 20.0) < 2.0 * offset.std
    x, y, _ = plant.pose
    assert 0.005 < math.hypot(here.x - x, here.y - y) < 2.0 * math.hypot(here.x_std, here.y_std)


def _taped(plant: SimulatedPlant) -> float:
    return plant.pose[0]


def test_a_slow_bus_tears_nothing() -> None:
    """At 5 ms a transfer a cycle is 15 ms, and counters move between two looks. The second one was taken for
    one of the first's time: speeds twice as fast, wheels that slipped, and 39 mm."""
    port = open_emulated(RobotConfig(), world=World.empty())
    plant = _plant(port)
    _emulator(port).faults.latency = 0.005
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(seq(wait(0.5), straight(0.3), turn(math.radians(60.0)), straight(0.2)))
        here = robot.estimate
        assert port.fault_counts.keys() == {Fault.OVERRUN}
    x, y, heading = plant.pose
    assert math.hypot(here.x - x, here.y - y) < 0.01
    assert here.heading == pytest.approx(heading, abs=math.radians(0.5))


@pytest.mark.parametrize(("firmware", "period"), [("stock", 0.02), (21, 0.04)])
def test_power_on_one_wheel_and_then_the_other_teaches_no_scales(firmware: Firmware, period: float) -> None:
    """As who follows a line by raw motors. Both scales went a third off at a stated 2 %, and the pose 270 mm
    off at 20."""
    port = open_emulated(RobotConfig(), firmware, world=World.empty())
    plant = _plant(port)
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(wait(0.5))
        for _ in range(round(1.2 / period)):
            robot.run(motors(0.7, 0.2).until(after_time(period)))
            robot.run(motors(0.2, 0.7).until(after_time(period)))
        here = robot.estimate
        assert robot.odometry.wheel_scales == pytest.approx((1.0, 1.0), abs=0.05)
    x, y, _ = plant.pose
    assert here.status is Status.OK
    assert math.hypot(here.x - x, here.y - y) < 0.01


def test_a_lost_frame_leaves_a_program_the_last_words() -> None:
    """`robot.analog(0) > 2400` was a TypeError after each, and a button that is held was "released"."""
    port = open_emulated(TOPHATS)
    with open_robot(TOPHATS, port=port) as robot:
        robot.run(wait(0.3))
        before, pressed = robot.analog(0), robot.digital(0)
        _emulator(port).faults.silent = 0
        inputs = robot.tick()
        assert inputs.analog[0] is None
        assert (robot.analog(0), robot.digital(0)) == (before, pressed)
    assert before == pytest.approx(1266.0, abs=40.0)
    assert pressed is False


def test_a_robot_that_goes_to_and_fro_along_a_line_knows_its_heading_less_well() -> None:
    """Twice ten seconds of that on the stock firmware were 1.2 degrees at a stated 0.3."""
    line = Line(((-1.0, 0.01), (3.0, 0.01)), 0.05)
    port = open_emulated(TOPHATS, world=World(lines=(line,)))
    with open_robot(TOPHATS, port=port) as robot:
        robot.run(wait(0.5))
        for _ in range(800):
            robot.drive.velocity(0.10, 0.9 if (robot.analog(0) or 0.0) > 2400.0 else -0.9)
            robot.tick()
        here = robot.estimate
    assert abs(here.heading - _plant(port).pose[2]) < 2.0 * here.heading_std
    assert math.radians(0.4) < here.heading_std < math.radians(0.9)


@pytest.mark.parametrize("ports", [{0}, {0, 1}])
def test_a_robot_that_rolls_on_behind_a_loose_plug_knows_its_place_less_well(ports: set[int]) -> None:
    """0.3 s in which motors that turn give no back-EMF were 30 mm, at a stated 3."""
    port = open_emulated(RobotConfig())
    with open_robot(RobotConfig(), port=port) as robot:
        robot.odometry.reset()
        robot.run(motors(0.7, 0.7).until(after_time(0.8)))
        before = robot.estimate.x - _plant(port).pose[0]
        known = robot.estimate.x_std
        _emulator(port).faults.blown_fuse = ports
        robot.run(motors(0.7, 0.7).until(after_time(0.3)))
        _emulator(port).faults.blown_fuse = set()
        robot.run(motors(0.7, 0.7).until(after_time(0.2)))
        off = robot.estimate.x - _plant(port).pose[0] - before
        assert abs(off) < 2.0 * robot.estimate.x_std
        after = robot.estimate.x_std
        _emulator(port).faults.stalled = {0, 1}  # one that stays blocked is known to stay
        robot.run(motors(0.7, 0.7).until(after_time(0.5)))
        once = robot.estimate.x_std
        robot.run(motors(0.7, 0.7).until(after_time(0.4)))
        assert known < 0.01 < after < once == pytest.approx(robot.estimate.x_std, abs=0.002)


class Restarted(InterceptingPort):
    """The port of an emulated Wombat that restarts at `at` s."""

    def __init__(self, port: WombatPort, at: float) -> None:
        super().__init__(port)
        self._wombat, self._at = port, at

    def read(self) -> Inputs:
        inputs = super().read()
        if inputs.time >= self._at:
            self._at = math.inf
            _emulator(self._wombat).reset()
        return inputs


def test_a_restart_in_the_middle_of_a_calibration_spoils_no_tophat() -> None:
    """The stock firmware's analog filter begins at 0 again: the floor was "one surface"."""
    port = open_emulated(TOPHATS, world=LINE)
    with open_robot(TOPHATS, port=Restarted(port, 1.3)) as robot:
        robot.run(wait(0.5))
        found = calibrate_tophats(robot, distance=0.4, speed=0.2)
    assert port.fault_counts[Fault.RESET] == 1
    for each in found.values():
        white, black = each.surfaces()
        assert each.verdict == "ok"
        assert (white.mean, black.mean) == pytest.approx((1266.0, 3780.0), abs=20.0)


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_an_open_port_is_no_tophat_though_it_follows_its_neighbour(firmware: Firmware) -> None:
    """It showed the neighbour's white and black, and was calibrated with 18 deviations between them."""
    port = open_emulated(TOPHATS, firmware, world=LINE)
    with open_robot(TOPHATS, port=port) as robot:
        robot.run(wait(0.3))
        _emulator(port).faults.floating = {0}
        with pytest.raises(CalibrationError, match=r"m: left: floating, .* into analog 0") as raised:
            calibrate_tophats(robot, distance=0.4, speed=0.25)
        assert "right" not in str(raised.value)


def test_what_the_stock_filter_makes_of_full_scale_is_saturated() -> None:
    """Rising, it stops at 4086."""
    port = open_emulated(TOPHATS)
    _emulator(port).faults.saturated = {0: 4095}
    with open_robot(TOPHATS, port=port) as robot:
        robot.run(wait(0.5))
        with pytest.raises(CalibrationError, match=r"left: saturated, 100% of the readings .* top"):
            calibrate_tophats(robot, distance=0.1, speed=0.25)


def _emulator(port: WombatPort) -> Emulator:
    assert isinstance(port._link, Emulator)
    return port._link


def _plant(port: WombatPort) -> SimulatedPlant:
    plant = _emulator(port)._board._plant
    assert isinstance(plant, SimulatedPlant)
    return plant
