"""The Open Interface of the iRobot Create 2 (Roomba 600): commands to bytes, stream frames to readings.

Source: iRobot, "Create 2 Open Interface (OI) Specification based on the Roomba 600": opcodes 128-150 and 173,
sensor packets 7-58. Every 16-bit number is big-endian. A stream frame is ``19 | n | id data ... | checksum``;
the low byte of the sum over the whole frame, header and checksum included, is 0.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

BAUD = 115200
STREAM_PERIOD = 0.015
"""s between two stream frames; the base updates its own sensors no faster."""
PWM_LIMIT = 255
SPEED_LIMIT_MM_S = 500
HEADER = 19


class Mode(IntEnum):
    """OI mode (packet 35). The wheels obey only in SAFE and FULL."""

    OFF = 0
    PASSIVE = 1
    SAFE = 2
    FULL = 3


_START, _SAFE, _FULL = 128, 131, 132
_DRIVE_DIRECT, _DRIVE_PWM = 145, 146
_STREAM, _PAUSE_RESUME, _STOP_INTERFACE = 148, 150, 173

# (packet id, struct code, field of Sensors), in the order in which they are requested and sent.
PACKETS: tuple[tuple[int, str, str], ...] = (
    (7, "B", "bumps_and_wheel_drops"),
    (9, "B", "cliff_left"),
    (10, "B", "cliff_front_left"),
    (11, "B", "cliff_front_right"),
    (12, "B", "cliff_right"),
    (18, "B", "buttons"),
    (22, "H", "voltage_mv"),
    (23, "h", "current_ma"),
    (28, "H", "cliff_left_signal"),
    (29, "H", "cliff_front_left_signal"),
    (30, "H", "cliff_front_right_signal"),
    (31, "H", "cliff_right_signal"),
    (35, "B", "mode"),
    (43, "H", "left_encoder"),
    (44, "H", "right_encoder"),
    (54, "h", "left_motor_ma"),
    (55, "h", "right_motor_ma"),
)
_IDS = tuple(packet for packet, _, _ in PACKETS)
_FRAME = struct.Struct(">BB" + "".join(f"B{code}" for _, code, _ in PACKETS) + "B")
FRAME_LENGTH = _FRAME.size
_PAYLOAD_LENGTH = FRAME_LENGTH - 3


@dataclass(frozen=True, slots=True)
class Sensors:
    """One stream frame, in the units of the base.

    bumps_and_wheel_drops: bit 0 bump right, 1 bump left, 2 wheel drop right, 3 wheel drop left. buttons: bit
    0 clean, 1 spot. current_ma: negative while the battery discharges. cliff signals: 0..4095, higher for a
    stronger reflection. encoders: 0..65535, wrapping.
    """

    bumps_and_wheel_drops: int
    cliff_left: int
    cliff_front_left: int
    cliff_front_right: int
    cliff_right: int
    buttons: int
    voltage_mv: int
    current_ma: int
    cliff_left_signal: int
    cliff_front_left_signal: int
    cliff_front_right_signal: int
    cliff_right_signal: int
    mode: int
    left_encoder: int
    right_encoder: int
    left_motor_ma: int
    right_motor_ma: int

    @property
    def wheel_dropped(self) -> bool:
        return bool(self.bumps_and_wheel_drops & 0b1100)


def start(mode: Mode) -> bytes:
    """The bytes that take control in `mode` (SAFE or FULL), stop the wheels and start the sensor stream."""
    return bytes((_START,)) + enter(mode) + drive_direct(0, 0) + stream(_IDS)


def enter(mode: Mode) -> bytes:
    """The bytes that change to SAFE (the base stops itself at a cliff or a dropped wheel) or FULL (it does
    not). Raises ValueError for another mode."""
    if mode not in (Mode.SAFE, Mode.FULL):
        raise ValueError(f"mode is {mode!r}: allowed are SAFE and FULL")
    return bytes((_SAFE if mode is Mode.SAFE else _FULL,))


def stream(packets: tuple[int, ...]) -> bytes:
    """The bytes that request these packets every 15 ms."""
    return bytes((_STREAM, len(packets), *packets))


def drive_direct(left_mm_s: int, right_mm_s: int) -> bytes:
    """The bytes that set wheel speeds in mm/s, which the base controls. Raises ValueError outside
    -500..500."""
    return _wheels(_DRIVE_DIRECT, left_mm_s, right_mm_s, SPEED_LIMIT_MM_S, "speed in mm/s")


def drive_pwm(left: int, right: int) -> bytes:
    """The bytes that set the wheels' duties in 1/255 of the battery voltage. Raises ValueError outside
    -255..255."""
    return _wheels(_DRIVE_PWM, left, right, PWM_LIMIT, "PWM")


def stop() -> bytes:
    """The bytes that stop the wheels in either way of driving."""
    return drive_pwm(0, 0) + drive_direct(0, 0)


def release() -> bytes:
    """The bytes that stop the wheels and the stream and close the interface: the base is an ordinary Roomba
    again."""
    return stop() + bytes((_PAUSE_RESUME, 0, _START, _STOP_INTERFACE))


def _wheels(opcode: int, left: int, right: int, limit: int, unit: str) -> bytes:
    for side, value in (("left", left), ("right", right)):
        if not -limit <= value <= limit:
            raise ValueError(f"{side} wheel's {unit} is {value}: allowed are {-limit} to {limit}")
    return struct.pack(">Bhh", opcode, right, left)  # the interface names the right wheel first


class StreamDecoder:
    """Finds stream frames in a byte stream that may be cut, corrupted or joined in mid-frame."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Sensors]:
        """The frames completed by `data`, oldest first."""
        buffer = self._buffer
        buffer += data
        frames = []
        at = 0
        while len(buffer) - at >= FRAME_LENGTH:
            sensors = _decode(buffer, at)
            if sensors is None:
                # Skip one byte only: a header in damaged data must not hide the true one right behind it.
                at += 1
            else:
                at += FRAME_LENGTH
                frames.append(sensors)
        del buffer[:at]
        return frames


def _decode(buffer: bytearray, at: int) -> Sensors | None:
    if buffer[at] != HEADER or buffer[at + 1] != _PAYLOAD_LENGTH:
        return None
    if sum(buffer[at : at + FRAME_LENGTH]) & 0xFF:
        return None
    fields = _FRAME.unpack_from(buffer, at)
    if fields[2:-1:2] != _IDS:
        return None
    return Sensors(*fields[3:-1:2])
