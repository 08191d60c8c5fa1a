"""The voltage a wheel needs for a motion, from the motor equation, before any feedback.

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
"""Between which shares of the nominal K_E a calibrated counter is taken to tell the motor's."""


@dataclass(frozen=True, slots=True)
class WheelModel:
    """What the feedforward knows of one wheel and its motor, at the wheel shaft.

    resistance ohm, back_emf_constant V/(rad/s), coulomb N m, viscous N m s/rad, inertia kg m2 (what the motor
    feels in the motion at hand).
    """

    resistance: float
    back_emf_constant: float
    coulomb: float
    viscous: float
    inertia: float

    def voltage(self, speed: float, acceleration: float = 0.0) -> float:
        """V for `speed` rad/s while gaining `acceleration` rad/s2; 0 at rest."""
        direction = (speed > 0.0) - (speed < 0.0) or (acceleration > 0.0) - (acceleration < 0.0)
        torque = self.inertia * acceleration + self.viscous * speed + self.coulomb * direction
        return self.back_emf_constant * speed + self.resistance / self.back_emf_constant * torque

    def pressing_voltage(self, wanted: float, speed: float, torque: float) -> float:
        """V for `wanted` rad/s, but no more than gives `torque` N m beyond friction at the present `speed`.

        A wheel that is turned back, or whose reading scatters about 0, gets what one does that stands.
        """
        ahead = max(0.0, speed if wanted > 0.0 else -speed)
        most = self.voltage(ahead, torque / self.inertia)
        return math.copysign(min(abs(self.voltage(wanted)), most), wanted)

    def top_speed(self, voltage: float) -> float:
        """rad/s at steady state with `voltage` V at the motor; 0 where it cannot overcome friction."""
        stall = self.resistance * self.coulomb / self.back_emf_constant
        slope = self.back_emf_constant + self.resistance * self.viscous / self.back_emf_constant
        return max(0.0, (voltage - stall) / slope)

    @property
    def time_constant(self) -> float:
        """s, of the speed after a step of voltage: J R / (K_E^2 + R b)."""
        return self.inertia * self.resistance / (self.back_emf_constant**2 + self.resistance * self.viscous)

    @property
    def gain(self) -> float:
        """(rad/s)/V at steady state."""
        return 1.0 / (self.back_emf_constant + self.resistance * self.viscous / self.back_emf_constant)

    @property
    def static_voltage(self) -> float:
        """V that dry friction takes."""
        return self.resistance * self.coulomb / self.back_emf_constant

    @property
    def acceleration_voltage(self) -> float:
        """V a rad/s2 takes."""
        return self.resistance * self.inertia / self.back_emf_constant

    def with_voltages(
        self, static: float | None = None, speed: float | None = None, acceleration: float | None = None
    ) -> WheelModel:
        """This wheel with the measured V, V/(rad/s) and V/(rad/s2) in place of what the model says.

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
    """Left and right wheel of a robot, with the inertia of driving straight.

    device: whose words `radians_per_tick` was calibrated with. A calibrated counter tells the motor's K_E:
    back-EMF in volts is K_E times speed, so K_E = bemf_volts * position_counts_seconds / radians_per_tick.
    Raises ConfigError where the ticks are those of another firmware: the robot would not know how far it
    drives by a factor of 181.
    """
    return _wheel_model(config, "left", device), _wheel_model(config, "right", device)


def calibrated_constant(config: RobotConfig, side: str, device: Device) -> float | None:
    """K_E of a driven motor, V/(rad/s), by its `radians_per_tick`; None where it has none."""
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
