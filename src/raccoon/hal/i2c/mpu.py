"""The InvenSense MPU-6050, 6500, 9250 and 9255: gyro and accelerometer.

Registers and scales: InvenSense, "MPU-6000 and MPU-6050 Register Map" (RM-MPU-6000A) and "MPU-9250 Register
Map" (RM-MPU-9250A). The sensor samples at 1 kHz behind its 41 Hz low-pass and is polled: a sample is at most
1 ms old when it is read, and one burst reads accelerometer, temperature and gyro of the same moment.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from raccoon.core.clock import Clock, RealClock
from raccoon.core.errors import CalibrationError, ConfigError, HardwareError
from raccoon.core.readings import GRAVITY
from raccoon.hal.i2c.bus import I2cBus

DEFAULT_ADDRESS = 0x69
"""The address with AD0 high. With AD0 low it would be 0x68, that of a Wombat's clock chip."""

_RATE_DIVIDER, _CONFIG, _GYRO_CONFIG, _ACCEL_CONFIG, _ACCEL_CONFIG_2 = 0x19, 0x1A, 0x1B, 0x1C, 0x1D
_DATA, _USER_CONTROL, _POWER_1, _POWER_2, _WHO_AM_I = 0x3B, 0x6A, 0x6B, 0x6C, 0x75
_LOW_PASS_41_HZ = 3
_ACCEL_4_G = 0x08
_ACCEL_COUNTS_PER_G = 8192
_WORDS = struct.Struct(">7h")
_CLIPPED = 32_760
_FROZEN_AFTER = 100
"""Equal readings in a row after which the sensor is frozen: its noise changes a bit far more often."""


@dataclass(frozen=True, slots=True)
class _Chip:
    name: str
    celsius_per_count: float
    celsius_at_zero: float
    second_filter: bool  # the accelerometer's low-pass has a register of its own


_MPU_6050 = _Chip("mpu6050", 1 / 340.0, 36.53, second_filter=False)
_MPU_6500 = _Chip("mpu6500", 1 / 333.87, 21.0, second_filter=True)
_CHIPS = {
    0x68: _MPU_6050,
    0x70: _MPU_6500,
    0x71: _Chip("mpu9250", _MPU_6500.celsius_per_count, _MPU_6500.celsius_at_zero, second_filter=True),
    0x73: _Chip("mpu9255", _MPU_6500.celsius_per_count, _MPU_6500.celsius_at_zero, second_filter=True),
}
# Full scale in deg/s: bits of GYRO_CONFIG, counts a deg/s.
_GYRO_RANGES = {250: (0x00, 131.072), 500: (0x08, 65.536), 1000: (0x10, 32.768), 2000: (0x18, 16.384)}


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One sample in the robot's axes, counts; gyro is None if an axis was at its limit. temperature in
    Celsius."""

    gyro: tuple[int, int, int] | None
    accel: tuple[int, int, int]
    temperature: float


class Mpu:
    """One sensor on `bus`.

    axes: the sensor's axes, with sign, along the robot's x (forward), y (left) and z (up), for example ("-y",
    "x", "z"). gyro_range_deg_s: 250, 500, 1000 or 2000. Raises ConfigError for an address of the board
    itself, axes that are no rotation, or another range.
    """

    def __init__(
        self,
        bus: I2cBus,
        address: int = DEFAULT_ADDRESS,
        *,
        axes: Sequence[str] = ("x", "y", "z"),
        gyro_range_deg_s: int = 1000,
    ) -> None:
        bus.claim(address, "an MPU")
        if gyro_range_deg_s not in _GYRO_RANGES:
            raise ConfigError(f"gyro_range_deg_s is {gyro_range_deg_s}: allowed are 250, 500, 1000 and 2000")
        self._bus = bus
        self._address = address
        self._axes = _parse_axes(axes)
        self._range_bits, counts_per_deg_s = _GYRO_RANGES[gyro_range_deg_s]
        self._chip = _MPU_6050
        self._ranges = bytes((_LOW_PASS_41_HZ, self._range_bits, _ACCEL_4_G))
        self._last = b""
        self._repeats = 0
        self.gyro_rad_s = math.radians(1.0) / counts_per_deg_s
        self.accel_m_s2 = GRAVITY / _ACCEL_COUNTS_PER_G

    @property
    def name(self) -> str:
        return self._chip.name

    def set_up(self) -> None:
        """Identify, wake and configure the sensor. Raises HardwareError for another chip or one that does not
        answer."""
        identity = self._bus.read(self._address, _WHO_AM_I, 1)[0]
        if identity not in _CHIPS:
            known = ", ".join(f"{key:#04x} ({chip.name})" for key, chip in _CHIPS.items())
            raise HardwareError(
                f"the device at {self._address:#04x} says it is {identity:#04x}: allowed are {known}"
            )
        self._chip = _CHIPS[identity]
        for register, value in self._settings():
            self._bus.write(self._address, register, bytes((value,)))
        for register, value in self._settings():
            kept = self._bus.read(self._address, register, 1)[0]
            if kept != value:
                raise HardwareError(
                    f"{self.name} at {self._address:#04x}: register {register:#04x} is {kept:#04x} "
                    f"after {value:#04x} was written; a clone, or a bad connection"
                )
        self._last, self._repeats = b"", 0

    def read(self) -> ImuSample:
        """The newest sample. Raises HardwareError if the sensor does not answer, is asleep or frozen, or was
        reset."""
        data = self._bus.read(self._address, _DATA, _WORDS.size)
        self._check_alive(data)
        # After a loss of power all but the MPU-6050 are awake, in another range: four times the turn rate.
        if self._bus.read(self._address, _CONFIG, len(self._ranges)) != self._ranges:
            raise HardwareError(f"{self.name} at {self._address:#04x} lost its configuration: it was reset")
        ax, ay, az, temperature, gx, gy, gz = _WORDS.unpack(data)
        rates = self._turned((gx, gy, gz))
        return ImuSample(
            gyro=None if max(map(abs, rates)) >= _CLIPPED else rates,
            accel=self._turned((ax, ay, az)),
            temperature=temperature * self._chip.celsius_per_count + self._chip.celsius_at_zero,
        )

    def _settings(self) -> list[tuple[int, int]]:
        settings = [
            (_POWER_1, 0x01),  # awake, clocked by the gyro
            (_POWER_2, 0x00),  # every axis on
            (_USER_CONTROL, 0x00),  # no FIFO, no bus master of its own
            (_RATE_DIVIDER, 0),
            (_CONFIG, _LOW_PASS_41_HZ),
            (_GYRO_CONFIG, self._range_bits),
            (_ACCEL_CONFIG, _ACCEL_4_G),
        ]
        if self._chip.second_filter:
            settings.append((_ACCEL_CONFIG_2, _LOW_PASS_41_HZ))
        return settings

    def _check_alive(self, data: bytes) -> None:
        if data.count(0) == len(data) or data.count(0xFF) == len(data):
            raise HardwareError(
                f"{self.name} at {self._address:#04x} reads {data[0]:#04x} everywhere: "
                "it lost power or fell asleep"
            )
        self._repeats = self._repeats + 1 if data == self._last else 0
        self._last = data
        if self._repeats >= _FROZEN_AFTER:
            raise HardwareError(
                f"{self.name} at {self._address:#04x} repeated one sample {self._repeats} times: it is frozen"
            )

    def _turned(self, words: tuple[int, int, int]) -> tuple[int, int, int]:
        (i, i_sign), (j, j_sign), (k, k_sign) = self._axes
        return i_sign * words[i], j_sign * words[j], k_sign * words[k]


def _parse_axes(axes: Sequence[str]) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    known = {
        f"{sign}{name}": (index, -1 if sign else 1) for index, name in enumerate("xyz") for sign in ("", "-")
    }
    problem = f"axes are {tuple(axes)!r}: allowed are three of x, y, z, each once, - for reversed"
    if len(axes) != 3 or any(axis not in known for axis in axes):
        raise ConfigError(problem)
    first, second, third = (known[axis] for axis in axes)
    order = (first[0], second[0], third[0])
    if set(order) != {0, 1, 2}:
        raise ConfigError(problem)
    cyclic = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    if first[1] * second[1] * third[1] * (1 if cyclic else -1) != 1:
        raise ConfigError(f"axes are {tuple(axes)!r}: that is a mirror image; one sign is wrong")
    return first, second, third


@dataclass(frozen=True, slots=True)
class GyroBias:
    """Mean turn rates at rest about x, y, z, rad/s, and the standard deviations of one sample, rad/s."""

    rate: tuple[float, float, float]
    std: tuple[float, float, float]


def measure_bias(
    sensor: Mpu,
    *,
    samples: int = 400,
    limit: float = 0.03,
    clock: Clock | None = None,
    progress: Callable[[int], None] | None = None,
) -> GyroBias:
    """Gyro bias of a robot at rest, from `samples` readings 5 ms apart.

    Raises CalibrationError if the standard deviation of the rate exceeds `limit` rad/s: the robot moved.
    """
    clock = clock or RealClock()
    readings: list[tuple[int, int, int]] = []
    start = clock.now()
    for count in range(samples):
        clock.sleep_until(start + 0.005 * count)
        gyro = sensor.read().gyro
        if gyro is None:
            raise CalibrationError(
                "the gyro is at its limit: keep the robot still while its bias is measured"
            )
        readings.append(gyro)
        if progress is not None:
            progress(count + 1)
    means, stds = zip(
        *(_moments(axis, sensor.gyro_rad_s) for axis in zip(*readings, strict=True)), strict=True
    )
    if max(stds) > limit:
        raise CalibrationError(
            f"the turn rate varied by {max(stds):.3f} rad/s: keep the robot still (allowed is {limit} rad/s)"
        )
    return GyroBias((means[0], means[1], means[2]), (stds[0], stds[1], stds[2]))


def _moments(words: Sequence[int], scale: float) -> tuple[float, float]:
    mean = math.fsum(words) / len(words)
    spread = math.fsum((word - mean) ** 2 for word in words) / max(len(words) - 1, 1)
    return mean * scale, math.sqrt(spread) * scale
