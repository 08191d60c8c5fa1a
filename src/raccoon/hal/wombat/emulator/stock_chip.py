"""The co-processor with the stock firmware: its registers and its main loop."""

from __future__ import annotations

from collections.abc import Callable

from raccoon.core.readings import ANALOG_PORTS, MOTOR_PORTS, SERVO_PORTS
from raccoon.hal.wombat.emulator.board import Board
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import COAST, Drive
from raccoon.hal.wombat.emulator.stock_motors import StockMotors
from raccoon.hal.wombat.firmware.devices import STOCK
from raccoon.hal.wombat.firmware.stock import commands, wire

IMU_EVERY = {"shipped": 5, "published": 1000}
"""Main-loop passes per reading of the IMU, by build."""

PASS_SECONDS = 700e-6
"""Duration of a main-loop pass, s."""
IMU_PASS_SECONDS = 1350e-6
"""Duration of a pass that reads the IMU, s: it waits 1 ms for the magnetometer."""
CONVERSION_SECONDS = 192e-6
IDLE_SECONDS = 234e-6

BATTERY_BOOT = 800


class StockChip:
    """The registers and the loop that works on them."""

    frame_length = wire.LENGTH

    def __init__(self, board: Board, faults: Faults, build: str) -> None:
        self._board = board
        self._faults = faults
        self._imu_every = IMU_EVERY[build]
        self.reset()

    def reset(self) -> None:
        """State after power-on: all registers at their boot values, motors off."""
        registers = bytearray(wire.REGISTERS)
        self.registers, self.motors = registers, StockMotors(registers)
        self.registers[:3] = wire.MAGIC
        self.registers[wire.ALLSTOP] = commands.SERVOS_OFF
        for port in range(SERVO_PORTS):
            self.store(wire.SERVO + 2 * port, commands.SERVO_BOOT_US)
        self.store(wire.BATTERY, BATTERY_BOOT)
        self.crashed = False
        self._drives: tuple[Drive, ...] = COAST
        self._coasting = False
        self._passes = 0
        self._next: Callable[[], float] = self._sampling
        self._remaining = self._next()

    @property
    def powered(self) -> bool:
        """Whether any motor is driven, apart from the pauses for measuring."""
        return any(self._drives)

    @property
    def servo_us(self) -> tuple[int | None, ...]:
        """Pulse of each servo port, us, None if it is off."""
        off = self.registers[wire.ALLSTOP]
        return tuple(
            None if off >> 4 + port & 1 else self.load(wire.SERVO + 2 * port) for port in range(SERVO_PORTS)
        )

    def store(self, register: int, value: int, size: int = 2) -> None:
        """Write a big-endian number."""
        wrapped = value & (1 << 8 * size) - 1
        self.registers[register : register + size] = wrapped.to_bytes(size, "big")

    def load(self, register: int) -> int:
        """Read an unsigned 16-bit number."""
        return self.registers[register] << 8 | self.registers[register + 1]

    def image(self) -> bytes:
        """The frame that the next transfer sends: the first 89 registers as they are now."""
        return bytes(self.registers[: wire.LENGTH])

    def accept(self, frame: bytes) -> None:
        """Process one complete frame, if its marks are right.

        The firmware checks neither the number of pairs nor their addresses: writes beyond the registers hit
        its memory, and the emulated chip hangs.
        """
        if frame[0] != wire.START or frame[wire.LENGTH - 1] != commands.END:
            return
        if frame[1] != commands.PROTOCOL_VERSION or self._faults.wrong_version:
            return
        registers = self.registers
        for index in range(4, 4 + (2 * frame[3] & 0xFF), 2):
            if index + 1 >= wire.LENGTH or frame[index] >= wire.REGISTERS:
                self.crashed = True
                return
            registers[frame[index]] = frame[index + 1]
            if frame[index] == wire.MOT_MODES:
                self.motors.modes_written()

    def advance(self, seconds: float) -> None:
        """Run the firmware for `seconds`. A frozen main loop leaves the drivers in their state."""
        if self._faults.frozen or self.crashed:
            self._board.advance(seconds, COAST if self._coasting else self._drives)
            return
        self._remaining -= seconds
        while self._remaining <= 0.0:
            self._remaining += self._next()

    # The parts of the main loop: each returns its duration, s, and sets the next part. If one raises
    # (Ctrl-C), it is repeated.

    def _sampling(self) -> float:
        count = self._passes + 1
        measuring = count % 4 == 1
        reads_imu = count % self._imu_every == 0
        self._sample()
        seconds = self._pass(IMU_PASS_SECONDS if reads_imu else PASS_SECONDS, coast=measuring)
        self._passes = count
        self._next = self._measuring if measuring else self._idling
        return seconds

    def _idling(self) -> float:
        self._look_at_imu()
        seconds = self._pass(IDLE_SECONDS, coast=False)
        self._next = self._sampling
        return seconds

    def _measuring(self) -> float:
        self._look_at_imu()
        seconds = self._pass(CONVERSION_SECONDS, coast=True)
        self._next = self._controlling
        return seconds

    def _controlling(self) -> float:
        self._control()
        seconds = self._pass(IDLE_SECONDS - CONVERSION_SECONDS, coast=False)
        self._next = self._sampling
        return seconds

    def _pass(self, seconds: float, *, coast: bool) -> float:
        self._coasting = coast
        self._board.advance(seconds, COAST if coast else self._drives)
        return seconds

    def _control(self) -> None:
        raw = self._board.bemf_all()
        offset = self._faults.bemf_offset
        channels = [round(raw[wire.CHANNEL[n]] + offset[wire.CHANNEL[n]]) for n in range(MOTOR_PORTS)]
        drives = self.motors.update(channels)
        self._drives = tuple(drives[channel] for channel in wire.CHANNEL)

    def _sample(self) -> None:
        board = self._board
        up = 0 if board.state.button else 1 << wire.RIGHT_BUTTON
        self.store(wire.DIG_IN, board.digital_bits() | up)
        registers = self.registers
        for port in range(ANALOG_PORTS):  # without `load` and `store`: this is a tenth of the emulator's time
            high = wire.ADC_0 + 2 * port
            low = high + 1
            value = int(0.9 * (registers[high] << 8 | registers[low]) + 0.1 * board.analog(port))
            registers[high], registers[low] = value >> 8, value & 0xFF
        self.store(wire.BATTERY, int(0.95 * self.load(wire.BATTERY) + 0.05 * board.battery()))

    def _look_at_imu(self) -> None:
        if self._passes % self._imu_every == 0:
            self._read_imu()

    def _read_imu(self) -> None:
        missing = self._faults.imu_missing
        if missing is not None:
            for register in range(wire.ACCEL, wire.GYRO + 6, 2):
                self.store(register, missing)
            return
        if self._faults.imu_frozen:
            return
        # The chip lies with z down, x to the robot's left and y ahead.
        forward, left, up = self._board.accel()
        self._store_axes(wire.ACCEL, (left, forward, -up), STOCK.accel_m_s2)
        forward, left, up = self._board.gyro()
        self._store_axes(wire.GYRO, (left, forward, -up), STOCK.gyro_rad_s)

    def _store_axes(self, register: int, axes: tuple[float, ...], scale: float) -> None:
        for axis, value in enumerate(axes):
            self.store(register + 2 * axis, max(-32768, min(32767, round(value / scale))))
