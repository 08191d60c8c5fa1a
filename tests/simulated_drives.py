"""Recordings of the simulated robot, for what a diagnosis finds out of its own simulator."""

from __future__ import annotations

import numpy as np

from blind.drives import exciting
from raccoon.sim.commands import Commands
from raccoon.sim.parameters import Parameters
from raccoon.sim.rollout import rollout

NOISE = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.009, "battery.voltage": 0.02}


def recorded(robot: Parameters, seconds: float, seed: int = 3, brake: bool = False) -> dict[str, np.ndarray]:
    """A drive that shows everything, with the noise of its sensors."""
    rng = np.random.default_rng(seed)
    duty = exciting(rng, seconds)
    time = 0.005 * np.arange(len(duty))
    commands = Commands.of_wheels(time, duty[:, 0], duty[:, 1], brake)
    run = rollout([robot], commands, channels=tuple(NOISE), longest_step=0.001)
    columns = {name: run[name][0] + NOISE[name] * rng.standard_normal(len(time)) for name in NOISE}
    return columns | {"t": time, "motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}
