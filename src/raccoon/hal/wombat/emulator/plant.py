"""The plant of an emulated Wombat: protocol and true values of motors, battery and sensors."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from raccoon.core.readings import ANALOG_PORTS, DIGITAL_PORTS, GRAVITY, MOTOR_PORTS

Drive = float | None
"""State of a motor's driver: a duty -1..1 (0 shorts the motor, which brakes), or None: terminals open, the
motor coasts. Signs are those of docs/quantities.md with the stock firmware's polarity."""

COAST: tuple[Drive, ...] = (None,) * MOTOR_PORTS


class PlantState(NamedTuple):  # made in every step: a frozen dataclass takes several times as long
    """True values, before any sensor.

    bemf_volts: induced voltage of each motor. gyro: rad/s about forward, left, up. accel: specific force in
    m/s2, +9.81 up at rest, the mean over the last `advance`. analog: voltages on the pins as ADC counts
    0..4095. digital, button: True is pressed. temperature: Celsius.
    """

    bemf_volts: tuple[float, ...] = (0.0,) * MOTOR_PORTS
    battery_voltage: float = 6.8
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accel: tuple[float, float, float] = (0.0, 0.0, GRAVITY)
    analog: tuple[float, ...] = (2000.0,) * ANALOG_PORTS
    digital: tuple[bool, ...] = (False,) * DIGITAL_PORTS
    button: bool = False
    temperature: float = 30.0


class Plant(Protocol):
    """The robot to which the emulator's motor drivers and sensors are connected."""

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        """Advance by `seconds` with the motors driven this way and return the new state."""
        ...
