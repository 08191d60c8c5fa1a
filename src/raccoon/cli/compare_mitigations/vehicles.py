"""Simulated robots driven by a timed program, without estimators.

A program that reads no sensor while driving needs no simulated sensors: its duties are collected and the
plant runs along them at once. That gives the same pose as cycle by cycle (but for rounding) in a tenth of the
time.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs, Truth
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.plant.quantities import State
from raccoon.sim.port import SimPort
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from raccoon.sim.world.table import World

RATE_HZ = 200.0
IMU_RATE_HZ = 50.0
BRAKE = (True, True, False, False)


class Vehicle(Protocol):
    """Interface of a robot for a timed program, with its true pose."""

    heading: float
    """Integral of the gyro's rate since its bias was learnt, rad; 0 without a gyro."""

    @property
    def time(self) -> float:
        """Time since the start, s."""
        ...

    @property
    def battery_voltage(self) -> float | None:
        """Battery voltage as the controller reads it, V."""
        ...

    @property
    def truth(self) -> Truth:
        """The present true pose."""
        ...

    def tick(self, left: float, right: float) -> None:
        """Drive one cycle with these duties; a motor at duty 0 is shorted."""
        ...

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Brake with shorted motors for `seconds`. learn: learn the gyro's bias."""
        ...


def simulated_vehicle(
    parameters: Parameters, config: RobotConfig, seed: int, *, blind: bool, noise: bool = True
) -> Vehicle:
    """A robot at rest. blind: its program reads no sensor while driving. noise: of its sensors."""
    return BlindVehicle(parameters) if blind else SensingVehicle(parameters, config, seed, noise)


class SensingVehicle:
    """A robot with all its sensors, simulated cycle by cycle."""

    def __init__(self, parameters: Parameters, config: RobotConfig, seed: int, noise: bool) -> None:
        self._port = SimPort(
            parameters, World.empty(), robot=config, seed=seed, noise=noise, imu_rate_hz=IMU_RATE_HZ
        )
        self._inputs: Inputs = self._port.read()
        self.heading = 0.0
        self._rate = self._bias = 0.0

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._inputs.time

    @property
    def battery_voltage(self) -> float | None:
        """Battery voltage as the controller reads it, V."""
        return self._inputs.battery_voltage

    @property
    def truth(self) -> Truth:
        """The present true pose."""
        assert self._inputs.truth is not None
        return self._inputs.truth

    def tick(self, left: float, right: float) -> None:
        """Drive one cycle with these duties."""
        self._port.write(Outputs(duty=(left, right, 0.0, 0.0), brake=BRAKE))
        before = self._inputs.time
        self._inputs = self._port.read()
        if self._inputs.turn_rate is not None:
            self._rate = self._inputs.turn_rate
        self.heading += (self._rate - self._bias) * (self._inputs.time - before)

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Brake with shorted motors for `seconds`. learn: learn the gyro's bias."""
        rates = []
        for _ in range(round(seconds * RATE_HZ)):
            self.tick(0.0, 0.0)
            rates.append(self._rate)
        if learn and rates:
            self._bias = sum(rates) / len(rates)
            self.heading = 0.0


class BlindVehicle:
    """A robot without sensors: it collects the duties, and simulates them when its pose is requested."""

    heading = 0.0
    battery_voltage = None

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._duties: list[tuple[float, float]] = []

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return len(self._duties) / RATE_HZ

    def tick(self, left: float, right: float) -> None:
        """Drive one cycle with these duties."""
        self._duties.append((left, right))

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Brake with shorted motors for `seconds`."""
        del learn  # there is no gyro
        self._duties.extend([(0.0, 0.0)] * round(seconds * RATE_HZ))

    @property
    def truth(self) -> Truth:
        """The true pose at the end of all duties."""
        rows = np.array([*self._duties, (0.0, 0.0)])
        commands = Commands.of_wheels(np.arange(len(rows)) / RATE_HZ, rows[:, 0], rows[:, 1])
        final = State._make(rollout(self._parameters, commands, channels=()).final[0])
        return Truth(float(final.x), float(final.y), float(final.heading))
