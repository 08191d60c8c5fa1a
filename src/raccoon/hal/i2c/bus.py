"""An I2C bus of the computer, safe for several threads, with error messages that say what to check."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable, Mapping
from typing import Protocol

from raccoon.core.errors import ConfigError, HardwareError

WOMBAT_RESERVED: Mapping[int, str] = {
    0x48: "the touch controller TSC2007",
    0x50: "the EEPROM AT24CS01",
    0x58: "the serial number in the EEPROM",
    0x68: "the clock DS1340",
}
"""Addresses of a Wombat's own devices on bus 1."""
BLOCK_LIMIT = 32
"""Largest SMBus block transfer, bytes."""
_FIRST_ADDRESS, _LAST_ADDRESS = 0x08, 0x77  # the others are reserved by the I2C specification


class Smbus(Protocol):
    """The part of `smbus2.SMBus` that a bus uses."""

    def read_byte(self, i2c_addr: int, /) -> int: ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, /) -> list[int]: ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int], /) -> None: ...

    def close(self) -> None: ...


def open_smbus(path: str) -> Smbus:
    """Open a bus by its device file."""
    import smbus2

    bus: Smbus = smbus2.SMBus(path)
    return bus


class I2cBus:
    """Access to the registers of devices on one bus. The kernel's time-out bounds every transfer (1 s on a
    Raspberry Pi).

    smbus2 keeps the address of the last transfer in its object: without the lock one thread could address a
    device and another thread transfer to it. bus: number of /dev/i2c-N, or a path. reserved: addresses that
    belong to the board itself. Raises HardwareError if the bus cannot be opened.
    """

    def __init__(
        self,
        bus: int | str = 1,
        *,
        reserved: Mapping[int, str] = WOMBAT_RESERVED,
        opener: Callable[[str], Smbus] = open_smbus,
    ) -> None:
        self.path = bus if isinstance(bus, str) else f"/dev/i2c-{bus}"
        self._reserved = reserved
        self._lock = threading.Lock()
        try:
            self._smbus: Smbus | None = opener(self.path)
        except OSError as error:
            raise HardwareError(f"I2C bus {self.path}: {_opening_reason(error)}") from error

    def claim(self, address: int, device: str) -> None:
        """Check that `device` may use `address`; raises ConfigError if it is out of range or the board's
        own."""
        if not _FIRST_ADDRESS <= address <= _LAST_ADDRESS:
            raise ConfigError(f"{device} at {address:#04x}: allowed are the addresses 0x08 to 0x77")
        if address in self._reserved:
            raise ConfigError(
                f"{device} at {address:#04x}: {self._reserved[address]} is there already; "
                "strap the device to another address"
            )

    def read(self, address: int, register: int, count: int) -> bytes:
        """Read `count` bytes (1..32) from `register` on. Raises HardwareError if the device does not answer,
        ValueError for another count."""
        if not 1 <= count <= BLOCK_LIMIT:
            raise ValueError(f"count is {count}: allowed are 1 to {BLOCK_LIMIT} bytes")
        with self._lock:
            try:
                data = bytes(self._opened().read_i2c_block_data(address, register, count))
            except OSError as error:
                raise self._failed(address, error) from error
        if len(data) != count:
            raise HardwareError(
                f"I2C bus {self.path}, address {address:#04x}: {len(data)} bytes of {count} came back"
            )
        return data

    def write(self, address: int, register: int, data: bytes) -> None:
        """Write `data` from `register` on. Raises HardwareError if the device does not answer."""
        with self._lock:
            try:
                self._opened().write_i2c_block_data(address, register, list(data))
            except OSError as error:
                raise self._failed(address, error) from error

    def scan(self) -> dict[int, str]:
        """Addresses in use and what is there: "device", "kernel driver", or the name of the board's own
        device.

        Reads one byte from every address, which changes nothing in the devices known here. Raises
        HardwareError if the bus is stuck.
        """
        found = {}
        for address in range(_FIRST_ADDRESS, _LAST_ADDRESS + 1):
            answer = self._probe(address)
            if answer:
                found[address] = self._reserved.get(address, answer)
        return found

    def close(self) -> None:
        """Close the bus, unless a transfer hangs in it. May be called twice."""
        if not self._lock.acquire(timeout=0.2):
            return
        try:
            smbus, self._smbus = self._smbus, None
            if smbus is not None:
                smbus.close()
        finally:
            self._lock.release()

    def _probe(self, address: int) -> str:
        with self._lock:
            try:
                self._opened().read_byte(address)
            except OSError as error:
                if error.errno == errno.EBUSY:
                    return "kernel driver"
                if error.errno in _NO_ANSWER:
                    return ""
                raise self._failed(address, error) from error
        return "device"

    def _opened(self) -> Smbus:
        if self._smbus is None:
            raise HardwareError(f"I2C bus {self.path} is closed")
        return self._smbus

    def _failed(self, address: int, error: OSError) -> HardwareError:
        if isinstance(error, HardwareError):
            return error
        return HardwareError(f"I2C bus {self.path}, address {address:#04x}: {_transfer_reason(error)}")


_NO_ANSWER = (errno.ENXIO, errno.EREMOTEIO, errno.ENODEV)
_STUCK = (errno.ETIMEDOUT, errno.EIO, errno.EAGAIN)


def _transfer_reason(error: OSError) -> str:
    if error.errno in _NO_ANSWER:
        return "no answer; check power, SDA/SCL and the address strap"
    if error.errno in _STUCK:
        return "the bus is stuck or disturbed; check for a short, missing pull-ups, a device without power"
    if error.errno == errno.EBUSY:
        return "it belongs to a driver of the operating system"
    return str(error)


def _opening_reason(error: OSError) -> str:
    if error.errno == errno.ENOENT:
        return "there is no such bus; switch it on (dtparam=i2c_arm=on in config.txt, then restart)"
    if error.errno == errno.EACCES:
        return (
            "permission denied; add the user to the group i2c (sudo usermod -aG i2c $USER) and log in again"
        )
    return str(error)
