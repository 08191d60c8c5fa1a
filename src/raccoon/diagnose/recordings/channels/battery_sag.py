"""Estimates the sag of a battery's reading under the motors' current, without simulation.

At duty d, battery voltage U and back-EMF e, a motor of resistance R draws d (d U - e) / R from the battery.
So the reading is linear in that current behind its filter, with the battery's resistance as the slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.bins import bin_means, low_pass
from raccoon.diagnose.drives.commands import hold_until_next
from raccoon.diagnose.result import SensorFault
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BIN_S, BLOCK_BINS = 0.05, 20
"""Width of a bin, s, and bins in a block, which counts as one independent sample in the slope's standard
deviation."""
FILTER_TAUS_S = (0.01, 0.1, 0.4)
"""Time constants, s, of low-passes whose mixture stands for the filter of the battery's reading."""
MIN_BINS = 100
"""Least number of bins, and of a wheel's samples, for an estimate."""
BATTERY = "battery.voltage"
MIN_BATTERY_OHM = 0.008
"""Lower bound of the resistance of a battery with its wires, ohm. The least estimate in 93 blind recordings
of 0.05 ohm was 0.012, for a robot with limited currents."""
MAX_UNRELATED_F = 4.0
"""`Sag.f_statistic` above which the reading depends on the motors, though not as on their current: the
commands may be no duties, but those of a speed loop."""
SAG_SIGMAS, PRIOR_SIGMAS = 3.0, 3.5
"""Standard deviations by which an estimate must be below `MIN_BATTERY_OHM`, and robot.toml's value above
it."""


@dataclass(frozen=True, slots=True)
class Sag:
    """The sag of a battery's reading. resistance: ohm, with its std, if motors draw the current that
    robot.toml gives. f_statistic: Fisher's F of all motor activity in the reading; 1 on average if the
    reading does not depend on it."""

    resistance: float
    std: float
    f_statistic: float


def missing_sag_fault(columns: Columns, robot: RobotConfig) -> SensorFault | None:
    """The fault of a battery reading that does not sag: a constant in its place, or another battery's
    reading.

    Such a reading was diagnosed as a battery without resistance, a scale of the back-EMF and a track width,
    each with a probability of 1.
    """
    prior, sag = robot.model.battery.internal_resistance, estimate_sag(columns, robot)
    if sag is None or prior.value - PRIOR_SIGMAS * prior.std < MIN_BATTERY_OHM:
        return None
    if sag.resistance + SAG_SIGMAS * sag.std > MIN_BATTERY_OHM or sag.f_statistic > MAX_UNRELATED_F:
        return None
    text = (
        f"{BATTERY} does not sag while the motors draw current (as of {1e3 * max(sag.resistance, 0.0):.1f} "
        f"mohm; no battery has less than {1e3 * MIN_BATTERY_OHM:g}): it is not the reading of this robot's "
        "battery"
    )
    return SensorFault(BATTERY, "steady", text)


def estimate_sag(columns: Columns, robot: RobotConfig) -> Sag | None:
    """The battery's resistance by its reading; None if a required channel is missing or no motor draws
    current."""
    time = np.asarray(columns["t"], float)
    reading, step = columns.get(BATTERY), median_step(time)
    # A time that does not advance or is in another unit is an error that is raised elsewhere.
    if reading is None or step > BIN_S or not (np.diff(time) > 0.0).all():
        return None
    activity = _motor_activity(columns, robot)
    if activity is None:
        return None
    bins = ((time - time[0]) / BIN_S).astype(np.intp)
    count = int(bins[-1]) + 1
    voltage = bin_means(bins, reading, count)
    charge = bin_means(bins, np.cumsum(np.abs(activity[0])) * step, count)
    filtered = [low_pass(each, step, seconds) for each in activity for seconds in FILTER_TAUS_S]
    table = np.column_stack([np.ones(count), charge, *(bin_means(bins, each, count) for each in filtered)])
    known = np.flatnonzero(np.isfinite(voltage) & np.isfinite(table).all(axis=1))
    if len(known) < MIN_BINS:
        return None
    sizes = np.abs(table[known]).max(axis=0)
    of_current = 2 + len(FILTER_TAUS_S)
    if not sizes[2:of_current].all():  # without current there is no sag at any resistance
        return None
    sizes = np.maximum(sizes, 1e-9)
    table, target = table[known] / sizes, voltage[known]
    inverse, numbers, residuals = _fit_least_squares(table[:, :of_current], target)
    scores = np.zeros((int(known[-1]) // BLOCK_BINS + 1, of_current))
    np.add.at(scores, known // BLOCK_BINS, table[:, :of_current] * residuals[:, None])
    direct_current = np.array([0.0, 0.0] + [1.0] * len(FILTER_TAUS_S)) / sizes[:of_current]
    spread = direct_current @ inverse @ (scores.T @ scores) @ inverse @ direct_current
    _, _, without = _fit_least_squares(table[:, :2], target)
    _, _, with_all = _fit_least_squares(table, target)
    residual = max(float(with_all @ with_all), 1e-300)
    extra_numbers, freedom = table.shape[1] - 2, len(known) - table.shape[1]
    f_statistic = (float(without @ without) - residual) / residual * freedom / extra_numbers
    return Sag(-float(direct_current @ numbers), float(np.sqrt(spread)), f_statistic)


def _fit_least_squares(table: Array, target: Array) -> tuple[Array, Array, Array]:
    """Least squares: inverse of the normal matrix, coefficients, residuals."""
    inverse = np.asarray(np.linalg.pinv(table.T @ table), float)
    numbers = inverse @ (table.T @ target)
    return inverse, numbers, target - table @ numbers


def _motor_activity(columns: Columns, robot: RobotConfig) -> Array | None:
    """Activity of both motors, summed, (4, rows): drawn current, A; magnitude of the commands; squared
    back-EMF; magnitude of the back-EMF's rate. None if a command or a wheel's reading is missing."""
    time = np.asarray(columns["t"], float)
    total = np.zeros((4, len(time)))
    for port, motor in ((robot.drive.left, robot.model.left), (robot.drive.right, robot.model.right)):
        duty, bemf, speed = (columns.get(f"motor.{port}.{each}") for each in ("duty", "bemf", "speed"))
        if bemf is not None:
            back_emf = BEMF_VOLTS_PER_COUNT * np.asarray(bemf, float)
        elif speed is not None:
            back_emf = motor.back_emf_constant.value * np.asarray(speed, float)
        if duty is None or (bemf is None and speed is None):
            return None
        known = np.isfinite(back_emf)
        if known.sum() < MIN_BINS:
            return None
        back_emf = np.interp(time, time[known], back_emf[known])
        if bemf is not None:  # compensate the filter's lag, which at a reversing wheel is half of the current
            back_emf += robot.model.bemf.filter_time_constant.value * np.gradient(back_emf, time)
        command = hold_until_next(duty)
        full = robot.model.battery.open_circuit_voltage.value
        drawn = command * (command * full - back_emf) / motor.armature_resistance.value
        total += [drawn, np.abs(command), back_emf**2, np.abs(np.gradient(back_emf, time))]
    return total
