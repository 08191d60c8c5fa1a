"""Commands that are no duty: a controller that keeps the speed it is told gives its motors what that takes.

A motor under a duty d of the voltage U turns with e = a U d - c sign(d), where c = R friction / K_E is what
friction takes, some 0.3 V. Under a speed loop the same friction takes nothing of the speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.magnitudes import last_change

Array = NDArray[np.float64]

STEADY_S = 0.3
"""s since a command changed, after which a wheel has the speed that it keeps."""
MIN_ROWS, MIN_COMMAND_RATIO = 40, 1.5
"""Rows of a wheel that are asked, and the factor by which the largest of their commands is over the least."""
MIN_BEMF_SHARE = 0.02
"""Of the battery's voltage: back-EMF from which a wheel moves."""
MAX_FRICTION_SHARE = 0.35
"""Part of what friction should take, up to which next to nothing of it shows; of a hundred drives by duty the
least was 0.55, but for three that were held by walls."""
DUTY_GAIN_RANGE, MAX_NO_FRICTION_SHARE = (0.9, 1.04), 0.1
"""Part of the battery's voltage that a command of 1 keeps of a motor under a duty; and part of what friction
should take, above which such commands are one: of a robot that has less friction than this robot.toml, as a
robot.toml of another robot makes it look (0.31). Below that nothing else need be asked."""
MAX_LINE_ERROR_V, MAX_GAIN_DIFFERENCE = 0.05, 0.03
"""V, root mean square, to which the speeds of a loop go by its commands; and the part by which two wheels'
differ at most."""


@dataclass(frozen=True, slots=True)
class SpeedLoop:
    """counts: of back-EMF that a command of 1 stands for. taken, usual: V that friction takes, and should.
    share: the part that it takes of the wheel where it takes more of what it should."""

    counts: float
    taken: float
    usual: float
    share: float

    @property
    def clear(self) -> bool:
        """Whether no robot's friction is as small as that of a motor under a duty would have to be."""
        return self.share < MAX_NO_FRICTION_SHARE


def find_speed_loop(log: Log, robot: RobotConfig) -> SpeedLoop | None:
    """What the steady speeds of both wheels say, None where they do not say that a loop keeps them."""
    battery = log.channel("battery")
    full = robot.model.battery.open_circuit_voltage.value
    volts = np.full(len(log.time), full)
    if battery is not None and np.isfinite(battery.values).sum() >= MIN_ROWS:
        known = np.isfinite(battery.values)
        volts = np.interp(log.time, log.time[known], battery.values[known])
    model = robot.model
    lines, usual = [], []
    for index, (side, motor) in enumerate((("left", model.left), ("right", model.right))):
        wheel = log.channel(f"bemf_{side}")
        line = None
        if wheel is not None:
            line = _fit_line(log.time, log.duty[:, index], BEMF_VOLTS_PER_COUNT * wheel.values, volts)
        if line is None:
            return None
        lines.append(line)
        friction = model.friction.coulomb.value * motor.armature_resistance.value
        usual.append(friction / motor.back_emf_constant.value)
    (left, left_c), (right, right_c) = lines
    if abs(left / right - 1.0) > MAX_GAIN_DIFFERENCE:
        return None
    shares = [abs(c) / max(each, 1e-9) for c, each in zip((left_c, right_c), usual, strict=True)]
    if max(shares) > MAX_FRICTION_SHARE:
        return None
    least, most = DUTY_GAIN_RANGE
    if least < min(left, right) and max(left, right) < most and min(shares) > MAX_NO_FRICTION_SHARE:
        return None
    counts = 0.5 * (left + right) * float(np.median(volts)) / BEMF_VOLTS_PER_COUNT
    return SpeedLoop(counts, 0.5 * (left_c + right_c), 0.5 * sum(usual), max(shares))


def _fit_line(time: Array, duty: Array, speed: Array, volts: Array) -> tuple[float, float] | None:
    """Part of the command's voltage that a wheel keeps, and V that are taken off; None where its steady rows
    are too few, too much alike, or on no line."""
    asked = (time - time[last_change(duty)] >= STEADY_S) & np.isfinite(speed) & (duty != 0.0)
    asked &= np.abs(np.nan_to_num(speed)) > MIN_BEMF_SHARE * volts
    if asked.sum() < MIN_ROWS:
        return None
    d, e, u = duty[asked], speed[asked], volts[asked]
    if np.abs(d).max() < MIN_COMMAND_RATIO * np.abs(d).min():
        return None
    columns = np.column_stack([u * d, -np.sign(d)])
    found: Array = np.asarray(np.linalg.lstsq(columns, e, rcond=None)[0], float)
    off = float(np.sqrt(np.mean((e - columns @ found) ** 2)))
    return None if off > MAX_LINE_ERROR_V or found[0] <= 0.0 else (float(found[0]), float(found[1]))
