"""Simulated robots that a timed program drives; no estimators in between.

A program that asks no sensor on its way needs no sensors simulated: its duties are put down and the plant
runs along them at once, to the same pose as tick by tick (but for rounding), in a tenth of the time.
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
    """What a timed program sees of a robot, and its true pose."""

    heading: float
    """rad, the gyro's integral since it was learnt; 0 where there is none."""

    @property
    def time(self) -> float:
        """s."""
        ...

    @property
    def battery_voltage(self) -> float | None:
        """V as the controller reads it."""
        ...

    @property
    def truth(self) -> Truth:
        """The pose at the end."""
        ...

    def tick(self, left: float, right: float) -> None:
        """Duties for a cycle; the motors are shorted at 0."""
        ...

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Motors shorted; learn: the gyro's bias."""
        ...


def simulated_vehicle(
    parameters: Parameters, config: RobotConfig, seed: int, *, blind: bool, noise: bool = True
) -> Vehicle:
    """A robot at rest. blind: its program asks no sensor on the way."""
    return BlindVehicle(parameters) if blind else SensingVehicle(parameters, config, seed, noise)


class SensingVehicle:
    """With all its sensors, cycle by cycle."""

    def __init__(self, parameters: Parameters, config: RobotConfig, seed: int, noise: bool) -> None:
        self._port = SimPort(
            parameters, World.empty(), robot=config, seed=seed, noise=noise, imu_rate_hz=IMU_RATE_HZ
        )
        self._inputs: Inputs = self._port.read()
        self.heading = 0.0
        self._rate = self._bias = 0.0

    @property
    def time(self) -> float:
        """s."""
        return self._inputs.time

    @property
    def battery_voltage(self) -> float | None:
        """V as the controller reads it."""
        return self._inputs.battery_voltage

    @property
    def truth(self) -> Truth:
        """The present pose."""
        assert self._inputs.truth is not None
        return self._inputs.truth

    def tick(self, left: float, right: float) -> None:
        """Duties for a cycle."""
        self._port.write(Outputs(duty=(left, right, 0.0, 0.0), brake=BRAKE))
        before = self._inputs.time
        self._inputs = self._port.read()
        if self._inputs.turn_rate is not None:
            self._rate = self._inputs.turn_rate
        self.heading += (self._rate - self._bias) * (self._inputs.time - before)

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Motors shorted; learn: the gyro's bias."""
        rates = []
        for _ in range(round(seconds * RATE_HZ)):
            self.tick(0.0, 0.0)
            rates.append(self._rate)
        if learn and rates:
            self._bias = sum(rates) / len(rates)
            self.heading = 0.0


class BlindVehicle:
    """Without any sensor: writes the duties down, and runs along them when it is asked where it is."""

    heading = 0.0
    battery_voltage = None

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._duties: list[tuple[float, float]] = []

    @property
    def time(self) -> float:
        """s."""
        return len(self._duties) / RATE_HZ

    def tick(self, left: float, right: float) -> None:
        """Duties for a cycle."""
        self._duties.append((left, right))

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Motors shorted."""
        del learn  # there is no gyro
        self._duties.extend([(0.0, 0.0)] * round(seconds * RATE_HZ))

    @property
    def truth(self) -> Truth:
        """The pose at the end of all duties."""
        rows = np.array([*self._duties, (0.0, 0.0)])
        commands = Commands.of_wheels(np.arange(len(rows)) / RATE_HZ, rows[:, 0], rows[:, 1])
        final = State._make(rollout(self._parameters, commands, channels=()).final[0])
        return Truth(float(final.x), float(final.y), float(final.heading))
