"""The line from the Raspberry Pi to the co-processor's reset pin: GPIO23, active low."""

from __future__ import annotations

import fcntl
import os
import struct
import time

from raccoon.core.errors import HardwareError

GPIO_CHIP = "/dev/gpiochip0"
RESET_PIN = 23
PULSE_SECONDS = 0.01

# From linux/gpio.h: gpiohandle_request (64 offsets, flags, 64 values, label, count, descriptor) and its data.
GET_LINE_HANDLE, SET_LINE_VALUES = 0xC16CB403, 0xC040B409
OUTPUT = 1 << 1
_REQUEST = struct.Struct("=64I I 64s 32s I i")


class GpioResetLine:
    """Restarts the co-processor, which switches its motor drivers off.

    The pin is in use only during the pulse, so that a program that flashes the firmware finds it free.
    """

    def __init__(self, chip: str = GPIO_CHIP) -> None:
        self._chip = chip

    def pulse(self) -> None:
        """Hold the line low for 10 ms. Raises HardwareError if the pin is not available."""
        try:
            chip = os.open(self._chip, os.O_RDWR | os.O_CLOEXEC)
            try:
                line = self._take(chip)
            finally:
                os.close(chip)
            try:
                time.sleep(PULSE_SECONDS)
            finally:  # Ctrl-C during the pulse must not leave the controller in reset
                try:
                    fcntl.ioctl(line, SET_LINE_VALUES, bytes((1,)).ljust(64, b"\0"))
                finally:
                    os.close(line)
        except OSError as error:
            raise HardwareError(
                f"the reset line (pin {RESET_PIN} of {self._chip}) failed: {error}"
            ) from error

    def _take(self, chip: int) -> int:
        """Make the pin an output at low level; returns the descriptor of the line."""
        request = bytearray(
            _REQUEST.pack(RESET_PIN, *(0,) * 63, OUTPUT, bytes(64), b"raccoon".ljust(32, b"\0"), 1, 0)
        )
        fcntl.ioctl(chip, GET_LINE_HANDLE, request)
        descriptor: int = _REQUEST.unpack(request)[-1]
        return descriptor
