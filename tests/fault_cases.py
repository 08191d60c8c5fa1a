"""Every way in which a Wombat is known to fail, thrown at a port that drives, and what must come of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from bench_robot import TRACK_WIDTH, WHEEL_RADIUS, BenchRobot
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import HardwareError
from raccoon.core.readings import STOP, Fault, Inputs, Outputs
from raccoon.hal.wombat import stock, stock_command
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.emulator.raccoon_chip import RaccoonChip
from raccoon.hal.wombat.emulator.stock_chip import StockChip
from raccoon.hal.wombat.port import WombatPort

ALL: tuple[Firmware, ...] = ("stock", 17, 21)
RACCOON: tuple[Firmware, ...] = (17, 21)
STOCK: tuple[Firmware, ...] = ("stock",)
REST_CYCLES, FAULT_CYCLE, CYCLES = 120, 200, 340
DUTY = 0.5
K_E = 1.08


class Bench:
    """A robot on an emulated Wombat and a port that drives it straight by gyro, with a dead reckoning."""

    def __init__(self, firmware: Firmware, prepare: Callable[[Bench], None]) -> None:
        self.clock = SteppedClock()
        self.robot = BenchRobot()
        self.emulator = Emulator(self.robot, firmware, clock=self.clock)
        self.firmware = firmware
        prepare(self)
        self.port = WombatPort(self.emulator, clock=self.clock, reset_line=self.emulator, watch_analog=(0, 1))
        self.distance = self.heading = 0.0
        self._ticks: tuple[float, float] | None = None
        self._gyro: tuple[float, float] | None = None

    def reckon(self, inputs: Inputs) -> None:
        device = inputs.device
        if inputs.position[0] is not None and inputs.position[1] is not None:
            ticks = inputs.position[0], inputs.position[1]
            if self._ticks is not None:
                metres = device.position_counts_seconds * device.bemf_volts / K_E * WHEEL_RADIUS
                left, right = (metres * (new - old) for new, old in zip(ticks, self._ticks, strict=True))
                self.distance += 0.5 * (left + right)
                if self._gyro is None or inputs.time - self._gyro[0] > 0.1:
                    self.heading += (right - left) / TRACK_WIDTH
            self._ticks = ticks
        if inputs.turn_rate is not None:
            if self._gyro is not None:
                self.heading += 0.5 * (inputs.turn_rate + self._gyro[1]) * (inputs.time - self._gyro[0])
            self._gyro = inputs.time, inputs.turn_rate

    @property
    def error_mm(self) -> float:
        """Distance between the reckoned and the true position."""
        x, y = self.distance * math.cos(self.heading), self.distance * math.sin(self.heading)
        return 1000.0 * math.hypot(x - self.robot.x, y - self.robot.y)

    def drive(self, cycle: int) -> Outputs:
        if cycle < REST_CYCLES:
            return STOP
        steer = max(-0.2, min(0.2, 2.0 * self.heading))
        return Outputs(duty=(DUTY + steer, DUTY - steer, 0.0, 0.0))


@dataclass(slots=True)
class Result:
    """What came of a case. detected: cycles from the fault to the first sign of it."""

    faults: set[Fault] = field(default_factory=set)
    detected: int | None = None
    error: str | None = None
    last_faults: tuple[Fault, ...] = ()
    good_error_mm: float = 0.0
    """Worst error of the pose while nothing was reported."""
    end_error_mm: float = 0.0
    running: bool = False

    @property
    def reaction(self) -> str:
        if self.error is not None:
            return "stopped"
        if self.last_faults:
            return "degraded"
        return "recovered" if self.faults else "unaffected"


def nothing(_bench: Bench) -> None:
    """Leave it alone."""


@dataclass(frozen=True, slots=True)
class Case:
    """One fault. prepare: before the port is opened. inject: while it drives. expect: the fault reported,
    None where there is nothing to report. reaction: unaffected, recovered, degraded or stopped."""

    name: str
    reaction: str
    expect: Fault | None
    inject: Callable[[Bench], None] = nothing
    prepare: Callable[[Bench], None] = nothing
    firmwares: tuple[Firmware, ...] = ALL


def run(case: Case, firmware: Firmware) -> Result:
    """Rest, drive, break, drive on, close."""
    bench = Bench(firmware, case.prepare)
    result = Result()
    start = 0 if case.prepare is not nothing else FAULT_CYCLE
    try:
        for cycle in range(CYCLES):
            if cycle == FAULT_CYCLE:
                case.inject(bench)
            inputs = bench.port.read()
            _judge(result, bench, inputs, cycle - start)
            bench.port.write(bench.drive(cycle))
    except HardwareError as error:
        result.error = str(error)
        if result.detected is None:
            result.detected = cycle - start
    finally:
        result.end_error_mm = bench.error_mm
        bench.port.close()
    bench.clock.advance(0.1)
    bench.emulator.run()
    result.running = bench.emulator.motors_running
    return result


def _judge(result: Result, bench: Bench, inputs: Inputs, since: int) -> None:
    bench.reckon(inputs)
    result.faults.update(inputs.faults)
    result.last_faults = inputs.faults
    if inputs.faults and result.detected is None:
        result.detected = since
    if result.detected is None:
        result.good_error_mm = max(result.good_error_mm, bench.error_mm)


def _set(**switches: object) -> Callable[[Bench], None]:
    def throw(bench: Bench) -> None:
        for name, value in switches.items():
            setattr(bench.emulator.faults, name, value)

    return throw


def _shift(count: int) -> Callable[[Bench], None]:
    def shift(bench: Bench) -> None:
        bench.emulator.transfer(bytes(count))

    return shift


def _reset(bench: Bench) -> None:
    bench.emulator.reset()


def _silence_shortly(bench: Bench) -> None:
    """Dead for 50 ms of the clock: the switch goes back when the clock has moved on."""
    faults, clock = bench.emulator.faults, bench.clock
    end = clock.now() + 0.05
    faults.silent = 0xFF
    original = bench.emulator.run

    def run_and_recover() -> None:
        if clock.now() > end:
            faults.silent = None
        original()

    bench.emulator.run = run_and_recover  # type: ignore[method-assign]


def _sag(volts: float) -> Callable[[Bench], None]:
    def sag(bench: Bench) -> None:
        bench.robot.open_circuit_voltage = volts

    return sag


def _near_wrap(bench: Bench) -> None:
    chip = bench.emulator.chip
    if isinstance(chip, StockChip):
        for channel in range(4):
            chip.store(stock.MOT_POS + 4 * channel, 0x7FFF_FFFF - 20_000, 4)
        return
    assert isinstance(chip, RaccoonChip)
    for motor in chip.motors.motors:
        motor._count = float(-0x8000_0000 + (50 if bench.firmware == 21 else 10_000))


def _clock_near_wrap(bench: Bench) -> None:
    assert isinstance(bench.emulator.chip, RaccoonChip)
    bench.emulator.chip._clock = (2**32 - 1_500_000) / 1e6


def _late(bench: Bench) -> None:
    bench.clock.advance(0.03)


def _second_owner(bench: Bench) -> None:
    """Another program writes its own motor command after each of ours."""
    original = bench.emulator.transfer
    theirs = stock_command.frame(
        [*stock_command.duty_register(0, 123), *stock_command.directions((2, 1, 0, 0))]
    )

    def contested(frame: bytes) -> bytes:
        reply = original(frame)
        if len(frame) == stock.LENGTH and frame != bytes(stock.LENGTH) and bench.port._failure is None:
            original(theirs)
        return reply

    bench.emulator.transfer = contested  # type: ignore[method-assign]


CASES = [
    Case("nothing wrong", "unaffected", None),
    Case("frames shifted by 37 bytes", "recovered", Fault.MISALIGNED, _shift(37)),
    Case("frames shifted by 1 byte", "recovered", Fault.MISALIGNED, _shift(1)),
    Case("controller restarts", "recovered", Fault.RESET, _reset),
    Case("brown-out, restarts for ever", "stopped", Fault.LINK_DEAD, _set(brown_out_voltage=20.0)),
    Case("battery sags to 5.4 V", "degraded", Fault.BROWN_OUT, _sag(5.4)),
    Case("link silent (0xFF) for 50 ms", "recovered", Fault.LINK_DEAD, _silence_shortly),
    Case("link dead, all 0x00", "stopped", Fault.LINK_DEAD, _set(silent=0x00)),
    Case("link dead, all 0xFF", "stopped", Fault.LINK_DEAD, _set(silent=0xFF)),
    Case("other protocol version", "stopped", Fault.COMMAND_LOST, _set(wrong_version=True), firmwares=STOCK),
    Case("other protocol version", "stopped", Fault.LINK_DEAD, _set(wrong_version=True), firmwares=RACCOON),
    Case("transfer engine overrun", "stopped", Fault.LINK_DEAD, _set(overrun=True), firmwares=RACCOON),
    Case("torn read", "recovered", Fault.TORN, _set(torn_reads=1)),
    Case("lost write", "recovered", Fault.COMMAND_LOST, _set(lost_writes=2), firmwares=STOCK),
    Case("lost write", "unaffected", None, _set(lost_writes=2), firmwares=RACCOON),
    Case("position counter wraps", "unaffected", None, prepare=_near_wrap),
    Case("microsecond clock wraps", "unaffected", None, prepare=_clock_near_wrap, firmwares=RACCOON),
    Case("main loop hangs", "stopped", Fault.STALE, _set(frozen=True)),
    Case("IMU frozen", "degraded", Fault.IMU_FROZEN, _set(imu_frozen=True)),
    Case("IMU missing, reads 0", "degraded", Fault.IMU_FROZEN, _set(imu_missing=0)),
    Case("IMU missing, reads -1", "degraded", Fault.IMU_FROZEN, _set(imu_missing=-1), firmwares=STOCK),
    Case("gyro wanders at rest", "degraded", Fault.IMU_IMPLAUSIBLE, prepare=_set(gyro_sweep=True)),
    Case("fuse of the left motor", "degraded", Fault.MOTOR_FAULT, _set(blown_fuse={0})),
    Case("right motor stalls", "degraded", Fault.MOTOR_FAULT, _set(stalled={1})),
    Case("watched analog port saturates", "degraded", Fault.ANALOG_SATURATED, _set(saturated={1: 4095})),
    Case("analog port floats", "unaffected", None, _set(floating={0})),
    Case(
        "back-EMF offset of 55 counts",
        "degraded",
        Fault.BEMF_INVALID,
        prepare=_set(bemf_offset=(55.0, 0.0, 0.0, 0.0)),
    ),
    Case("back-EMF beyond 2000 counts", "degraded", Fault.BEMF_INVALID, _sag(22.0), firmwares=RACCOON),
    Case("cycle 30 ms late", "recovered", Fault.OVERRUN, _late),
    Case("another program commands", "stopped", Fault.COMMAND_LOST, _second_owner, firmwares=STOCK),
]
