"""A robot for examinations: healthy by default, with one switch for each thing that can be wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from random import Random

from raccoon.core.errors import HardwareError
from raccoon.core.readings import MOTOR_PORTS, SIMULATOR, STOP, Device, Fault, Inputs, Outputs

PERIOD = 0.005
LAG = 0.03  # s, motor and filter together


@dataclass
class FaultyRobot:
    """A port. Back-EMF follows duty by a lag; the robot turns as its wheels tell it, on its own clock."""

    gain: dict[int, float] = field(default_factory=lambda: dict.fromkeys(range(MOTOR_PORTS), 1750.0))
    backward_gain: float = 1.0
    bemf_sign: float = 1.0
    position_scale: float = 1.0
    offset: float = 0.0
    wheels: tuple[int, int] = (0, 1)
    turn_signs: tuple[float, float] = (1.0, 1.0)
    on_the_floor: bool = True
    delay: int = 0
    gyro_bias: float = 0.001
    gyro_noise: float = 0.002
    gyro_frozen: bool = False
    no_imu: bool = False
    force: tuple[float, float, float] = (0.05, -0.03, 9.80)
    analog_levels: tuple[float | None, ...] = (1300.0, 1800.0, 900.0, 2100.0, 2500.0, 700.0)
    analog_noise: tuple[float, ...] = (1.5,) * 6
    follows: tuple[int, int] | None = None
    volts: float | None = 6.8
    sag: float = 0.1
    pressed: tuple[int, ...] = ()
    period: float = PERIOD
    stutter: int = 0
    faults: dict[int, tuple[Fault, ...]] = field(default_factory=dict)
    dies_at: int | None = None
    interrupts_at: int | None = None
    device: Device = SIMULATOR
    no_bemf: bool = False

    def __post_init__(self) -> None:
        self.written: list[Outputs] = []
        self.closed = 0
        self._random = Random(1)
        self._time = 0.0
        self._cycle = 0
        self._bemf = [0.0] * MOTOR_PORTS
        self._position = [0.0] * MOTOR_PORTS

    @property
    def running(self) -> bool:
        """Whether a motor was left on."""
        return bool(self.written) and self.written[-1] != STOP

    def read(self) -> Inputs:
        self._cycle += 1
        if self._cycle == self.dies_at:
            raise HardwareError("the bus is gone")
        if self._cycle == self.interrupts_at:
            raise KeyboardInterrupt
        step = self.period * (4.0 if self.stutter and self._cycle % self.stutter == 0 else 1.0)
        self._time += step
        self._turn_motors(step)
        return Inputs(
            time=self._time,
            device=self.device,
            bemf=(None,) * MOTOR_PORTS if self.no_bemf else tuple(map(self._bemf_word, self._bemf)),
            position=tuple(map(int, self._position)),
            gyro=self._gyro(),
            accel=self._accel(),
            analog=self._analog(),
            digital=tuple(port in self.pressed for port in range(10)),
            battery=self._battery(),
            faults=self.faults.get(self._cycle, ()),
        )

    def write(self, outputs: Outputs) -> None:
        self.written.append(outputs)

    def close(self) -> None:
        self.write(STOP)
        self.closed += 1

    def _command(self) -> Outputs:
        return self.written[-1 - self.delay] if len(self.written) > self.delay else STOP

    def _turn_motors(self, step: float) -> None:
        for port, duty in enumerate(self._command().duty):
            goal = self.gain[port] * duty * (self.backward_gain if duty < 0.0 else 1.0)
            self._bemf[port] += (1.0 - math.exp(-step / LAG)) * (goal - self._bemf[port])
            counted = self._bemf[port] + self.offset
            self._position[port] += self.position_scale * counted * step / self.device.position_counts_seconds

    def _bemf_word(self, counts: float) -> float:
        return self.bemf_sign * (counts + self.offset) + self._random.gauss(0.0, 1.0)

    def _gyro(self) -> tuple[float, float, float] | None:
        if self.no_imu:
            return None
        left, right = (
            sign * self._bemf[port] for sign, port in zip(self.turn_signs, self.wheels, strict=True)
        )
        turn = (right - left) / 1500.0 if self.on_the_floor else 0.0
        noise = 0.0 if self.gyro_frozen else self._random.gauss(0.0, self.gyro_noise)
        z = (0.0 if self.gyro_frozen else turn) + self.gyro_bias + noise
        return 0.0, 0.0, z / self.device.gyro_rad_s

    def _accel(self) -> tuple[float, float, float] | None:
        if self.no_imu:
            return None
        x, y, z = ((each + self._random.gauss(0.0, 0.02)) / self.device.accel_m_s2 for each in self.force)
        return x, y, z

    def _analog(self) -> tuple[float | None, ...]:
        words = [
            None if level is None else level + self._random.gauss(0.0, noise)
            for level, noise in zip(self.analog_levels, self.analog_noise, strict=True)
        ]
        if self.follows is not None:
            echo, source = self.follows
            loud = words[source]
            assert loud is not None
            words[echo] = 1000.0 + 0.5 * loud + self._random.gauss(0.0, 0.5)
        return tuple(words)

    def _battery(self) -> float | None:
        if self.volts is None:
            return None
        loaded = any(self._command().duty)
        return (self.volts - (self.sag if loaded else 0.0)) / self.device.battery_volts
