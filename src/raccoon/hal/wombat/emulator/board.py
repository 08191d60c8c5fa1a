"""The board around the emulated chip: drivers, converters and IMU between plant and firmware.

It contains all hardware that is the same for both firmwares: the conversion of voltages into ADC counts,
noise, and hardware faults.
"""

from __future__ import annotations

import math
from random import Random

from raccoon.core.readings import (
    ANALOG_PORTS,
    BATTERY_VOLTS_PER_COUNT,
    BEMF_VOLTS_PER_COUNT,
    MOTOR_PORTS,
    Vector,
)
from raccoon.hal.wombat.emulator.faults import Faults
from raccoon.hal.wombat.emulator.plant import COAST, Drive, Plant, PlantState

ADC_MAX = 4095
BEMF_NOISE = 3.0
"""Standard deviation of one back-EMF conversion, counts."""
ANALOG_NOISE = 1.5
BATTERY_NOISE = 1.0
"""Standard deviation of one conversion, counts."""
GYRO_NOISE = math.radians(0.1)
"""Standard deviation, rad/s."""
IMU_POLE = 0.0025
"""Time constant, s, of each of the two poles of a low-pass of 41 Hz, to which both firmwares set the chip
(DLPF 3) for its gyro; that of its accelerometer (45 Hz) is nearly equal."""
ACCEL_NOISE = 0.03
"""Standard deviation, m/s2."""


class Board:
    """Converters and drivers on a plant. With `noise` False every converter is exact, apart from rounding."""

    def __init__(self, plant: Plant, faults: Faults, *, seed: int, noise: bool) -> None:
        self._plant = plant
        self._faults = faults
        self._random = Random(seed)
        self._noise = 1.0 if noise else 0.0
        self._floating = 1800.0
        self._sweep = 0.0
        self._converted = [0] * MOTOR_PORTS
        self.drives: tuple[Drive, ...] = COAST
        self.state: PlantState = plant.advance(0.0, COAST)
        self._gyro = _LowPass(self.state.gyro)
        self._accel = _LowPass(self.state.accel)

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> None:
        """Advance by `seconds` with the drivers in this state."""
        self.drives = drives
        before = self.state.gyro
        self.state = self._plant.advance(seconds, self._broken(drives))
        share = -math.expm1(-seconds / IMU_POLE)
        self._gyro.follow(before, self.state.gyro, share)
        force = self.state.accel  # the mean since the last call, so that no impact is missed or counted twice
        self._accel.follow(force, force, share)

    def _broken(self, drives: tuple[Drive, ...]) -> tuple[Drive, ...]:
        stalled, blown = self._faults.stalled, self._faults.blown_fuse
        if not (stalled or blown):
            return drives
        return tuple(
            None if port in blown else 0.0 if port in stalled else drive for port, drive in enumerate(drives)
        )

    def _gauss(self, deviation: float) -> float:
        return self._random.gauss(0.0, deviation * self._noise)

    def bemf(self, port: int) -> float:
        """Difference of a motor's two conversions in whole counts, stock polarity.

        The sense resistors are at the driver: behind a blown fuse they do not see the motor.
        """
        if port in self._faults.stopped_converters:
            return self._converted[port]
        lost = port in self._faults.blown_fuse or port in self._faults.stalled
        volts = 0.0 if lost else self.state.bemf_volts[port]
        counts = volts / BEMF_VOLTS_PER_COUNT + self._gauss(BEMF_NOISE)
        self._converted[port] = max(-ADC_MAX, min(ADC_MAX, round(counts)))
        return self._converted[port]

    def bemf_all(self) -> tuple[float, ...]:
        """`bemf` of the four motors."""
        return tuple(self.bemf(port) for port in range(MOTOR_PORTS))

    def analog(self, port: int, deviation: float = ANALOG_NOISE) -> int:
        """Conversion of an analog port, counts. A floating pin wanders and follows its neighbour."""
        faults = self._faults
        if port in faults.saturated:
            return faults.saturated[port]
        level = self.state.analog[port]
        if port in faults.floating:
            neighbour = self.state.analog[(port + 1) % ANALOG_PORTS]
            self._floating += 0.02 * (neighbour - self._floating) + self._gauss(20.0)
            level = self._floating
        counts = round(level + self._random.gauss(0.0, deviation * self._noise))
        return counts if 0 <= counts <= ADC_MAX else max(0, min(ADC_MAX, counts))

    def battery(self, voltage: float | None = None) -> int:
        """Conversion of the battery voltage, counts. voltage: V, the mean of several conversions; None: the
        present one."""
        volts = self.state.battery_voltage if voltage is None else voltage
        return max(0, min(ADC_MAX, round(volts / BATTERY_VOLTS_PER_COUNT + self._gauss(BATTERY_NOISE))))

    def gyro(self) -> tuple[float, float, float]:
        """Turn rates about forward, left, up, rad/s, behind the chip's low-pass."""
        x, y, z = (rate + self._gauss(GYRO_NOISE) for rate in self._gyro.value)
        if self._faults.gyro_sweep:
            # Old boards: -600 to 1700 units of 1/1.025 deg/s while at rest.
            self._sweep += 0.02
            z += math.radians(550.0 + 1150.0 * math.sin(self._sweep)) / 1.025
        return x, y, z

    def accel(self) -> tuple[float, float, float]:
        """Specific force along forward, left, up, m/s2, behind the chip's low-pass."""
        x, y, z = (force + self._gauss(ACCEL_NOISE) for force in self._accel.value)
        return x, y, z

    def digital_bits(self) -> int:
        """Bit n is 1 where port n is pulled low."""
        return sum(1 << port for port, pressed in enumerate(self.state.digital) if pressed)


class _LowPass:
    """Two equal poles in series. value: the output."""

    __slots__ = ("_followed", "value")

    def __init__(self, value: Vector) -> None:
        self._followed = self.value = value

    def follow(self, before: Vector, after: Vector, share: float) -> None:
        """Advance while the input changes from `before` to `after`. share: fraction of the difference to the
        mean input by which each pole moves."""
        x, y, z = self._followed
        ahead_x = x + share * (0.5 * (before[0] + after[0]) - x)
        ahead_y = y + share * (0.5 * (before[1] + after[1]) - y)
        ahead_z = z + share * (0.5 * (before[2] + after[2]) - z)
        self._followed = ahead_x, ahead_y, ahead_z
        out_x, out_y, out_z = self.value
        self.value = (
            out_x + share * (0.5 * (x + ahead_x) - out_x),
            out_y + share * (0.5 * (y + ahead_y) - out_y),
            out_z + share * (0.5 * (z + ahead_z) - out_z),
        )
