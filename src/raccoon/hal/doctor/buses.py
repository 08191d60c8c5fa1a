"""The devices on the I2C bus and on USB beside the controller."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from raccoon.core.errors import HardwareError
from raccoon.hal.doctor.report import Finding, Verdict
from raccoon.hal.i2c.bus import I2cBus

_LIKELY = {0x69: "probably an MPU", **dict.fromkeys(range(64, 80), "probably an INA monitor")}
_BOARD = (0x0483, 0x5740)


class SerialPortInfo(Protocol):
    """The fields of pyserial's description of a serial port that the finding shows."""

    device: str
    vid: int | None
    pid: int | None
    product: str | None
    manufacturer: str | None


def list_i2c_devices(path: str, opener: Callable[[str], I2cBus] = I2cBus) -> Finding:
    """The finding that lists the addresses that respond on the I2C bus with the device file `path`."""
    subject = f"i2c {path}"
    if not Path(path).exists():
        return Finding(subject, Verdict.NOT_CHECKED, "there is no such bus")
    try:
        bus = opener(path)
    except HardwareError as error:
        # A robot without added sensors needs no I2C bus: this is no fault.
        return Finding(subject, Verdict.NOT_CHECKED, str(error))
    try:
        found = bus.scan()
    except HardwareError as error:
        remedy = "unplug added sensors one by one; the touch screen and the clock are on this bus, too"
        return Finding(subject, Verdict.WARNING, "does not work", str(error), remedy)
    finally:
        bus.close()
    listed = ", ".join(f"{address:#04x} {_device_name(address, who)}" for address, who in found.items())
    return Finding(subject, Verdict.OK, listed or "nothing answers", values={"devices": float(len(found))})


def _device_name(address: int, who: str) -> str:
    return _LIKELY.get(address, "unknown device") if who == "device" else who


def list_serial_ports(lister: Callable[[], Iterable[SerialPortInfo]] | None = None) -> Finding:
    """The finding that lists the USB serial devices by name, so that a missing one is noticed."""
    if lister is None:
        from serial.tools.list_ports import comports

        lister = comports
    found = [port for port in lister() if port.vid is not None]
    listed = ", ".join(f"{port.device} {_product(port)}" for port in found)
    return Finding("usb serial", Verdict.NOT_CHECKED if not found else Verdict.OK, listed or "none")


def _product(port: SerialPortInfo) -> str:
    if (port.vid, port.pid) == _BOARD:
        return "calibration board"
    return port.product or port.manufacturer or f"{port.vid:04x}:{port.pid or 0:04x}"
