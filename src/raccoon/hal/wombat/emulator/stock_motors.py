"""Back-EMF filter, counters and motor controllers of the stock firmware, channel by channel."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from raccoon.core.readings import MOTOR_PORTS
from raccoon.hal.wombat.emulator.plant import Drive
from raccoon.hal.wombat.firmware.stock import wire
from raccoon.hal.wombat.firmware.stock.commands import FULL_PWM, Direction, Mode

FILTER_NEW, FILTER_OLD = 0.25, 0.75
FILTER_DEAD_ZONE = 10
"""Filtered back-EMF below which the filter gives 0, counts."""
FEEDBACK_DEAD_ZONE = 8
"""Raw back-EMF below which the speed control takes 0, counts."""
KP, KI, KD = 2000 / 1000, 200 / 1000, 1 / 1000
"""Gains of the speed control, read once at boot: writing the gain registers later changes nothing."""
INTEGRAL_LIMIT = 10000

_INT32 = struct.Struct(">i")
_INT16 = struct.Struct(">h")
_UINT16 = struct.Struct(">H")


class StockMotors:
    """The part of the firmware that runs after every back-EMF measurement, on the registers shared with the
    link."""

    def __init__(self, registers: bytearray) -> None:
        self._registers = registers
        self._filtered = [0] * MOTOR_PORTS
        self._integral = [0.0] * MOTOR_PORTS
        self._error = [0.0] * MOTOR_PORTS

    def modes_written(self) -> None:
        """Process a write to the modes: a mode other than PWM clears the channel's flag "goal reached"."""
        modes = self._registers[wire.MOT_MODES]
        for channel in range(MOTOR_PORTS):
            if modes >> 2 * channel & 3:
                self._registers[wire.MOT_DONE] &= ~(1 << channel)

    def update(self, raw: Sequence[int]) -> list[Drive]:
        """One control pass with the new conversions (counts by channel); returns the drivers' states by
        channel."""
        return [self._channel(channel, raw[channel]) for channel in range(MOTOR_PORTS)]

    def _channel(self, channel: int, raw: int) -> Drive:
        self._integrate(channel, raw)
        registers = self._registers
        if registers[wire.ALLSTOP] >> channel & 1:
            self._set_output(channel, Direction.COAST, 0)
        else:
            mode = registers[wire.MOT_MODES] >> 2 * channel & 3
            if mode == Mode.SPEED:
                self._speed_control(channel, raw)
            elif mode != Mode.PWM:
                self._position_control(channel, raw)
        return self._drive(channel)

    def _integrate(self, channel: int, raw: int) -> None:
        """Filter a conversion and add it to the counter: EMA truncated to whole counts, dead zone, and a
        32-bit sum without regard to time."""
        filtered = int(FILTER_NEW * raw + FILTER_OLD * self._filtered[channel])
        if abs(filtered) < FILTER_DEAD_ZONE:
            filtered = 0
        self._filtered[channel] = filtered
        total = self._position(channel) + filtered
        wrapped = (total + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000
        _INT32.pack_into(self._registers, wire.MOT_POS + 4 * channel, wrapped)

    def _position(self, channel: int) -> int:
        position: int = _INT32.unpack_from(self._registers, wire.MOT_POS + 4 * channel)[0]
        return position

    def _goal(self, channel: int) -> int:
        goal: int = _INT16.unpack_from(self._registers, wire.SPEED_GOAL + 2 * channel)[0]
        return goal

    def _speed_control(self, channel: int, raw: int) -> None:
        feedback = 0 if abs(raw) < FEEDBACK_DEAD_ZONE else raw
        error = self._goal(channel) - feedback
        integral = max(-INTEGRAL_LIMIT, min(INTEGRAL_LIMIT, self._integral[channel] + error))
        command = int(KP * error + KI * integral + KD * (error - self._error[channel]))
        self._integral[channel], self._error[channel] = integral, error
        command = max(-FULL_PWM, min(FULL_PWM, command))
        self._set_output(channel, Direction.FORWARD if command >= 0 else Direction.REVERSE, abs(command))

    def _position_control(self, channel: int, raw: int) -> None:
        """Speed control until the goal is passed; then the motor is shorted and flagged as done."""
        if self._registers[wire.MOT_DONE] >> channel & 1:
            return
        goal = _INT32.unpack_from(self._registers, wire.POS_GOAL + 4 * channel)[0]
        position = self._position(channel)
        if position < goal if self._goal(channel) < 0 else position > goal:
            self._registers[wire.MOT_DONE] |= 1 << channel
            self._set_output(channel, Direction.FORWARD, 0)
        else:
            self._speed_control(channel, raw)

    def _set_output(self, channel: int, direction: Direction, pwm: int) -> None:
        shift = 2 * channel
        self._registers[wire.MOT_DIRS] = self._registers[wire.MOT_DIRS] & ~(3 << shift) | direction << shift
        _UINT16.pack_into(self._registers, wire.PWM + shift, pwm)

    def _drive(self, channel: int) -> Drive:
        direction = self._registers[wire.MOT_DIRS] >> 2 * channel & 3
        if direction == Direction.COAST:
            return None
        if direction == Direction.BRAKE:
            return 0.0
        pwm: int = _UINT16.unpack_from(self._registers, wire.PWM + 2 * channel)[0]
        duty = min(pwm, FULL_PWM) / FULL_PWM
        return duty if direction == Direction.FORWARD else -duty
