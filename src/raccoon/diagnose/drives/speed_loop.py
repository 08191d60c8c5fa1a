"""Recognises commands that are set speeds of a controller's speed loop, not duties.

Under a duty d at the voltage U a motor has the back-EMF e = a U d - c sign(d), where c = R friction / K_E is
the part that friction takes, some 0.3 V. A speed loop makes up for friction, so c is 0.
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
"""Time after a change of the command, s, from which a wheel's speed is steady."""
MIN_ROWS, MIN_COMMAND_RATIO = 40, 1.5
"""Least number of steady rows of a wheel, and least ratio of their largest to their smallest command."""
MIN_BEMF_SHARE = 0.02
"""Back-EMF of a moving wheel, as a share of the battery's voltage."""
MAX_FRICTION_SHARE = 0.35
"""Largest c of a speed loop, as a share of the c that robot.toml's friction gives. Of a hundred drives by
duty the least was 0.55, but for three that walls had held."""
DUTY_GAIN_RANGE, MAX_NO_FRICTION_SHARE = (0.9, 1.04), 0.1
"""Where a, back-EMF over the command's voltage, is in this range and c above this share, the commands are
duties of a robot with less friction than this robot.toml says (0.31 with another robot's). Below the share
no robot's friction is that small, whatever a is."""
MAX_LINE_ERROR_V, MAX_GAIN_DIFFERENCE = 0.05, 0.03
"""Largest RMS deviation of a loop's speeds from the line, V, and largest relative difference of the two
wheels' slopes."""


@dataclass(frozen=True, slots=True)
class SpeedLoop:
    """counts: back-EMF for a command of 1. taken, usual: c as measured and by robot.toml's friction, V.
    share: the larger of the two wheels' taken over usual."""

    counts: float
    taken: float
    usual: float
    share: float

    @property
    def clear(self) -> bool:
        """Whether the commands cannot be duties: no robot has so little friction."""
        return self.share < MAX_NO_FRICTION_SHARE


def find_speed_loop(log: Log, robot: RobotConfig) -> SpeedLoop | None:
    """The speed loop that the steady speeds of both wheels show; None where they show none."""
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
    """Slope of a wheel's back-EMF over the command's voltage, and the voltage that is subtracted; None where
    its steady rows are too few, too similar, or on no line."""
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
