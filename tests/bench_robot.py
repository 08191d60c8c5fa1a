"""A robot of a few lines for tests of the emulator: motors of the first order, two of them wheels."""

from __future__ import annotations

import math

from raccoon.hal.wombat.emulator import Drive, PlantState

RESISTANCE = 1.8
K_E = 1.08
INERTIA = 0.02
COULOMB = 0.18
WHEEL_RADIUS = 0.0345
TRACK_WIDTH = 0.16


class BenchRobot:
    """Ports 0 and 1 are the left and the right wheel; 2 and 3 turn freely. Positive duty drives forward."""

    def __init__(self, open_circuit_voltage: float = 6.8, internal_resistance: float = 0.05) -> None:
        self.open_circuit_voltage = open_circuit_voltage
        self.internal_resistance = internal_resistance
        self.speeds = [0.0] * 4
        self.angles = [0.0] * 4
        self.x = self.y = self.heading = 0.0
        self.time = 0.0
        self.analog = (2000.0, 1000.0, 500.0, 3000.0, 1500.0, 2500.0)
        self.digital = (False,) * 10
        self.button = False
        self._voltage = open_circuit_voltage

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        load = 0.0
        for port, drive in enumerate(drives):
            current = 0.0
            if drive is not None:
                current = (drive * self._voltage - K_E * self.speeds[port]) / RESISTANCE
                load += abs(drive) * max(current * math.copysign(1.0, drive), 0.0)
            self._turn(port, K_E * current, seconds)
        self._voltage = self.open_circuit_voltage - self.internal_resistance * load
        self._roll(seconds)
        return self.state()

    def _turn(self, port: int, torque: float, seconds: float) -> None:
        speed = self.speeds[port]
        if speed == 0.0 and abs(torque) <= COULOMB:
            return
        friction = COULOMB * math.copysign(1.0, speed or torque)
        new = speed + (torque - friction) / INERTIA * seconds
        if new * speed < 0.0:
            new = 0.0  # friction stops; it does not turn back
        self.angles[port] += 0.5 * (speed + new) * seconds
        self.speeds[port] = new

    @property
    def turn_rate(self) -> float:
        return (self.speeds[1] - self.speeds[0]) * WHEEL_RADIUS / TRACK_WIDTH

    def _roll(self, seconds: float) -> None:
        self.time += seconds
        middle = self.heading + 0.5 * self.turn_rate * seconds
        distance = 0.5 * (self.speeds[0] + self.speeds[1]) * WHEEL_RADIUS * seconds
        self.x += distance * math.cos(middle)
        self.y += distance * math.sin(middle)
        self.heading += self.turn_rate * seconds

    def state(self) -> PlantState:
        return PlantState(
            bemf_volts=tuple(K_E * speed for speed in self.speeds),
            battery_voltage=self._voltage,
            gyro=(0.0, 0.0, self.turn_rate),
            analog=self.analog,
            digital=self.digital,
            button=self.button,
        )
