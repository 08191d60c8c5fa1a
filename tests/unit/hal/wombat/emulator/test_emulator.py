"""The emulated co-processor against what is known of the real one's firmware."""

import math
import struct
import sys
from collections.abc import Callable
from random import Random
from types import FrameType
from typing import Any

import pytest

from bench_robot import BenchRobot
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import Outputs
from raccoon.hal.wombat.emulator import Drive, Emulator, Firmware, PlantState
from raccoon.hal.wombat.emulator.board import IMU_POLE, _LowPass
from raccoon.hal.wombat.emulator.raccoon_chip import RaccoonChip
from raccoon.hal.wombat.firmware.devices import STOCK
from raccoon.hal.wombat.firmware.raccoon import commands as raccoon_commands
from raccoon.hal.wombat.firmware.raccoon import wire as raccoon
from raccoon.hal.wombat.firmware.raccoon.commands import Command, Kinematics, Mode, MotorPid, Shutdown, Update
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock
from raccoon.hal.wombat.firmware.stock.commands import READ, frame


class ConstantPlant:
    """Motors that always induce the same voltages; counts the time that each motor is driven."""

    def __init__(self, counts: tuple[float, ...] = (0.0,) * 4) -> None:
        self.counts = counts
        self.analog = (1000.0,) * 6
        self.battery_counts = 900.0
        self.driven = [0.0] * 4
        self.total = 0.0

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        self.total += seconds
        for port, drive in enumerate(drives):
            self.driven[port] += seconds if drive else 0.0
        return PlantState(
            bemf_volts=tuple(3.3 / 4096 * 9.0 / 2.2 * each for each in self.counts),
            battery_voltage=self.battery_counts * 3.3 * 11 / 4096,
            analog=self.analog,
        )


class Chip:
    def __init__(self, plant: Any, firmware: Firmware = "stock", build: Any = "shipped") -> None:
        self.clock = SteppedClock()
        self.plant = plant
        self.emulator = Emulator(plant, firmware, clock=self.clock, build=build, noise=False)
        self.firmware = firmware
        self.ask()

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.001)):
            self.clock.advance(0.001)
            self.emulator.run()

    def ask(self, message: bytes = READ) -> bytes:
        if message == READ and self.firmware != "stock":
            message = bytes(raccoon.FRAME_LENGTH[int(self.firmware)])
        return self.emulator.transfer(message)

    def registers(self) -> stock.Registers:
        return stock.decode(self.ask())

    def telemetry(self) -> raccoon.Telemetry:
        return raccoon.decode(self.ask(), int(self.firmware))


def test_boot_registers() -> None:
    emulator = Emulator(ConstantPlant(), clock=SteppedClock())
    first = emulator.transfer(READ)
    assert first[0] == 0  # one stale byte
    registers = stock.decode(emulator.transfer(READ))
    assert registers.version == 8
    assert registers.allstop == 0xF0
    assert registers.servo_us == (1500,) * 4
    assert registers.canary == 0


def test_the_reply_is_from_before_the_command() -> None:
    chip = Chip(ConstantPlant())
    assert stock.decode(chip.ask(frame(stock_commands.canary()))).canary == 0
    assert chip.registers().canary == 0x40


@pytest.mark.parametrize("damaged", [0, 1, 88])
def test_a_frame_without_its_marks_is_ignored(damaged: int) -> None:
    chip = Chip(ConstantPlant())
    bad = bytearray(frame(stock_commands.canary()))
    bad[damaged] ^= 1
    chip.ask(bytes(bad))
    assert chip.registers().canary == 0


def test_goals_and_gains_are_written_but_never_shown() -> None:
    chip = Chip(ConstantPlant())
    chip.ask(frame([(89, 7), *stock_commands.position_goal(0, 3000)]))
    assert len(chip.ask()) == 89
    assert chip.emulator.chip.registers[89] == 7  # type: ignore[attr-defined]


def test_a_write_beyond_the_registers_hangs_the_chip() -> None:
    chip = Chip(ConstantPlant((500.0,) * 4))
    chip.wait(0.1)
    wild = bytearray(READ)
    wild[:6] = (0x4A, 4, 0, 1, 200, 1)
    wild[88] = 0x53
    chip.ask(bytes(wild))
    before = chip.registers().position
    chip.wait(0.1)
    assert chip.registers().position == before


def test_a_transfer_of_another_length_shifts_all_that_follow() -> None:
    chip = Chip(ConstantPlant())
    chip.ask(bytes(30))
    assert stock.find_shift(chip.ask()) == 59
    chip.ask(bytes(59))
    assert stock.find_shift(chip.ask()) == 0


@pytest.mark.parametrize(("level", "settled"), [(39, 0), (40, 37), (100, 97), (700, 697), (-100, -97)])
def test_stock_filter_truncates_and_starts_at_forty(level: int, settled: int) -> None:
    chip = Chip(ConstantPlant((float(level), 0.0, 0.0, 0.0)))
    chip.wait(0.5)
    before = chip.registers().position[0]
    chip.wait(1.0)
    updates = (chip.registers().position[0] - before) / (settled or 1)
    assert updates == (0 if settled == 0 else pytest.approx(235, abs=1.5))


def test_analog_and_battery_settle_low_when_rising() -> None:
    chip = Chip(ConstantPlant())
    chip.wait(1.0)
    assert chip.registers().analog == (991,) * 6
    assert chip.registers().battery == 881
    chip.plant.analog = (500.0,) * 6
    chip.wait(1.0)
    assert chip.registers().analog == (500,) * 6


@pytest.mark.parametrize(
    ("firmware", "share"), [("stock", 0.76), (17, 1 - 0.544 / 5.525), (21, 1 - 0.544 / 5.525)]
)
def test_motors_are_unpowered_while_they_are_measured(firmware: Firmware, share: float) -> None:
    chip = Chip(ConstantPlant(), firmware)
    outputs = Outputs(duty=(1.0, 0.0, 0.0, 0.0))
    command = (
        stock_commands.encode(outputs) if firmware == "stock" else raccoon_commands.encode(outputs, firmware)
    )
    chip.ask(command)
    chip.wait(0.1)
    chip.plant.driven, chip.plant.total = [0.0] * 4, 0.0
    chip.wait(2.0)
    assert chip.plant.driven[0] / chip.plant.total == pytest.approx(share, abs=0.015)


def test_stock_speed_control_holds_a_speed_and_shows_its_duty() -> None:
    robot = BenchRobot()
    chip = Chip(robot)
    chip.ask(frame([*stock_commands.speed_goal(2, -900), *stock_commands.modes((0, 0, 1, 0))]))
    chip.wait(2.0)
    assert 1.08 * robot.speeds[2] / 0.0032959 == pytest.approx(-900, rel=0.02)
    registers = chip.registers()
    assert registers.directions[2] == stock_commands.Direction.REVERSE
    assert 150 < registers.pwm[2] < 350


def test_a_move_ends_shorted_and_done() -> None:
    robot = BenchRobot()
    chip = Chip(robot)
    move = [*stock_commands.position_goal(0, 800), *stock_commands.speed_goal(0, 900)]
    chip.ask(frame([*move, *stock_commands.modes((2, 0, 0, 0))]))
    chip.wait(2.0)
    registers = chip.registers()
    assert registers.done[0]
    assert 800 * 250 < registers.position[0] < 900 * 250  # it overshoots
    assert robot.speeds[0] == 0.0


def test_a_move_whose_mode_comes_first_does_nothing() -> None:
    chip = Chip(BenchRobot())
    chip.ask(frame([(stock.POS_GOAL + n, 0xFF) for n in range(4)]))  # an old goal of -1
    chip.ask(frame(stock_commands.modes((2, 0, 0, 0))))
    chip.wait(0.05)
    chip.ask(frame([*stock_commands.position_goal(0, 800), *stock_commands.speed_goal(0, 900)]))
    chip.wait(1.0)
    assert chip.registers().done[0]
    assert chip.registers().position[0] == 0


def test_allstop_is_stronger_than_any_command() -> None:
    chip = Chip(ConstantPlant())
    chip.ask(stock_commands.encode(Outputs(duty=(1.0, 1.0, 0.0, 0.0))))
    chip.wait(0.02)
    running_before = chip.emulator.motors_running
    chip.ask(frame([(stock.ALLSTOP, stock_commands.LATCHED_STOP)]))
    chip.wait(0.02)
    assert (running_before, chip.emulator.motors_running) == (True, False)
    assert list(chip.registers().pwm) == [0, 0, 0, 0]


def test_clearing_a_counter() -> None:
    chip = Chip(ConstantPlant((0.0, 0.0, 0.0, 500.0)))
    chip.wait(0.5)
    assert chip.registers().position[3] > 10_000
    chip.ask(frame(stock_commands.clear_position(3)))
    assert chip.registers().position[3] == 0


@pytest.mark.parametrize(("firmware", "ticks_a_second"), [(17, 500.0 * 181), (21, 500.0)])
def test_raccoon_counters(firmware: Firmware, ticks_a_second: float) -> None:
    chip = Chip(ConstantPlant((500.0, -500.0, 0.0, 20.0)), firmware)
    chip.wait(0.5)
    before = chip.telemetry().position
    chip.wait(1.0)
    moved = [new - old for new, old in zip(chip.telemetry().position, before, strict=True)]
    assert moved[0] == pytest.approx(ticks_a_second, rel=0.01)
    assert moved[1] == pytest.approx(-ticks_a_second, rel=0.01)
    # Version 21 has a dead zone of 25 counts.
    assert moved[3] == (0 if firmware == 21 else pytest.approx(20.0 * 181, rel=0.01))


def test_raccoon_back_emf_freezes_beyond_its_range() -> None:
    plant = ConstantPlant((1500.0, 0.0, 0.0, 0.0))
    chip = Chip(plant, 17)
    chip.wait(0.5)
    plant.counts = (2500.0, 0.0, 0.0, 0.0)
    chip.wait(0.2)
    frozen = chip.telemetry().position
    chip.wait(0.2)
    assert chip.telemetry().position == frozen
    assert 1500 <= chip.telemetry().bemf[0] <= 2000


@pytest.mark.parametrize("firmware", [17, 21])
def test_raccoon_controllers(firmware: int) -> None:
    robot = BenchRobot()
    chip = Chip(robot, firmware)  # type: ignore[arg-type]
    goal = 200_000 if firmware == 17 else 150  # 21 approaches its goal slowly
    command = Command(
        modes=(Mode.SPEED, Mode.POSITION, Mode.BRAKE, Mode.OFF),
        targets=(-900, 600, 0, 0),
        goals=(0, goal, 0, 0),
    )
    for _ in range(40):
        chip.ask(raccoon_commands.encode_command(command, firmware))
        chip.wait(0.1)
    assert 1.08 * robot.speeds[0] / 0.0032959 == pytest.approx(-900, rel=0.02)
    assert chip.telemetry().done[1]
    # Done within 40 ticks, and what the filter still holds.
    assert chip.telemetry().position[1] == pytest.approx(goal, abs=60 if firmware == 21 else 400)


def test_one_shot_updates() -> None:
    chip = Chip(ConstantPlant((500.0, 500.0, 0.0, 0.0)), 21)
    chip.wait(0.5)
    offset = Kinematics(bemf_offset=(-100.0, 0.0, 0.0, 0.0), ticks_to_rad=(0.003,) * 4)
    pid = MotorPid(gains=((3.0, 0.0, 0.0),) * 4)
    command = Command(
        updates=Update.POSITION_RESET | Update.KINEMATICS | Update.VELOCITY_PID,
        position_reset=0b10,
        kinematics=offset,
        pid=pid,
    )
    chip.ask(raccoon_commands.encode_command(command, 21))
    chip.wait(0.1)
    telemetry = chip.telemetry()
    assert telemetry.position[0] > 200
    assert telemetry.position[1] < 100
    # The wire's offset has the wire's sign: -(-500 + 100).
    assert telemetry.bemf[0] == pytest.approx(400.0, abs=3)
    assert isinstance(chip.emulator.chip, RaccoonChip)
    assert chip.emulator.chip.motors.motors[0].kp == pytest.approx(3.0)


def test_chassis_mode_needs_kinematics() -> None:
    robot = BenchRobot()
    chip = Chip(robot, 21)
    half_track, radius = 0.08, 0.0345
    forward = [1 / radius, 0.0, -half_track / radius, 1 / radius, 0.0, half_track / radius, *([0.0] * 6)]
    # In the wire's polarity both wheels of this robot are mounted the other way round.
    matrix = Kinematics(forward=tuple(-each for each in forward), ticks_to_rad=(0.00305,) * 4)
    chip.ask(raccoon_commands.encode_command(Command(updates=Update.KINEMATICS, kinematics=matrix), 21))
    command = Command(modes=(Mode.CHASSIS,) * 4, chassis_velocity=(0.1, 0.0, 0.5))
    chip.ask(raccoon_commands.encode_command(command, 21))
    chip.wait(2.0)
    assert robot.turn_rate == pytest.approx(0.5, rel=0.05)
    assert 0.5 * sum(robot.speeds[:2]) * radius == pytest.approx(0.1, rel=0.05)


def test_a_wrong_version_does_not_protect_the_motors() -> None:
    chip = Chip(BenchRobot(), 17)
    wrong = bytearray(raccoon_commands.encode(Outputs(duty=(0.5, 0.0, 0.0, 0.0)), 17))
    wrong[0] = 16
    chip.ask(bytes(wrong))
    chip.wait(0.05)
    assert chip.emulator.motors_running


def test_shutdown_stops_motors_and_counters() -> None:
    chip = Chip(BenchRobot(), 17)
    running = raccoon_commands.encode(Outputs(duty=(0.5, 0.0, 0.0, 0.0)), 17)
    chip.ask(running)
    chip.wait(0.3)
    chip.ask(raccoon_commands.encode_command(Command(shutdown=Shutdown.MOTORS), 17))
    chip.wait(0.05)
    assert not chip.emulator.motors_running


def test_heading_on_the_wire_is_clockwise() -> None:
    robot = BenchRobot()
    chip = Chip(robot, 17)
    chip.ask(raccoon_commands.encode(Outputs(duty=(-0.3, 0.3, 0.0, 0.0)), 17))
    chip.wait(1.0)
    reply = chip.ask()
    (wire_deg,) = struct.unpack_from("<f", reply, 136)
    assert wire_deg > 180.0  # the robot has turned left a little
    telemetry = raccoon.decode(reply, 17)
    assert telemetry.heading == pytest.approx(robot.heading, abs=0.05)


def test_a_restart_silences_the_link_and_forgets_everything() -> None:
    chip = Chip(ConstantPlant((500.0,) * 4))
    chip.wait(0.5)
    chip.ask(stock_commands.encode(Outputs(duty=(1.0, 0.0, 0.0, 0.0))))
    chip.wait(0.02)
    chip.emulator.pulse()
    assert chip.ask() == bytes(89)
    assert not chip.emulator.motors_running
    chip.wait(0.03)
    chip.ask()
    registers = chip.registers()
    assert max(registers.position) < 5000
    assert registers.canary == 0


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ConfigError, match="firmware is 18"):
        Emulator(ConstantPlant(), 18)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="build is"):
        Emulator(ConstantPlant(), build="old")  # type: ignore[arg-type]


def test_a_closed_link_is_closed() -> None:
    emulator = Emulator(ConstantPlant(), clock=SteppedClock())
    emulator.close()
    with pytest.raises(HardwareError, match="closed"):
        emulator.transfer(READ)


class StruckPlant(ConstantPlant):
    """Loses `speed` m/s within half a millisecond after `time` s."""

    def __init__(self, speed: float, time: float) -> None:
        super().__init__()
        self.left, self.time = speed, time

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        state = super().advance(seconds, drives)
        if self.total < self.time or seconds == 0.0:
            return state
        lost = self.left * min(1.0, seconds / 0.0005)
        self.left -= lost
        return state._replace(accel=(-lost / seconds, 0.0, 9.80665))


class SaggingPlant(ConstantPlant):
    """Its battery has 100 counts less for each of four motors that is driven."""

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        self.battery_counts = 900.0 - 100.0 * sum(drive is not None for drive in drives)
        return super().advance(seconds, drives)


def test_the_battery_of_raccoon_os_sags_as_the_mean_over_the_pauses_has_it() -> None:
    """Some 50 conversions are averaged, of which a tenth see each motor coast."""
    chip = Chip(SaggingPlant(), 17)
    command = raccoon_commands.encode(Outputs(duty=(1.0, 1.0, 1.0, 1.0)), 17)
    words = []
    for _ in range(200):
        chip.wait(0.005)
        words.append(raccoon.decode(chip.ask(command), 17).battery)
    assert sum(words[10:]) / 190 == pytest.approx(900.0 - 400.0 * (1.0 - 544e-6 * 181.0), abs=2.0)


@pytest.mark.parametrize("late", [0.0, 0.0013, 0.0026, 0.0039])
def test_the_accelerometer_shows_a_blow_between_two_of_its_readings(late: float) -> None:
    """Its low-pass spreads a blow over 10 ms, and keeps its sum but for what lies between two readings."""
    chip = Chip(StruckPlant(0.1, 0.5 + late))
    felt = 0.0
    for _ in range(1000):
        chip.wait(0.001)
        felt += 0.001 * chip.registers().accel[0] * STOCK.accel_m_s2
    assert felt == pytest.approx(-0.1, rel=0.35)


def test_the_accelerometer_of_raccoon_os_ends_at_2_g() -> None:
    chip = Chip(StruckPlant(0.5, 0.5), 21)
    felt = []
    for _ in range(100):
        chip.wait(0.01)
        felt.append(chip.telemetry().world_accel[0])
    assert min(felt) == pytest.approx(-2.0 * 9.80665)


def interrupted(work: Callable[[], object], line: int) -> bool:
    """Do something, with a KeyboardInterrupt before such a line of the emulator's; whether it got so far."""
    left = line

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal left
        if "emulator" not in frame.f_code.co_filename:
            return None
        left -= event == "line"
        if left < 0:
            raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_it_works_on_after_an_interruption_at_any_line(firmware: Firmware) -> None:
    robot = BenchRobot()
    chip = Chip(robot, firmware)
    outputs = Outputs((0.5, 0.5, 0.0, 0.0))
    drive = (
        stock_commands.encode(outputs, 0)
        if firmware == "stock"
        else raccoon_commands.encode(outputs, firmware)
    )

    def transfer() -> None:
        chip.clock.advance(0.005)
        chip.ask(drive)

    for work, step in ((chip.emulator.reset, 1), (transfer, 13)):
        line = 0
        while interrupted(work, line):
            line += step
        chip.wait(0.03)  # it boots
    assert line > 100
    for _ in range(20):
        transfer()
    assert min(robot.speeds[:2]) > 1.0
    told = chip.registers() if firmware == "stock" else chip.telemetry()
    assert min(map(abs, told.position[:2])) > 10.0  # it measures, too


def test_the_imu_smooths_each_axis_by_two_poles_one_behind_the_other() -> None:
    """Written out in the board, as it runs in every step: against the short form, and the textbook's step."""
    random, share = Random(4), -math.expm1(-0.00025 / IMU_POLE)

    def followed(value: float, before: float, after: float) -> float:
        return value + share * (0.5 * (before + after) - value)

    start = (0.1, -2.0, 9.81)
    smoothed = _LowPass(start)
    first: tuple[float, ...] = start
    second: tuple[float, ...] = start
    before = start
    for _ in range(200):
        after = (random.gauss(0.0, 1.0), random.gauss(0.0, 1.0), random.gauss(0.0, 10.0))
        smoothed.follow(before, after, share)
        ahead = tuple(map(followed, first, before, after))
        second = tuple(map(followed, second, first, ahead))
        first, before = ahead, after
        assert smoothed.value == second

    step = _LowPass((0.0, 0.0, 0.0))
    for tick in range(1, 101):
        step.follow((1.0, -2.0, 0.0), (1.0, -2.0, 0.0), share)
        late = tick * 0.00025 / IMU_POLE
        there = 1.0 - (1.0 + late) * math.exp(-late)
        assert step.value == pytest.approx((there, -2.0 * there, 0.0), abs=2e-3)
