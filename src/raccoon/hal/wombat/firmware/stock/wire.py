"""The frame of KIPR's stock firmware: 89 bytes both ways, registers received, (register, value) pairs sent.

Received: byte i is register i, big-endian, no stop byte, no checksum. Sent: 'J', version 4, a sequence
number, the number of pairs, the pairs, and 'S' in byte 88; a frame without those marks is ignored, so zeros
only read. Motor ports 2 and 3 are wired to the channels 3 and 2: only this module swaps them. `commands.py`
makes the frames that are sent.
"""

from __future__ import annotations

import struct

from raccoon.core.errors import HardwareError
from raccoon.core.readings import NO_ANALOG, Device, Fault, Inputs, Words, quick_inputs
from raccoon.hal.wombat.firmware.bits import FLAGS, PORTS
from raccoon.hal.wombat.firmware.devices import STOCK, STOCK_COUNTS_PER_TICK

LENGTH = 89
START = 0x4A
FIRMWARE_VERSION = 8
MAGIC = bytes((START, 0, FIRMWARE_VERSION))
"""The first three registers of the stock firmware."""

DIG_IN, ADC_0, ADC_PE, ACCEL, GYRO, MOT_POS = 3, 11, 23, 30, 36, 42
MOT_MODES, MOT_DIRS, MOT_DONE, ALLSTOP = 58, 59, 60, 61
SPEED_GOAL, PWM, SERVO, BATTERY, BUTTONS = 62, 70, 78, 86, 88
POS_GOAL, REGISTERS = 137, 153

CHANNEL = (0, 1, 3, 2)
"""Channel of a motor port; its own inverse."""

RIGHT_BUTTON = 13
_BUTTON = ({"button": 0.0}, {"button": 1.0})
_REPLY = struct.Struct(">B5H6HB9h4i4B4h4H4HHB")


class Registers:
    """One decoded frame: the raw registers, with motors in the order of the motor ports.

    The tuples are made on access: a cycle needs few of them.
    """

    __slots__ = ("words",)

    def __init__(self, words: tuple[int, ...]) -> None:
        self.words = words

    @property
    def version(self) -> int:
        """Version of the firmware."""
        return self.words[1]

    @property
    def digital_bits(self) -> int:
        """Bit n is 1 where digital port n is low: a closed switch. Bit 13 is 1 while the button is up."""
        return self.words[2]

    @property
    def digital_output_bits(self) -> int:
        """Bit n is the output latch of port n."""
        return self.words[3]

    @property
    def digital_pull_down_bits(self) -> int:
        """Bit n is 1 where port n is pulled down instead of up."""
        return self.words[4]

    @property
    def digital_output_enable_bits(self) -> int:
        """Bit n is 1 where port n is an output."""
        return self.words[5]

    @property
    def analog(self) -> tuple[int, ...]:
        """Filtered 12-bit counts of the six analog ports."""
        return self.words[6:12]

    @property
    def canary(self) -> int:
        """The register without effect that holds `commands.CANARY`."""
        return self.words[12]

    @property
    def mag(self) -> tuple[int, ...]:
        """Raw magnetometer words in the chip's axes, 0.15 uT each."""
        return self.words[13:16]

    @property
    def chip_accel(self) -> tuple[int, ...]:
        """Raw accelerometer words in the chip's axes."""
        return self.words[16:19]

    @property
    def chip_gyro(self) -> tuple[int, ...]:
        """Raw gyroscope words in the chip's axes."""
        return self.words[19:22]

    @property
    def accel(self) -> tuple[int, int, int]:
        """Forward, left, up (see `devices`)."""
        words = self.words
        return words[17], words[16], -words[18]

    @property
    def gyro(self) -> tuple[int, int, int]:
        """About forward, left, up; counter-clockwise positive (see `devices`)."""
        words = self.words
        return words[20], words[19], -words[21]

    @property
    def position(self) -> tuple[int, int, int, int]:
        """Summed back-EMF counts, 32-bit numbers that wrap."""
        words = self.words
        return words[22], words[23], words[25], words[24]

    @property
    def modes(self) -> tuple[int, ...]:
        """Mode of each motor (`commands.Mode`)."""
        return self._pairs(self.words[26])

    @property
    def directions(self) -> tuple[int, ...]:
        """Direction of each motor (`commands.Direction`)."""
        return self._pairs(self.words[27])

    @property
    def done(self) -> tuple[bool, ...]:
        """Whether each motor has reached its position goal."""
        return tuple(bool(self.words[28] >> channel & 1) for channel in CHANNEL)

    @property
    def allstop(self) -> int:
        """Bits 0-3 stop a motor channel, bits 4-7 switch off a servo."""
        return self.words[29]

    @property
    def speed_goals(self) -> tuple[int, ...]:
        """Goals of the speed control, counts."""
        return tuple(self.words[30 + channel] for channel in CHANNEL)

    @property
    def pwm(self) -> tuple[int, ...]:
        """Duty, 0..400."""
        return tuple(self.words[34 + channel] for channel in CHANNEL)

    @property
    def servo_us(self) -> tuple[int, ...]:
        """Servo pulses in microseconds."""
        return self.words[38:42]

    @property
    def battery(self) -> int:
        """Battery voltage, filtered 12-bit counts."""
        return self.words[42]

    @property
    def buttons(self) -> int:
        """Virtual buttons, owned by the controller's own screen."""
        return self.words[43]

    @staticmethod
    def _pairs(register: int) -> tuple[int, ...]:
        return tuple(register >> 2 * channel & 3 for channel in CHANNEL)


def decode(frame: bytes) -> Registers:
    """Decode one 89-byte frame.

    Raises HardwareError for another length or another first byte (see `find_shift`).
    """
    if len(frame) != LENGTH:
        raise HardwareError(f"the frame has {len(frame)} bytes: a stock frame has {LENGTH}")
    if frame[0] != START:
        raise HardwareError(
            f"byte 0 of the frame is 0x{frame[0]:02X}: a stock frame starts with 0x{START:02X}"
        )
    return Registers(_REPLY.unpack(frame))


def find_shift(frame: bytes) -> int | None:
    """Index at which the registers begin in a rotated frame (0: aligned); None if they are not found.

    After a transfer of a wrong length a controller sends its registers rotated from then on. Transferring
    that many more bytes aligns it again.
    """
    index = (frame + frame[:2]).find(MAGIC)
    return None if index < 0 else index


def inputs(
    registers: Registers,
    time: float,
    *,
    device: Device = STOCK,
    position: Words | None = None,
    bemf: Words = (None, None, None, None),
    faults: tuple[Fault, ...] = (),
    imu: bool = True,
    analog: bool = True,
) -> Inputs:
    """The `Inputs` of one frame.

    position: ticks per motor port; by default the wrapping counters of this frame. bemf: counts; the stock
    frame contains none, so the caller derives it from successive frames. imu: False if its IMU words are not
    new. analog: False if its analog words are not usable.
    """
    words = registers.words
    if position is None:
        tick = STOCK_COUNTS_PER_TICK
        position = words[22] / tick, words[23] / tick, words[25] / tick, words[24] / tick
    bits = words[2]
    return quick_inputs(
        time,
        device,
        bemf,
        position,
        (words[20], words[19], -words[21]) if imu else None,
        (words[17], words[16], -words[18]) if imu else None,
        words[6:12] if analog else NO_ANALOG,
        FLAGS[bits & PORTS],
        words[42],
        faults,
        _BUTTON[not bits >> RIGHT_BUTTON & 1],
    )
