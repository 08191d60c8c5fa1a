"""Robots packed as rows of numbers, to be run side by side."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, sample_slots, wiring_signs

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """Robots packed for the equations. Make one object if the same robots run more than once.

    plant: (robots, fields of Plant). gyro: (robots, 4): scale, bias (rad/s), drift (rad/s per s), latency
    (s). signs: of the wiring, left and right. ports: of the left and the right motor. slots: where in a cycle
    each motor is sampled, 1 is its end. cycle: of the controller, s.
    """

    plant: Floats
    gyro: Floats
    signs: tuple[float, float]
    ports: tuple[int, int]
    slots: tuple[float, float]
    cycle: float

    @classmethod
    def of(cls, robots: Iterable[Parameters]) -> Lanes:
        """Pack robots, which may differ in everything but wiring and chain. Raises ConfigError if they differ
        in those, or if there is none."""
        robots = list(robots)
        if not robots:
            raise ConfigError("rollout: there is no robot to run")
        first = robots[0]
        for each in robots:
            if _wiring(each) != _wiring(first):
                raise ConfigError("rollout: the robots differ in wiring or chain; run them one by one")
        return cls(
            plant=np.array([plant_numbers(each) for each in robots]),
            gyro=np.array([_gyro_numbers(each) for each in robots]),
            signs=wiring_signs(first),
            ports=(first.robot.drive.left, first.robot.drive.right),
            slots=sample_slots(first),
            cycle=first.chain.cycle,
        )


def _wiring(parameters: Parameters) -> object:
    drive = parameters.robot.drive
    return drive.left, drive.right, wiring_signs(parameters), parameters.chain


def _gyro_numbers(parameters: Parameters) -> tuple[float, float, float, float]:
    value = parameters.value
    return (
        value("imu.gyro_scale", "factor") * parameters.robot.model.imu.gyro_scale.value,
        value("imu.gyro_bias", "rate"),
        value("imu.gyro_drift", "rate_per_second"),
        value("imu.latency", "seconds"),
    )
