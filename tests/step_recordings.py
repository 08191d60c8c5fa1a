"""The plant fitted to recorded voltage steps of small two-wheel robots (2, 4, -4, 0 V at 1 kHz).

Fitted on the steps to 2 V and 4 V, judged on those to -4 V and 0 V, which the fit has not seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.model.battery import terminal_voltage
from raccoon.sim.commands import Commands
from raccoon.sim.parameters import Parameters
from raccoon.sim.rollout import rollout

Floats = NDArray[np.float64]
SUPPLY = 12.0  # V; the command is a voltage, so any supply above it gives the same motor voltage
RADIUS = 0.03  # m, assumed; it only scales the motor constants
SPLIT = 0.352  # s: the step to -4 V
START = np.log([4.0, 0.09, 2e-4, 0.008, 1e-5])  # ohm, V s/rad, kg m2, N m, N m s/rad
LOW = START - np.array([1.2, 1.2, 3.0, 3.0, 6.0])
HIGH = START + np.array([1.2, 1.2, 3.0, 2.0, 6.0])
LATEST = 0.05  # s
CURRENT_SD, SPEED_SD = 0.3, 0.05  # A, m/s


@dataclass(frozen=True)
class Wheel:
    """One wheel's recording."""

    time: Floats
    command: Floats
    speed: Floats
    current: Floats

    @property
    def current_is_plausible(self) -> bool:
        """Some current channels are dead."""
        return bool(np.median(np.abs(self.current[10:350])) > 0.03 and np.ptp(self.current) < 8.0)


@dataclass(frozen=True)
class Score:
    """Held-out figures: share of variance explained, RMSE (m/s), lag-1 correlation of the residual."""

    r2: float
    rmse: float
    lag1: float


def recordings(folder: Path) -> list[NDArray[np.void]]:
    """The robots' tables."""
    return [np.genfromtxt(path, delimiter=",", names=True) for path in sorted(folder.glob("robot-*.csv"))]


def wheels(table: NDArray[np.void]) -> list[Wheel]:
    """Left and right wheel of a robot."""
    return [
        Wheel(
            table["t_s"],
            table[f"{side}_command_V"],
            table[f"{side}_velocity_m_per_s"],
            table[f"{side}_current_A"],
        )
        for side in ("left", "right")
    ]


def simulated(numbers: Floats, wheel: Wheel) -> tuple[Floats, Floats]:
    """Speed (m/s) and current (A) of a wheel. numbers: logs of R, K, J, Coulomb, viscous; the latency."""
    resistance, back_emf, inertia, coulomb, viscous = (Measured(float(each)) for each in np.exp(numbers[:5]))
    model = RobotConfig().model
    motor = replace(model.left, armature_resistance=resistance, back_emf_constant=back_emf)
    model = replace(
        model,
        battery=replace(
            model.battery, open_circuit_voltage=Measured(SUPPLY), internal_resistance=Measured(0.0)
        ),
        left=motor,
        right=motor,
        friction=replace(model.friction, coulomb=coulomb, viscous=viscous),
        drive=replace(model.drive, inertia_straight=inertia, inertia_turn=inertia),
    )
    robot = Parameters.from_robot(replace(RobotConfig(), model=model))
    if len(numbers) > 5:
        robot = robot.with_effect("actuation.latency", seconds=float(numbers[5]))
    commands = Commands.of_wheels(wheel.time, wheel.command / SUPPLY, np.zeros_like(wheel.time))
    run = rollout(robot, commands, channels=("motor.0.speed", "motor.0.current"), longest_step=0.001)
    return RADIUS * run["motor.0.speed"][0], run["motor.0.current"][0]


def fitted(wheel: Wheel, latency: bool) -> Floats:
    """Numbers that fit the steps to 2 V and 4 V; with or without the catalogue's command latency."""
    train = wheel.time < SPLIT

    def residuals(numbers: Floats) -> Floats:
        speed, current = simulated(numbers, wheel)
        parts = [(speed - wheel.speed)[train] / SPEED_SD, 0.05 * (numbers[:5] - START)]
        if wheel.current_is_plausible:
            parts.append((current - wheel.current)[train] / CURRENT_SD)
        return np.concatenate(parts)

    extra = [1] if latency else []
    start = np.concatenate([START, np.multiply(extra, 0.003)])
    low, high = (
        np.concatenate([LOW, np.multiply(extra, 0.0)]),
        np.concatenate([HIGH, np.multiply(extra, LATEST)]),
    )
    scale = np.concatenate([np.full(5, 0.3), np.multiply(extra, 0.005)])
    return np.asarray(
        least_squares(residuals, start, bounds=(low, high), x_scale=scale, ftol=1e-4, max_nfev=40).x
    )


def held_out(wheel: Wheel, numbers: Floats) -> Score:
    """How well the fit foresees the steps to -4 V and 0 V, run on freely from the start."""
    test = wheel.time >= SPLIT
    truth = wheel.speed[test]
    error = simulated(numbers, wheel)[0][test] - truth
    centred = error - error.mean()
    return Score(
        r2=float(1.0 - np.sum(error**2) / np.sum((truth - truth.mean()) ** 2)),
        rmse=float(np.sqrt(np.mean(error**2))),
        lag1=float(np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2)),
    )


def sag_error(table: NDArray[np.void], split: float) -> tuple[float, float]:
    """Held-out RMS (V) of U_oc - R_i I fitted before `split` and judged after it; and of the mean alone.

    I is the motors' electrical power over the battery's voltage.
    """
    power = sum(table[f"{side}_command_V"] * table[f"{side}_current_A"] for side in ("left", "right"))
    voltage = table["battery_V"]
    current = power / voltage
    train = table["t_s"] < split
    columns = np.stack([np.ones(train.sum()), -current[train]], axis=1)
    open_circuit, resistance = np.linalg.lstsq(columns, voltage[train], rcond=None)[0]
    foreseen = terminal_voltage(open_circuit, resistance, current[~train])
    plain = voltage[~train] - voltage[train].mean()
    return (
        float(np.sqrt(np.mean((voltage[~train] - foreseen) ** 2))),
        float(np.sqrt(np.mean(plain**2))),
    )
