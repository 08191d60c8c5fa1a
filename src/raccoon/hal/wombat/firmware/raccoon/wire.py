"""Frames from the Wombat's RaccoonOS firmware: one packed little-endian struct, the same in versions 17 and
21.

168 bytes carry data, the rest of the frame is padding; byte 0 is the version. There is no start mark, no
checksum and no sequence number. `commands.py` makes the frames that are sent. This module converts the units
of the wire (deg/s, clockwise degrees, g) and the polarity of the motors.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from raccoon.core.errors import HardwareError
from raccoon.core.readings import GRAVITY, NO_ANALOG, Device, Fault, Inputs, Vector, Words, quick_inputs
from raccoon.hal.wombat.firmware.bits import FLAGS, PORTS
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21

FRAME_LENGTH: Mapping[int, int] = {17: 248, 21: 277}
"""Length of a frame in bytes, both ways, for each version that this library speaks."""

DATA_LENGTH = 168
BUTTON = 10
_BUTTON = ({"button": 0.0}, {"button": 1.0})
_DEVICE = {17: RACCOON_17, 21: RACCOON_21}
_REPLY = struct.Struct("<BI4i4iB6hhH3fb3fb3fb3fb3fb4fbff6f")


class Telemetry:
    """One decoded frame, motors with the unified polarity. The tuples are made on access."""

    __slots__ = ("words",)

    def __init__(self, words: tuple[float, ...]) -> None:
        self.words = words

    @property
    def version(self) -> int:
        """Version of the protocol."""
        return int(self.words[0])

    @property
    def update_time_us(self) -> int:
        """The controller's clock at the end of the previous transfer, us: a sign of life, not a time base."""
        return int(self.words[1])

    @property
    def bemf(self) -> tuple[float, float, float, float]:
        """Filtered back-EMF counts."""
        words = self.words
        return -words[2], -words[3], -words[4], -words[5]

    @property
    def position(self) -> tuple[float, float, float, float]:
        """Position counters: whole numbers that wrap at 32 bits."""
        words = self.words
        return -words[6], -words[7], -words[8], -words[9]

    @property
    def done(self) -> tuple[bool, ...]:
        """Whether each motor has reached its position goal."""
        return tuple(bool(int(self.words[10]) >> port & 1) for port in range(4))

    @property
    def analog(self) -> tuple[float, ...]:
        """12-bit counts of the six analog ports."""
        return self.words[11:17]

    @property
    def battery(self) -> float:
        """Battery voltage, 12-bit counts."""
        return self.words[17]

    @property
    def digital_bits(self) -> int:
        """Bits 0-9: ports, 1 where low; bit 10: the button is pressed."""
        return int(self.words[18])

    @property
    def world_gyro_deg(self) -> tuple[float, ...]:
        """deg/s in the quaternion's world frame."""
        return self.words[19:22]

    @property
    def world_accel(self) -> tuple[float, ...]:
        """Specific force in m/s2 in the quaternion's world frame."""
        return self.words[23:26]

    @property
    def compass(self) -> tuple[float, ...]:
        """Magnetic field in uT in the frame of the robot."""
        return self.words[27:30]

    @property
    def world_linear_accel(self) -> tuple[float, ...]:
        """Acceleration without gravity in m/s2 (the wire carries g), world frame."""
        return tuple(GRAVITY * each for each in self.words[31:34])

    @property
    def accel_velocity(self) -> tuple[float, ...]:
        """Leaky integral of the acceleration; drifts."""
        return self.words[35:38]

    @property
    def accuracy(self) -> tuple[float, ...]:
        """Accuracy 0..3 that the firmware reports for gyro, accelerometer, compass, linear acceleration,
        accelerated velocity and quaternion."""
        words = self.words
        return words[22], words[26], words[30], words[34], words[38], words[43]

    @property
    def quaternion(self) -> tuple[float, ...]:
        """w, x, y, z: robot to world, from gyro and accelerometer."""
        return self.words[39:43]

    @property
    def heading(self) -> float:
        """rad in -pi..pi, counter-clockwise positive (the wire carries clockwise degrees)."""
        return math.remainder(-math.radians(self.words[44]), math.tau)

    @property
    def temperature(self) -> float:
        """Degrees Celsius."""
        return self.words[45]

    @property
    def odometry(self) -> tuple[float, ...]:
        """x m, y m, heading rad, vx m/s, vy m/s, turn rate rad/s by the firmware's odometry."""
        return self.words[46:52]


def decode(frame: bytes, version: int) -> Telemetry:
    """Decode one frame.

    Raises HardwareError for a version that this library does not speak, another length or another first byte.
    """
    length = FRAME_LENGTH.get(version)
    if length is None:
        raise HardwareError(f"RaccoonOS protocol version {version}: allowed are {sorted(FRAME_LENGTH)}")
    if len(frame) != length:
        raise HardwareError(f"the frame has {len(frame)} bytes: version {version} has {length}")
    if frame[0] != version:
        raise HardwareError(f"byte 0 of the frame is {frame[0]}: version {version} is expected")
    return Telemetry(_REPLY.unpack_from(frame))


def find_shift(stream: bytes, version: int) -> int | None:
    """Index (modulo the frame length) at which a frame begins in a stream of three frames; None if none is
    found.

    A frame is recognised only by its padding: all zero, and followed by the version.
    """
    length = FRAME_LENGTH[version]
    padding = bytes(length - DATA_LENGTH)
    mark = padding + bytes((version,))
    for found in range(len(padding), len(stream) - length):
        if stream[found + length] == version and stream.startswith(mark, found - len(padding)):
            return found % length
    return None


def body_vectors(words: tuple[float, ...]) -> tuple[Vector, Vector] | None:
    """Gyro (deg/s) and specific force (m/s2) in the robot's own axes; None if the quaternion is not valid.

    v' = v - 2 w (u x v) + 2 u x (u x v): rotation by the conjugate of the unit quaternion (w, u).
    """
    w, x, y, z = words[39:43]
    norm = w * w + x * x + y * y + z * z
    if not 0.25 <= norm <= 4.0:
        return None
    s = 2.0 / norm
    xx, yy, zz = s * x * x, s * y * y, s * z * z
    xy, xz, yz = s * x * y, s * x * z, s * y * z
    wx, wy, wz = s * w * x, s * w * y, s * w * z
    # The rows of the transposed rotation matrix.
    a, b, c = 1.0 - yy - zz, xy + wz, xz - wy
    d, e, f = xy - wz, 1.0 - xx - zz, yz + wx
    g, h, i = xz + wy, yz - wx, 1.0 - xx - yy
    p, q, r = words[19:22]
    k, m, n = words[23:26]
    return (
        (a * p + b * q + c * r, d * p + e * q + f * r, g * p + h * q + i * r),
        (a * k + b * m + c * n, d * k + e * m + f * n, g * k + h * m + i * n),
    )


def inputs(
    telemetry: Telemetry,
    time: float,
    *,
    device: Device | None = None,
    position: Words | None = None,
    bemf: Words | None = None,
    faults: tuple[Fault, ...] = (),
    imu: bool = True,
    analog: bool = True,
) -> Inputs:
    """The `Inputs` of one frame.

    position: ticks per motor port; by default the wrapping counters of this frame. bemf: counts; by default
    those of this frame. imu: False if its IMU words are not new. analog: False if its analog words are not
    usable.
    """
    words: tuple[Any, ...] = telemetry.words
    vectors = body_vectors(words) if imu else None
    gyro, accel = vectors or (None, None)
    bits = words[18]
    if bemf is None:
        bemf = -words[2], -words[3], -words[4], -words[5]
    if position is None:
        position = -words[6], -words[7], -words[8], -words[9]
    return quick_inputs(
        time,
        device or _DEVICE[words[0]],
        bemf,
        position,
        gyro,
        accel,
        words[11:17] if analog else NO_ANALOG,
        FLAGS[bits & PORTS],
        words[17],
        faults,
        _BUTTON[bits >> BUTTON & 1],
    )
