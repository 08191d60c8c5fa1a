"""Every way in which a Wombat is known to fail, thrown at a robot that drives, and what must come of it.

The whole library takes part: a robot with its motions and odometry, its port, the bytes, the emulated
controller and the simulated robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.errors import HardwareError, MotionTimeout
from raccoon.core.readings import Fault, Inputs, Outputs, Status
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.emulator.raccoon_chip import RaccoonChip
from raccoon.hal.wombat.emulator.stock_chip import StockChip
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21
from raccoon.hal.wombat.firmware.devices import STOCK as STOCK_DEVICE
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.motions.goals import straight, turn
from raccoon.robot.opening import open_robot
from raccoon.robot.robot import Robot
from raccoon.sim.effects.parameters import Parameters

ALL: tuple[Firmware, ...] = ("stock", 17, 21)
RACCOON: tuple[Firmware, ...] = (17, 21)
STOCK: tuple[Firmware, ...] = ("stock",)
REST_CYCLES, FAULT_CYCLE = 100, 200
DISTANCE, ANGLE, LAST_DISTANCE = 0.15, math.radians(20.0), 0.02
SPEED = 0.2
FORGIVEN, FORGIVEN_TURN = 0.0005, math.radians(0.1)
"""m and rad that no deviation needs to account for."""
DEVICES = {"stock": STOCK_DEVICE, 17: RACCOON_17, 21: RACCOON_21}


def calibrated(firmware: Firmware) -> RobotConfig:
    """A robot whose wheels are known to 0.3 %, so that its odometry claims much."""
    device, config = DEVICES[firmware], RobotConfig()
    tick = device.position_counts_seconds * device.bemf_volts / config.model.left.back_emf_constant.value
    motor = MotorConfig(
        radians_per_tick=Measured(tick, 0.003 * tick), bemf_offset=Measured(0.0, 1.0), inverted=False
    )
    return replace(config, motors={0: motor, 1: motor})


class Bench:
    """A robot on an emulated Wombat. It is the robot's port, too, and sees each cycle from both sides."""

    def __init__(self, case: Case, firmware: Firmware) -> None:
        self.case = case
        self.config = calibrated(firmware)
        self.clock = SteppedClock()
        self.plant = SimulatedPlant(Parameters.from_robot(self.config))
        self.emulator = Emulator(self.plant, firmware, clock=self.clock, build=case.build)
        self.firmware = firmware
        case.prepare(self)
        self.port = WombatPort(self.emulator, clock=self.clock, reset_line=self.emulator, watch_analog=(0, 1))
        self.robot: Robot | None = None
        self.result = Result()
        self.cycle = 0
        self._lost = False
        broken = case.prepare is not nothing or case.build != "shipped"
        self._start = 0 if broken else FAULT_CYCLE

    def drive(self) -> None:
        """The mission: rest as before a match, straight on, turn, straight on."""
        with open_robot(self.config, port=self) as robot:
            self.robot = robot
            for _ in range(REST_CYCLES):
                robot.tick()
            robot.run(straight(DISTANCE, self.case.speed))
            robot.run(turn(ANGLE))
            robot.run(straight(LAST_DISTANCE, self.case.speed))
            for _ in range(40):
                robot.tick()

    def read(self) -> Inputs:
        if self.cycle == FAULT_CYCLE:
            self.case.inject(self)
        self.cycle += 1
        try:
            inputs = self.port.read()
        except HardwareError:
            self._lost = True
            raise
        self.result.faults.update(inputs.faults)
        self.result.last_faults = inputs.faults
        if inputs.faults:
            self.detect()
        return inputs

    def write(self, outputs: Outputs) -> None:
        self._judge()
        self.port.write(outputs)

    def close(self) -> None:
        self.port.close()

    def detect(self) -> None:
        """The library has noticed."""
        if self.result.detected is None:
            self.result.detected = self.cycle - 1 - self._start

    def _judge(self) -> None:
        """Compare what the robot believes with where it is."""
        if self.robot is None or self._lost:
            return
        believed, result = self.robot.estimate, self.result
        x, y, heading = self.plant.pose
        apart = math.hypot(believed.x - x, believed.y - y)
        result.end_error_mm, result.status = 1000.0 * apart, believed.status
        if believed.status is not Status.OK:
            self.detect()
            return
        turned = abs(believed.heading - heading)
        result.good_error_mm = max(result.good_error_mm, 1000.0 * apart)
        result.good_turn_deg = max(result.good_turn_deg, math.degrees(turned))
        if self.cycle > self._start and result.detected is None and self.case.expect is not None:
            return  # nobody can know yet
        spread = math.hypot(believed.x_std, believed.y_std, FORGIVEN)
        result.good_sigmas = max(
            result.good_sigmas, apart / spread, turned / math.hypot(believed.heading_std, FORGIVEN_TURN)
        )


@dataclass(slots=True)
class Result:
    """What came of a case. detected: cycles from the fault to the first sign of it."""

    faults: set[Fault] = field(default_factory=set)
    detected: int | None = None
    error: str | None = None
    gave_up: bool = False
    last_faults: tuple[Fault, ...] = ()
    status: Status = Status.OK
    good_error_mm: float = 0.0
    """Worst error of the place while its status was ok."""
    good_turn_deg: float = 0.0
    """Worst error of the heading while its status was ok."""
    good_sigmas: float = 0.0
    """Worst error of either in its own standard deviations, while its status was ok and the fault noticed."""
    end_error_mm: float = 0.0
    running: bool = False

    @property
    def reaction(self) -> str:
        if self.gave_up:
            return "given up"
        if self.error is not None:
            return "stopped"
        if self.last_faults or self.status is not Status.OK:
            return "degraded"
        return "recovered" if self.faults else "unaffected"


def nothing(_bench: Bench) -> None:
    """Leave it alone."""


@dataclass(frozen=True, slots=True)
class Case:
    """One fault. prepare: before the port is opened. inject: while it drives. expect: the fault reported,
    None where there is nothing to report.

    reaction: unaffected; recovered: said, and all is well again at the end; degraded: said until the end;
    given up: said, and the motion ends with MotionTimeout; stopped: HardwareError. speed: m/s of the mission.
    """

    name: str
    reaction: str
    expect: Fault | None
    inject: Callable[[Bench], None] = nothing
    prepare: Callable[[Bench], None] = nothing
    firmwares: tuple[Firmware, ...] = ALL
    speed: float = SPEED
    build: Literal["shipped", "published"] = "shipped"


def run(case: Case, firmware: Firmware) -> Result:
    """Rest, drive, break, drive on, close; then look whether a motor runs."""
    bench = Bench(case, firmware)
    result = bench.result
    try:
        bench.drive()
    except (HardwareError, MotionTimeout) as error:
        result.error, result.gave_up = str(error), isinstance(error, MotionTimeout)
        bench.detect()
    finally:
        bench.close()
    bench.clock.advance(0.1)
    bench.emulator.run()
    result.running = bench.emulator.motors_running
    return result


GOOD_ERROR_MM, GOOD_TURN_DEG, GOOD_SIGMAS = 8.0, 2.0, 4.0
"""A pose that is called ok may be off by no more: the first two at any time, also in the cycles before a
fault can be noticed; the third, which the pose itself promises, from then on."""


def is_as_documented(case: Case, result: Result) -> bool:
    """Whether it ended as it must: named, with no motor running and no wrong pose called ok."""
    named = case.expect is None or case.expect in result.faults
    stopped_by_name = (result.error or "").startswith(case.expect or "-")
    wrong_pose = result.good_error_mm > GOOD_ERROR_MM or result.good_turn_deg > GOOD_TURN_DEG
    return (
        result.reaction == case.reaction
        and (named or stopped_by_name)
        and not (result.running or wrong_pose or result.good_sigmas > GOOD_SIGMAS)
    )


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


def sag(volts: float) -> Callable[[Bench], None]:
    def weaken(bench: Bench) -> None:
        pack = replace(bench.config.model.battery, open_circuit_voltage=Measured(volts, 0.1))
        model = replace(bench.config.model, battery=pack)
        bench.plant.become(Parameters.from_robot(replace(bench.config, model=model)))

    return weaken


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


def _stall(bench: Bench) -> None:
    """The program does not run for 0.2 s between asking for the time and the transfer."""
    original = bench.emulator.transfer

    def late(frame: bytes) -> bytes:
        bench.emulator.transfer = original  # type: ignore[method-assign]
        bench.clock.advance(0.2)
        return original(frame)

    bench.emulator.transfer = late  # type: ignore[method-assign]


def _second_owner(bench: Bench) -> None:
    """Another program writes its own motor command after each of ours."""
    original = bench.emulator.transfer
    length = bench.port.dialect.length
    theirs = bytes(length)
    if bench.firmware == "stock":
        theirs = stock_commands.frame(
            [*stock_commands.duty_register(0, 123), *stock_commands.directions((2, 1, 0, 0))]
        )

    def contested(frame: bytes) -> bytes:
        reply = original(frame)
        if len(frame) == length and frame != bytes(length) and bench.port._failure is None:
            original(theirs)
        return reply

    bench.emulator.transfer = contested  # type: ignore[method-assign]


CASES = [
    Case("nothing wrong", "unaffected", None),
    Case("frames shifted by 37 bytes", "recovered", Fault.MISALIGNED, _shift(37)),
    Case("frames shifted by 1 byte", "recovered", Fault.MISALIGNED, _shift(1)),
    Case("controller restarts", "recovered", Fault.RESET, _reset),
    Case("brown-out, restarts for ever", "stopped", Fault.LINK_DEAD, _set(brown_out_voltage=20.0)),
    Case("battery sags to 5.4 V", "degraded", Fault.BROWN_OUT, sag(5.4)),
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
    Case("fuse of the left motor", "given up", Fault.MOTOR_FAULT, _set(blown_fuse={0})),
    Case("right motor stalls", "given up", Fault.MOTOR_FAULT, _set(stalled={1})),
    Case("converters of both motors stop", "given up", Fault.BEMF_FROZEN, _set(stopped_converters={0, 1})),
    Case("converter of the right motor stops", "given up", Fault.BEMF_FROZEN, _set(stopped_converters={1})),
    Case("watched analog port saturates", "degraded", Fault.ANALOG_SATURATED, _set(saturated={1: 4095})),
    Case("analog port floats", "unaffected", None, _set(floating={0})),
    Case(
        "back-EMF offset of 55 counts",
        "degraded",
        Fault.BEMF_INVALID,
        prepare=_set(bemf_offset=(55.0, 0.0, 0.0, 0.0)),
    ),
    Case("back-EMF beyond 2000 counts", "recovered", Fault.BEMF_INVALID, sag(22.0), firmwares=RACCOON),
    Case("cycle 30 ms late", "recovered", Fault.OVERRUN, _late),
    Case("0.2 s pass in a transfer", "recovered", Fault.OVERRUN, _stall),
    Case("another program commands", "stopped", Fault.COMMAND_LOST, _second_owner, firmwares=STOCK),
    Case("another program sends zeros", "given up", Fault.MOTOR_FAULT, _second_owner, firmwares=RACCOON),
    Case("every transfer 4 ms late", "degraded", Fault.OVERRUN, _set(latency=0.004)),
    Case("IMU once a second", "degraded", None, firmwares=STOCK, build="published"),
]
