"""Wheels under control are not driven faster than the controller reads their back-EMF."""

import math
from dataclasses import replace

import pytest

from raccoon import (
    Action,
    MotionResult,
    Robot,
    RobotConfig,
    deg,
    drive,
    follow_path,
    motors,
    open_robot,
    race,
    seq,
    straight,
    turn,
    wait,
)
from raccoon.control.wheels import WheelTarget
from raccoon.core.clock import SteppedClock
from raccoon.core.config import BatteryConfig, Measured, MotorConfig
from raccoon.core.readings import SIMULATOR, Fault, Inputs
from raccoon.estimate.drive.odometry import Odometry
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.firmware.devices import RACCOON_21, STOCK
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant, open_emulated
from raccoon.robot.parts.drive import Drive, dead_time
from raccoon.robot.parts.speed_limits import READ_SHARE, UnreadWheels
from raccoon.sim.effects.parameters import Parameters

FRESH = RobotConfig(battery=BatteryConfig(weakest=7.6))
"""A match whose batteries are all fresh: nothing else keeps motions slow."""


class Watched:
    """An emulated Wombat on a battery of 7.8 V, and what it said."""

    def __init__(self, firmware: Firmware) -> None:
        plant = Parameters.from_robot(FRESH).with_effect("battery.open_circuit_voltage", voltage=7.8)
        self._port = open_emulated(FRESH, firmware, seed=1, robot=plant)
        self.write, self.close = self._port.write, self._port.close
        self.faults: set[Fault] = set()
        self.fastest = 0.0

    def read(self) -> Inputs:
        inputs = self._port.read()
        self.faults.update(inputs.faults)
        self.fastest = max(self.fastest, *(abs(each or 0.0) for each in inputs.bemf))
        return inputs


def done(action: Action[object], firmware: Firmware) -> tuple[Watched, Robot]:
    port = Watched(firmware)
    with open_robot(FRESH, port=port) as robot:
        robot.run(seq(wait(0.5), action))
    return port, robot


@pytest.mark.parametrize(("firmware", "turn_rate"), [(17, 1.5), (17, 0.0), (21, 0.0), (21, -1.5)])
def test_drive_does_not_pass_what_is_read(firmware: Firmware, turn_rate: float) -> None:
    port, robot = done(race(drive(0.3, turn_rate), wait(1.2)), firmware)
    assert not port.faults
    assert 1750.0 < port.fastest < 2000.0
    (said,) = robot.drive.remarks.values()
    assert "m/s at most: wombat-raccoon" in said


@pytest.mark.parametrize("motion", [straight(0.4, 0.3), turn(deg(180.0), 6.0)])
def test_motions_are_planned_below_it_and_end_on_their_mark(motion: Action[MotionResult]) -> None:
    port = Watched(21)
    with open_robot(FRESH, port=port) as robot:
        robot.run(wait(0.5))
        result = robot.run(motion)
        assert len(robot.drive.remarks) == 1
    assert not port.faults
    assert result.planned < 0.9
    assert math.hypot(result.along, result.across) < 0.004
    assert abs(result.heading) < 0.01


@pytest.mark.parametrize(
    ("firmware", "motion"), [("stock", straight(0.02, 0.001)), (21, follow_path([(0.02, 0.0)], 0.001))]
)
def test_a_motion_is_no_slower_than_its_way_is_counted(
    firmware: Firmware, motion: Action[MotionResult]
) -> None:
    """In the dead zone the robot would go on until it believes to be there: 6 cm instead of 2."""
    plant = SimulatedPlant(Parameters.from_robot(FRESH))
    clock = SteppedClock()
    port = WombatPort(Emulator(plant, firmware, clock=clock), clock=clock)
    with open_robot(FRESH, port=port) as robot:
        result = robot.run(seq(wait(0.3), motion))[1]
        assert plant.pose[0] == pytest.approx(0.02, abs=0.0015)
        assert result.planned > 3.0
        (said,) = robot.drive.remarks.values()
        assert "m/s at least: wombat-" in said


def test_slow_circles_and_turns_stay_what_they_are() -> None:
    """There the faster wheel is counted, or the gyro tells."""
    speeds = Drive(FRESH).speeds
    speeds.configure(STOCK, Drive(FRESH).wheels.models)
    assert speeds.planned(0.001, 0.4)[0] > 0.004
    assert speeds.planned(0.001, 0.4, outer=10.0)[0] == 0.001
    assert speeds.planned(0.001, 0.4, counted=False)[0] == 0.001
    assert speeds.planned(0.0, 0.4)[0] == 0.0
    assert speeds.planned_turn(0.01, 6.0)[0] == 0.01


def test_a_controller_that_reads_any_speed_limits_none() -> None:
    port, robot = done(race(drive(0.3), wait(1.2)), "stock")
    assert port.fastest > 1950.0
    assert not robot.drive.speeds.was_limited
    (said,) = robot.drive.remarks.values()
    assert (
        said == "drive 0.3 m/s: limited to 0.21 m/s, because a battery at battery.weakest (7.6 V) gives "
        "no more"
    )


def test_plain_duties_are_free() -> None:
    port, robot = done(race(motors(1.0, 1.0), wait(0.6)), 21)
    assert Fault.BEMF_INVALID in port.faults
    assert not robot.drive.remarks


def test_a_loop_of_its_own_is_told_too() -> None:
    port = Watched(21)
    with open_robot(FRESH, port=port) as robot:
        for _ in range(200):
            robot.drive.velocity(0.3, 0.0)
            robot.tick()
        assert len(robot.drive.remarks) == 1
    assert not port.faults


def test_what_pushes_at_a_wall_gets_no_more_than_what_is_read_either() -> None:
    base = Drive(FRESH)
    base.configure(RACCOON_21)
    given, rest = [], Odometry(FRESH).estimate
    for speed in (base.speeds.max_readable_speed * FRESH.model.drive.wheel_radius.value, 0.3):
        base.push(speed, 8.0, (0.0, 0.0), (math.inf, math.inf))
        given.append(base.outputs(rest, 0.005, 8.0).duty)
    assert given[1] == pytest.approx(given[0])


def test_both_wheels_give_way_alike_to_the_one_that_would_not_be_read() -> None:
    """A wheel's calibration tells how fast it turns at a count."""
    half = MotorConfig(radians_per_tick=Measured(0.5 * RACCOON_21.bemf_volts / 1.08))
    base = Drive(replace(FRESH, motors={1: half}))
    base.configure(SIMULATOR)
    assert base.speeds.max_readable_speed == math.inf
    base.configure(STOCK)
    assert base.speeds.max_readable_speed == math.inf
    base.configure(RACCOON_21)
    assert base.speeds.max_readable_speed == pytest.approx(READ_SHARE * 2000.0 * half.radians_per_tick.value)  # type: ignore[union-attr]
    share = base.speeds.readable_share(2.0, -8.0)
    assert share == pytest.approx(base.speeds.max_readable_speed / 8.0)
    assert base.speeds.readable_share(1.0, -1.0) == 1.0


@pytest.mark.parametrize(("rate", "seconds"), [(200.0, 0.0075), (50.0, 0.015)])
def test_a_command_is_late_by_half_a_cycle_and_a_sample_of_the_firmware(rate: float, seconds: float) -> None:
    """What the gains of the speed loop are made for."""
    config = replace(RobotConfig(), controller=replace(RobotConfig().controller, rate_hz=rate))
    assert dead_time(config) == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("silent", "share"),
    [((False, False), 1.0), ((True, False), 0.5), ((False, True), 0.25), ((True, True), 0.25)],
)
def test_a_wheel_that_is_not_read_is_asked_for_no_more_than_before_and_the_other_in_ratio(
    silent: tuple[bool, bool], share: float
) -> None:
    unread, wanted = UnreadWheels(), WheelTarget(4.0, -16.0, 2.0, -8.0)
    assert unread.limit_target(WheelTarget(-2.0, 4.0), (False, False)) == WheelTarget(-2.0, 4.0)
    for _ in range(2):
        assert unread.limit_target(wanted, silent) == WheelTarget(
            4 * share, -16 * share, 2 * share, -8 * share
        )
