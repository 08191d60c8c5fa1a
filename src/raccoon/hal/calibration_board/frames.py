"""The frames of the calibration board: ``A5 | type | length | t_ms u32 | payload | crc8``, little-endian.

The CRC-8 (polynomial 0x07, start 0) covers everything between the A5 and itself. Two firmware versions are in
use; types 4 and 5 exist in two lengths and both are read.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

START = 0xA5
_HEAD = struct.Struct("<BBBI")
_OVERHEAD = _HEAD.size + 1


def _crc_table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ (0x07 if value & 0x80 else 0)
        table.append(value & 0xFF)
    return bytes(table)


_CRC_TABLE = _crc_table()


def crc8(data: bytes | bytearray | memoryview) -> int:
    """CRC-8 with polynomial x^8 + x^2 + x + 1, start value 0; of b"123456789" it is 0xF4."""
    crc = 0
    table = _CRC_TABLE
    for byte in data:
        crc = table[crc ^ byte]
    return crc


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One IMU sample, 1 kHz, counts. accel: 8192 per g; gyro: 16.384 per deg/s, bias already subtracted."""

    time_ms: int
    accel: tuple[int, int, int]
    gyro: tuple[int, int, int]
    temperature: int

    @property
    def celsius(self) -> float:
        return self.temperature / 132.48 + 25.0


@dataclass(frozen=True, slots=True)
class Flow:
    """Counts by which the floor moved under the sensor since the last frame; squal below 40 is poor
    tracking."""

    time_ms: int
    dx: int
    dy: int
    squal: int
    shutter: int
    motion: int


@dataclass(frozen=True, slots=True)
class BoardStatus:
    """State of the board's own sensors: 0 is well, anything else an error code of its drivers."""

    time_ms: int
    imu: int
    flow: int
    flow_present: bool
    imu_samples: int
    imu_dropped: int
    flow_tries: int
    reconnects: int
    disconnects: int


@dataclass(frozen=True, slots=True)
class FlowCalibration:
    """Flow counts per centimetre along both axes, and the height (mm) at which they were calibrated.

    offset_mm: the board's own setting of its position; None with the older firmware.
    """

    time_ms: int
    counts_per_cm: tuple[float, float]
    height_mm: float
    offset_mm: tuple[float, float] | None
    valid: bool


@dataclass(frozen=True, slots=True)
class Orientation:
    """Attitude (w, x, y, z), rates and their bias in deg/s, 100 Hz. The older firmware has no z bias."""

    time_ms: int
    quaternion: tuple[float, float, float, float]
    gyro_deg_s: tuple[float, float, float]
    bias_deg_s: tuple[float, ...]
    at_rest: bool
    bias_saved: bool


@dataclass(frozen=True, slots=True)
class Accumulator:
    """Flow counts since power-up, modular int32: immune to lost frames. Newer firmware only."""

    time_ms: int
    x: int
    y: int


Frame = ImuSample | Flow | BoardStatus | FlowCalibration | Orientation | Accumulator

_IMU = struct.Struct("<7h")
_FLOW = struct.Struct("<2h4B2x")
_STATUS = struct.Struct("<2bBx3I2H")
_CALIBRATION_OLD, _CALIBRATION = struct.Struct("<3fB"), struct.Struct("<5fB")
_ORIENTATION_OLD, _ORIENTATION = struct.Struct("<9fB"), struct.Struct("<10fB")
_ACCUMULATOR = struct.Struct("<2i")


def _imu(time_ms: int, payload: bytes) -> ImuSample:
    words = _IMU.unpack(payload)
    return ImuSample(time_ms, words[0:3], words[3:6], words[6])


def _flow(time_ms: int, payload: bytes) -> Flow:
    dx, dy, squal, shutter_high, shutter_low, motion = _FLOW.unpack(payload)
    return Flow(time_ms, dx, dy, squal, shutter_high << 8 | shutter_low, motion)


def _status(time_ms: int, payload: bytes) -> BoardStatus:
    imu, flow, present, *counts = _STATUS.unpack(payload)
    return BoardStatus(time_ms, imu, flow, bool(present), *counts)


def _calibration(time_ms: int, payload: bytes) -> FlowCalibration:
    if len(payload) == _CALIBRATION_OLD.size:
        x, y, height, valid = _CALIBRATION_OLD.unpack(payload)
        return FlowCalibration(time_ms, (x, y), height, None, bool(valid))
    x, y, height, offset_x, offset_y, valid = _CALIBRATION.unpack(payload)
    return FlowCalibration(time_ms, (x, y), height, (offset_x, offset_y), bool(valid))


def _orientation(time_ms: int, payload: bytes) -> Orientation:
    layout = _ORIENTATION_OLD if len(payload) == _ORIENTATION_OLD.size else _ORIENTATION
    *numbers, flags = layout.unpack(payload)
    w, x, y, z, rate_x, rate_y, rate_z, *bias = numbers
    return Orientation(
        time_ms, (w, x, y, z), (rate_x, rate_y, rate_z), tuple(bias), bool(flags & 1), bool(flags & 2)
    )


def _accumulator(time_ms: int, payload: bytes) -> Accumulator:
    return Accumulator(time_ms, *_ACCUMULATOR.unpack(payload))


_READERS: dict[tuple[int, int], Callable[[int, bytes], Frame]] = {
    (0x01, _IMU.size): _imu,
    (0x02, _FLOW.size): _flow,
    (0x03, _STATUS.size): _status,
    (0x04, _CALIBRATION_OLD.size): _calibration,
    (0x04, _CALIBRATION.size): _calibration,
    (0x05, _ORIENTATION_OLD.size): _orientation,
    (0x05, _ORIENTATION.size): _orientation,
    (0x06, _ACCUMULATOR.size): _accumulator,
}


class FrameDecoder:
    """Finds frames in a byte stream that may be cut, corrupted or joined in mid-frame."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by `data`, oldest first."""
        buffer = self._buffer
        buffer += data
        frames: list[Frame] = []
        at = 0
        while len(buffer) - at >= _OVERHEAD:
            reader = _READERS.get((buffer[at + 1], buffer[at + 2])) if buffer[at] == START else None
            end = at + _OVERHEAD + buffer[at + 2]
            if reader is not None and end > len(buffer):
                break
            if reader is None or crc8(memoryview(buffer)[at + 1 : end - 1]) != buffer[end - 1]:
                # Skip one byte only: a start byte in damaged data must not hide the true one right behind it.
                at += 1
                continue
            _, _, _, time_ms = _HEAD.unpack_from(buffer, at)
            frames.append(reader(time_ms, bytes(buffer[at + _HEAD.size : end - 1])))
            at = end
        del buffer[:at]
        return frames
