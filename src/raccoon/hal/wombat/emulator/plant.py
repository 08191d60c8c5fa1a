"""What an emulated Wombat is wired to: motors, battery and sensors, as physics sees them."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from raccoon.core.readings import ANALOG_PORTS, DIGITAL_PORTS, GRAVITY, MOTOR_PORTS

Drive = float | None
"""What the driver does with a motor: a duty -1..1 (0 shorts it, which brakes), or None: terminals open, it
coasts. Signs are those of docs/quantities.md with the stock firmware's polarity."""

COAST: tuple[Drive, ...] = (None,) * MOTOR_PORTS


class PlantState(NamedTuple):  # made in every step: a frozen dataclass takes several times as long
    """True values, before any sensor.

    bemf_volts: induced voltage of each motor. gyro: rad/s about forward, left, up. accel: specific force in
    m/s2, +9.81 up at rest, the mean over the last `advance`. analog: volts on the pins in ADC counts 0..4095.
    digital: True is pressed.
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
    """A robot that the emulator's motor drivers and sensors hang on."""

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        """Let time pass with the motors driven this way, then tell the new state."""
        ...
