"""An I2C bus below smbus2: it answers the ioctls of /dev/i2c-N with the registers of pretended chips."""

from __future__ import annotations

import ctypes
import errno
import math
from collections.abc import Callable
from typing import Any

import pytest

I2C_SLAVE, I2C_FUNCS, I2C_SMBUS = 0x0703, 0x0705, 0x0720
_BYTE, _I2C_BLOCK, _READ = 1, 8, 1


class Chip:
    """Byte registers with an address counter that runs on by itself."""

    def __init__(self) -> None:
        self.registers = bytearray(256)
        self.nacks = 0

    def read(self, register: int, count: int) -> bytes:
        return bytes(self.registers[register : register + count])

    def write(self, register: int, data: bytes) -> None:
        self.registers[register : register + len(data)] = data

    def answer(self) -> None:
        """Acknowledge the address, unless told to refuse a few times."""
        if self.nacks:
            self.nacks -= 1
            raise OSError(errno.EREMOTEIO, "Remote I/O error")


class MpuChip(Chip):
    """An MPU after power-up: asleep, so that its data registers hold zeros."""

    def __init__(self, identity: int = 0x70) -> None:
        super().__init__()
        self.registers[0x75] = identity
        self.registers[0x6B] = 0x40
        self.samples = 0
        self.noise = True
        self.motion = (0, 0, 0)
        self.force = (0, 0, 8192)

    def restart(self) -> None:
        """Lose power for a moment."""
        identity = self.registers[0x75]
        self.registers[:] = bytes(256)
        self.registers[0x75], self.registers[0x6B] = identity, 0x40

    def read(self, register: int, count: int) -> bytes:
        if register == 0x3B and not self.registers[0x6B] & 0x40:
            self.samples += self.noise
            wobble = round(8.0 * math.sin(self.samples))
            words = (*self.force[:2], self.force[2] + wobble, -1000, *self.motion)
            self.registers[0x3B:0x49] = b"".join(word.to_bytes(2, "big", signed=True) for word in words)
        return super().read(register, count)


class WordChip(Chip):
    """16-bit registers, as the INA monitors have them."""

    def __init__(self, words: dict[int, int]) -> None:
        super().__init__()
        self.words = dict(words)

    def read(self, register: int, count: int) -> bytes:
        return self.words.get(register, 0).to_bytes(2, "big")[:count]

    def write(self, register: int, data: bytes) -> None:
        self.words[register] = int.from_bytes(data, "big")


class Ina219Chip(WordChip):
    def __init__(self) -> None:
        super().__init__({0: 0x399F})

    def write(self, register: int, data: bytes) -> None:
        super().write(register, data)
        if register == 0 and self.words[0] & 0x8000:
            self.words[0] = 0x399F

    def measure(self, volts: float, shunt_volts: float) -> None:
        self.words[2] = round(volts / 4e-3) << 3 | 0b10  # conversion ready
        self.words[1] = round(shunt_volts / 10e-6) & 0xFFFF


class Ina226Chip(WordChip):
    def __init__(self) -> None:
        super().__init__({0: 0x4127, 0xFE: 0x5449, 0xFF: 0x2260})

    def measure(self, volts: float, shunt_volts: float) -> None:
        self.words[2] = round(volts / 1.25e-3)
        self.words[1] = round(shunt_volts / 2.5e-6) & 0xFFFF


class FakeI2c:
    """The kernel's side. stuck: every transfer times out. drivers: addresses the kernel keeps. bits: clocked
    on the wire by transfers, acknowledgements included."""

    def __init__(self, chips: dict[int, Chip]) -> None:
        self.chips = chips
        self.drivers: set[int] = set()
        self.stuck = False
        self.transfers = 0
        self.bits = 0
        self.on_select: Callable[[], None] = lambda: None
        self._selected: dict[int, int] = {}

    def put_in(self, monkeypatch: pytest.MonkeyPatch) -> FakeI2c:
        """In the place of the kernel, until the test ends."""
        monkeypatch.setattr("smbus2.smbus2.ioctl", self.ioctl)
        return self

    def ioctl(self, descriptor: int, request: int, argument: Any) -> int:
        if request == I2C_FUNCS:
            argument.value = 0x0EFF0008
        elif request == I2C_SLAVE:
            if argument in self.drivers:
                raise OSError(errno.EBUSY, "Device or resource busy")
            self._selected[descriptor] = argument
            self.on_select()
        elif request == I2C_SMBUS:
            self._transfer(self._selected[descriptor], argument)
        else:
            raise OSError(errno.EINVAL, f"no such ioctl: {request:#x}")
        return 0

    def _transfer(self, address: int, message: Any) -> None:
        self.transfers += 1
        if self.stuck:
            raise OSError(errno.ETIMEDOUT, "Connection timed out")
        if address not in self.chips:
            raise OSError(errno.ENXIO, "No such device or address")
        chip = self.chips[address]
        chip.answer()
        data = message.data.contents
        # Address and register; a reading begins again with the address.
        self.bits += 9 * (2 + data.block[0] + (message.read_write == _READ)) + 3
        if message.size == _BYTE:
            data.byte = 0
        elif message.size != _I2C_BLOCK:
            raise OSError(errno.EOPNOTSUPP, "Operation not supported")
        elif message.read_write == _READ:
            found = chip.read(message.command, data.block[0])
            ctypes.memmove(ctypes.addressof(data.block) + 1, found, len(found))
        else:
            chip.write(message.command, bytes(data.block[1 : 1 + data.block[0]]))
