"""A motor that drives no wheel: an arm or a gripper between two end stops, by the plain motor equation."""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device
from raccoon.model.bemf import is_plausible_k_e_share, radians_per_count
from raccoon.model.motor import speed_after


class FreeMotor:
    """One motor with the nominal constants of robot.toml and the inertia of its mechanism.

    device: whose counters robot.toml calibrated, which tells the motor's own K_E.

    As the board's words have them, its readings carry the wiring sign, the back-EMF filter and whole counts.
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
        """rad, positive with positive duty before the wiring sign."""
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
        """rad, where it is blocked either way, counted from where it begins."""
        self._counts = 0.0
        self._counted = 0.0

    def step(self, duty: float | None, battery_voltage: float, dt: float) -> None:
        """Let `dt` s pass at a duty in the sign of the board; None: terminals open, it coasts."""
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
        """V that it induces, in the sign of the board."""
        return self._sign * self._constant * self.speed

    @property
    def words(self) -> tuple[int, float]:
        """Back-EMF counts, and what the position counter has counted: counts · seconds."""
        return int(self._sign * self._counts), self._sign * self._counted
