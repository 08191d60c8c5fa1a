"""Feedforward: the voltage that a wheel needs for a motion, from the motor equation.

U = R I + K_E w and K_E I = J dw/dt + b w + T_c sign(w) give

    U = K_E w + (R / K_E) (J dw/dt + b w + T_c sign(w)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.readings import Device
from raccoon.model.bemf import foreign_ticks_reason

PLAUSIBLE_CONSTANT_SHARES = (0.4, 2.5)
"""Bounds on K_E from a calibrated counter, as shares of the nominal K_E; beyond them the nominal one is
used."""


@dataclass(frozen=True, slots=True)
class WheelModel:
    """Model of one wheel and its motor, at the wheel shaft.

    resistance: ohm. back_emf_constant: V/(rad/s). coulomb: N m. viscous: N m s/rad. inertia: kg m2, as the
    motor feels it in the present motion.
    """

    resistance: float
    back_emf_constant: float
    coulomb: float
    viscous: float
    inertia: float

    def voltage(self, speed: float, acceleration: float = 0.0) -> float:
        """V for `speed` rad/s and `acceleration` rad/s2; 0 at rest."""
        direction = (speed > 0.0) - (speed < 0.0) or (acceleration > 0.0) - (acceleration < 0.0)
        torque = self.inertia * acceleration + self.viscous * speed + self.coulomb * direction
        return self.back_emf_constant * speed + self.resistance / self.back_emf_constant * torque

    def pressing_voltage(self, wanted: float, speed: float, torque: float) -> float:
        """V for `wanted` rad/s, limited so that the torque beyond friction is at most `torque` N m at the
        present `speed`, rad/s.

        A wheel that is turned backwards, or whose reading scatters about 0, gets the voltage of a wheel at
        rest.
        """
        ahead = max(0.0, speed if wanted > 0.0 else -speed)
        most = self.voltage(ahead, torque / self.inertia)
        return math.copysign(min(abs(self.voltage(wanted)), most), wanted)

    def top_speed(self, voltage: float) -> float:
        """rad/s at steady state with `voltage` V at the motor; 0 if it does not overcome friction."""
        stall = self.resistance * self.coulomb / self.back_emf_constant
        slope = self.back_emf_constant + self.resistance * self.viscous / self.back_emf_constant
        return max(0.0, (voltage - stall) / slope)

    @property
    def time_constant(self) -> float:
        """s, time constant of the speed after a step of voltage: J R / (K_E^2 + R b)."""
        return self.inertia * self.resistance / (self.back_emf_constant**2 + self.resistance * self.viscous)

    @property
    def gain(self) -> float:
        """(rad/s)/V at steady state."""
        return 1.0 / (self.back_emf_constant + self.resistance * self.viscous / self.back_emf_constant)

    @property
    def static_voltage(self) -> float:
        """V that dry friction needs."""
        return self.resistance * self.coulomb / self.back_emf_constant

    @property
    def acceleration_voltage(self) -> float:
        """V that an acceleration of 1 rad/s2 needs."""
        return self.resistance * self.inertia / self.back_emf_constant

    def with_voltages(
        self, static: float | None = None, speed: float | None = None, acceleration: float | None = None
    ) -> WheelModel:
        """This wheel with measured V, V/(rad/s) and V/(rad/s2) instead of the model's.

        The resistance stays; a speed voltage below K_E (a wheel without viscous friction) lowers K_E.
        """
        constant, viscous = self.back_emf_constant, self.viscous
        if speed is not None:
            constant = min(constant, speed)
            viscous = (speed - constant) * constant / self.resistance
        torque = constant / self.resistance
        return WheelModel(
            self.resistance,
            constant,
            self.coulomb if static is None else static * torque,
            viscous,
            self.inertia if acceleration is None else acceleration * torque,
        )


def wheel_models(config: RobotConfig, device: Device | None = None) -> tuple[WheelModel, WheelModel]:
    """Models of a robot's left and right wheel, with the inertia of driving straight.

    device: the one whose words `radians_per_tick` was calibrated with. A calibrated counter gives the motor's
    K_E: back-EMF in volts is K_E times speed, so K_E = bemf_volts * position_counts_seconds /
    radians_per_tick. Raises ConfigError for ticks of another firmware: distances would be wrong by a factor
    of 181.
    """
    return _wheel_model(config, "left", device), _wheel_model(config, "right", device)


def calibrated_constant(config: RobotConfig, side: str, device: Device) -> float | None:
    """K_E of a driven motor, V/(rad/s), from its `radians_per_tick`; None if it has none."""
    ticks = config.wheel_motor(side).radians_per_tick
    if ticks is None:
        return None
    return device.bemf_volts * device.position_counts_seconds / ticks.value


def _wheel_model(config: RobotConfig, side: str, device: Device | None) -> WheelModel:
    model, motor = getattr(config.model, side), config.wheel_motor(side)
    constant = model.back_emf_constant.value
    told = None if device is None else calibrated_constant(config, side, device)
    if device is not None and (foreign := foreign_ticks_reason(config, side, device)):
        raise ConfigError(f"{foreign}; calibrate again (raccoon calibrate drive), or take the line out")
    if told is not None and PLAUSIBLE_CONSTANT_SHARES[0] < told / constant < PLAUSIBLE_CONSTANT_SHARES[1]:
        constant = told
    wheel = WheelModel(
        resistance=model.armature_resistance.value,
        back_emf_constant=constant,
        coulomb=config.model.friction.coulomb.value,
        viscous=config.model.friction.viscous.value,
        inertia=config.model.drive.inertia_straight.value,
    )
    measured = (motor.static_voltage, motor.speed_voltage, motor.acceleration_voltage)
    return wheel.with_voltages(*(None if each is None else each.value for each in measured))
