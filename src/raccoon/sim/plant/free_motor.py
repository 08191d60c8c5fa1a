"""A motor that drives no wheel, such as that of an arm or a gripper between two end stops."""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device
from raccoon.model.bemf import is_plausible_k_e_share, radians_per_count
from raccoon.model.motor import speed_after


class FreeMotor:
    """One motor with the nominal constants of robot.toml and the inertia of its mechanism, by the motor
    equation without effects.

    inertia: kg m2 at the motor's shaft. device: the one whose counter robot.toml's calibration refers to; the
    calibration tells the motor's own K_E. Its words contain the wiring sign, the back-EMF filter and whole
    counts, as the board's do.
    """

    def __init__(
        self,
        config: RobotConfig,
        port: int,
        inertia: float,
        device: Device = SIMULATOR,
        stops: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:
        motor, friction = config.model.left, config.model.friction
        self.angle = 0.0
        """Angle of the shaft, rad; increases under positive duty if the motor is not inverted."""
        self.speed = 0.0
        self._sign = -1.0 if config.motor(port).inverted else 1.0
        self._resistance = motor.armature_resistance.value
        constant = motor.back_emf_constant.value
        own = device.bemf_volts / radians_per_count(config.motor(port), constant, device)
        self._constant = own if is_plausible_k_e_share(own / constant) else constant
        self._coulomb, self._viscous = friction.coulomb.value, friction.viscous.value
        self._inertia = inertia
        self._filter = max(config.model.bemf.filter_time_constant.value, 1e-6)
        self.stops = stops
        """Angles at which it is blocked in either direction, rad, relative to where it starts."""
        self._counts = 0.0
        self._counted = 0.0

    def step(self, duty: float | None, battery_voltage: float, dt: float) -> None:
        """Advance by `dt` s. duty: -1..1, in the sign of the board; None: open terminals, it coasts.
        battery_voltage: V."""
        start = self.speed
        torque, damping = 0.0, self._viscous
        if duty is not None:
            pull = self._constant / self._resistance
            torque = pull * self._sign * duty * battery_voltage
            damping += pull * self._constant
        self.speed = speed_after(dt, start, torque, self._coulomb, damping, self._inertia)
        low, high = self.stops
        wanted = self.angle + 0.5 * (start + self.speed) * dt
        self.angle = min(high, max(low, wanted))
        if self.angle != wanted:
            self.speed = 0.0
        counts = self._constant * self.speed / SIMULATOR.bemf_volts
        self._counts += (counts - self._counts) * (1.0 - math.exp(-dt / self._filter))
        self._counted += int(self._counts) * dt

    @property
    def back_emf(self) -> float:
        """Back-EMF, V, in the sign of the board."""
        return self._sign * self._constant * self.speed

    @property
    def words(self) -> tuple[int, float]:
        """Back-EMF, counts, and the sum of the position counter, counts · seconds, in the sign of the
        board."""
        return int(self._sign * self._counts), self._sign * self._counted
