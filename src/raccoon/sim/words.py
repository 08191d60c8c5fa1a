"""The words of a simulated controller from true quantities: analog converter and IMU."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from raccoon.core.readings import ANALOG_PORTS, SIMULATOR, Flags, Vector, Words
from raccoon.model.imu import gyro_reading, specific_force, word
from raccoon.sim.bystander import SimulatedBystander
from raccoon.sim.effects.chain import Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.plant.quantities import State
from raccoon.sim.tophats import Tophat
from raccoon.sim.world.table import World


class NormalNumbers:
    """Normal random numbers from one generator, drawn in batches."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._stock: list[float] = []

    def next(self) -> float:
        """The next number, with mean 0 and standard deviation 1."""
        try:
            return self._stock.pop()
        except IndexError:
            self._stock = self._random.standard_normal(1024).tolist()
            return self._stock.pop()


TIME_TOLERANCE_S = 1e-6
"""Tolerance when simulated times are compared, s: a bound, with room to spare, on the rounding error of a
time that is the sum of a million steps."""


class Imu:
    """Gyro and accelerometer with their effects, at their own rate.

    rate_hz: rate of new readings. lag: how long before the end of each period the plant's gyro is sampled, s.
    """

    def __init__(
        self, parameters: Parameters, noise: Noise, scatter: NormalNumbers, rate_hz: float, lag: float
    ) -> None:
        value = parameters.value
        self._scale = value("imu.gyro_scale", "factor") * parameters.robot.model.imu.gyro_scale.value
        self._bias = value("imu.gyro_bias", "rate") + noise.gyro_bias * scatter.next()
        self._drift = value("imu.gyro_drift", "rate_per_second")
        self._latency, self._lag = value("imu.latency", "seconds"), lag
        self._noise, self._scatter = noise, scatter
        self._period = 1.0 / rate_hz
        self._due = 0.0
        self._past: deque[tuple[float, float]] = deque()
        self._speed = self._speed_time = 0.0

    def read(self, state: State, tilt: tuple[float, float]) -> tuple[Vector, Vector] | None:
        """Words of gyro and accelerometer; None if no new reading is due. tilt: as `Contact.tilt` returns
        it."""
        rate = self._delayed(state.time, state.gyro_rate)
        if state.time < self._due - TIME_TOLERANCE_S:
            return None
        self._due += self._period
        elapsed = state.time - self._speed_time
        change = (state.forward_speed - self._speed) / elapsed if elapsed > 0.0 else 0.0
        self._speed, self._speed_time = state.forward_speed, state.time
        gyro = gyro_reading(rate, self._scale, self._bias, self._drift, state.time)
        force = specific_force(change, state.forward_speed, state.yaw_rate, tilt[0])
        return self._gyro_words(tilt[1], gyro), self._accel_words(force)

    def _gyro_words(self, pitch_rate: float, rate: float) -> Vector:
        x, y, z = (self._noise.gyro * self._scatter.next() + each for each in (0.0, pitch_rate, rate))
        scale = SIMULATOR.gyro_rad_s
        return word(x, scale), word(y, scale), word(z, scale)

    def _accel_words(self, force: Vector) -> Vector:
        x, y, z = (self._noise.accel * self._scatter.next() + each for each in force)
        scale = SIMULATOR.accel_m_s2
        return word(x, scale), word(y, scale), word(z, scale)

    def _delayed(self, time: float, rate: float) -> float:
        """The latest turn rate, rad/s, that is at least as old as the latency. The plant's gyro is sampled
        where within a period that moment lies (`physical.gyro_lag`)."""
        past = self._past
        past.append((time - self._lag, rate))
        while len(past) > 1 and past[1][0] <= time - self._latency + 1e-9:
            past.popleft()
        return past[0][1]


FULL_SCALE = SIMULATOR.analog_full_scale


class AnalogConverter:
    """The 12-bit analog-to-digital converter: battery and analog ports."""

    def __init__(
        self, tophats: list[Tophat], noise: Noise, scatter: NormalNumbers, bystander: SimulatedBystander
    ) -> None:
        self._tophats = tophats
        self._bystander = bystander
        self._noise, self._scatter = noise, scatter
        # An unconnected analog port floats somewhere in its range; one of them changes in each cycle.
        wired = {each.port for each in tophats}
        self._floating = [port for port in range(ANALOG_PORTS) if port not in wired]
        spread = 400.0 if noise.analog else 0.0
        self._levels = {port: 2000.0 + spread * scatter.next() for port in self._floating}
        self._words: list[float | None] = [None] * ANALOG_PORTS
        for port, level in self._levels.items():
            self._words[port] = self._word(level, 0.0)
        self._cycle = 0

    def battery(self, voltage: float) -> int:
        """Counts of the battery. voltage: as the controller reports it, V."""
        return self._word(voltage / SIMULATOR.battery_volts, self._noise.battery)

    def analog(
        self, world: World, pose: tuple[float, float, float], heading: tuple[float, float], time: float
    ) -> tuple[Words, Flags]:
        """Counts of every analog port, and whether the floor under each tophat is black (None: no tophat at
        this port).

        pose: m, m, rad. heading: its cosine and sine. time: s.
        """
        words = self._words
        if self._floating:
            port = self._floating[self._cycle % len(self._floating)]
            words[port] = self._word(self._levels[port], 5.0 * self._noise.analog)
            self._cycle += 1
        surface: list[bool | None] = [None] * ANALOG_PORTS
        for tophat in self._tophats:
            counts, black = tophat.read(world, pose[0], pose[1], *heading, time)
            if self._bystander.black is not None:
                black = self._bystander.black
                counts = tophat.over(black)
            words[tophat.port] = self._word(counts, math.hypot(self._noise.analog, tophat.noise_sd))
            surface[tophat.port] = black
        for port, counts in self._bystander.lit().items():
            words[port] = self._word(counts, self._noise.analog)
        return tuple(words), tuple(surface)

    def _word(self, counts: float, sd: float) -> int:
        noisy = math.floor(counts + sd * self._scatter.next() + 0.5)
        return 0 if noisy < 0 else noisy if noisy <= FULL_SCALE else FULL_SCALE
