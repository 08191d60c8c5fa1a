"""Recordings of the simulated robot, for what a diagnosis finds out of its own simulator."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from blind.drives import exciting
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

NOISE = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.009, "battery.voltage": 0.02}
BLIND_CONTROLLER, SIMULATED_CONTROLLER = (
    Firmware(f"the controller of {name} drives", chain, wombat=False, has_gyro_low_pass=False)
    for name, chain in (("blind", Chain.firmware()), ("simulated", Chain()))
)
"""Controllers for tests that ask for something else: a diagnosis that is told does not search for habits,
which is a third of its time or more. Every cause is still considered."""


def record_simulated_drive(
    robot: Parameters,
    seconds: float,
    seed: int = 3,
    brake: bool = False,
    softened: int = 1,
    noise: Mapping[str, float] | None = None,
    row: float = 0.005,
) -> dict[str, np.ndarray]:
    """A drive that shows everything, with the noise of its sensors.

    softened: rows over which each command is averaged. noise: of some channels, instead of the usual.
    row: s, whole multiples of 5 ms.
    """
    rng = np.random.default_rng(seed)
    duty = exciting(rng, seconds)[:: round(row / 0.005)]
    soft = np.ones(softened) / softened
    left, right = (np.clip(np.convolve(each, soft, "same"), -1.0, 1.0) for each in duty.T)
    time = row * np.arange(len(duty))
    commands = Commands.of_wheels(time, left, right, brake)
    run = rollout([robot], commands, channels=tuple(NOISE), longest_step=0.001)
    sizes = NOISE | dict(noise or {})
    columns = {name: run[name][0] + sizes[name] * rng.standard_normal(len(time)) for name in NOISE}
    return columns | {"t": time, "motor.0.duty": left, "motor.1.duty": right}
