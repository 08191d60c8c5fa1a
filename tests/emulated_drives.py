"""Recordings of a Wombat, made behind the bytes, pauses, filters and clock of an emulated one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Outputs
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import open_emulated
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.columns import recording_of
from raccoon.trace.format import Tick, Trace
from raccoon.trace.header import Header
from raccoon.trace.recording import Recording


def record_emulated_drive(
    firmware: Firmware, robot: Parameters, duty: NDArray[np.float64], seed: int
) -> Recording:
    """A robot of the usual robot.toml's ports, driven by duty (n, 2), a row a cycle."""
    ticks = []
    with open_emulated(RobotConfig(), firmware, seed=seed, robot=robot) as port:
        for left, right in duty:
            inputs, outputs = port.read(), Outputs((float(left), float(right), 0.0, 0.0))
            port.write(outputs)
            ticks.append(Tick(inputs, (outputs,)))
    return recording_of(Trace(Header(), ticks))
