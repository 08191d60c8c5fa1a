"""Fleet steps: voltage steps of two motors at 1 kHz, with commanded voltage, current, rim speed and battery
voltage."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raccoon.trace.foreign.table import read_table
from raccoon.trace.recording import Column, Recording

HEADER = (
    "t_s", "left_command_V", "right_command_V", "left_current_A", "right_current_A",
    "left_velocity_m_per_s", "right_velocity_m_per_s", "battery_V",
)  # fmt: skip
WHEEL_RADIUS = 0.03
"""Nominal wheel radius of these robots, m; the files contain only the speed of the rim."""
DEAD_CURRENT = 0.01
"""Current up to which the sensor of a driven motor is dead, A."""
SPIKE = 1.0
"""Step of the speed to the next reading and back, m/s, from which a reading is impossible; the fastest real
change is a tenth of it."""


def read_fleet_steps(path: str | Path, *, wheel_radius: float = WHEEL_RADIUS) -> Recording:
    """Read fleet steps: columns `motor.N.voltage`, `motor.N.current`, `motor.N.speed`, `motor.N.rim_speed`
    (m/s, as recorded) for the left (0) and the right (1) motor, and `battery.voltage`.

    wheel_radius: m. A dead current channel and single impossible speeds are blank and reported in `problems`.
    Raises TraceError if the file is not of this kind, ValueError for a radius that is not above 0.
    """
    if not wheel_radius > 0.0:
        raise ValueError(f"wheel_radius is {wheel_radius} m: it must be above 0")
    table = read_table(Path(path), HEADER, header=True)
    problems: list[str] = []
    columns = {"t": table["t_s"], "battery.voltage": table["battery_V"]}
    for port, side in enumerate(("left", "right")):
        voltage, rim = table[f"{side}_command_V"], table[f"{side}_velocity_m_per_s"]
        columns[f"motor.{port}.voltage"] = voltage
        columns[f"motor.{port}.rim_speed"] = rim
        columns[f"motor.{port}.speed"] = _without_spikes(port, rim, problems) / wheel_radius
        current = table[f"{side}_current_A"]
        if np.abs(voltage).max() > 0.0 and np.abs(current).max() < DEAD_CURRENT:
            problems.append(f"motor {port}: the current is {float(np.abs(current).max())} A at most: dead")
            current = np.full_like(current, np.nan)
        columns[f"motor.{port}.current"] = current
    return Recording(columns, problems=problems)


def _without_spikes(port: int, speed: Column, problems: list[str]) -> Column:
    """The speed with impossible readings blank. It is constant between encoder edges, so a spike lasts as
    long as its value."""
    starts = np.flatnonzero(np.diff(speed, prepend=np.nan) != 0.0)
    held = speed[starts]
    jump = np.abs(np.diff(held))
    spikes = 1 + np.flatnonzero((jump[:-1] > SPIKE) & (jump[1:] > SPIKE))
    clean = speed.copy()
    for spike in spikes:
        clean[starts[spike] : starts[spike + 1]] = np.nan
        problems.append(
            f"motor {port}: {float(held[spike])} m/s is impossible between the values before and after it"
        )
    return clean
