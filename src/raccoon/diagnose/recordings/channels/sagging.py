"""How much a battery's reading sags under the wheels, before anything is simulated.

Of a duty d at a wheel with the back-EMF e a motor of resistance R draws d (d U - e) / R from the battery. So
the reading is straight in that current behind its filter, with the battery's resistance for a slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.binned import bin_means, low_passed
from raccoon.diagnose.drives.commands import until_next
from raccoon.diagnose.result import SensorFault
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BIN, BLOCK = 0.05, 20
"""s, and bins that are as one where it is asked how sure a slope is."""
FILTERS = (0.01, 0.1, 0.4)
"""s, of which the filter of the battery's reading is a mixture."""
FEWEST = 100
"""Bins."""
BATTERY = "battery.voltage"
STIFFEST = 0.008
"""ohm of a battery with its wires that is less than any has. Of 93 blind recordings of 0.05 ohm the least was
0.012, of a robot whose currents are limited."""
KNOWS = 4.0
"""Of `Sag.follows`, from which a reading knows of the motors: commands may be no duties, as those of a loop
that keeps a speed."""
SURE, INSIDE = 3.0, 3.5
"""Standard deviations by which a reading must be below it, and robot.toml's own number above."""


@dataclass(frozen=True, slots=True)
class Sag:
    """ohm, as robot.toml's motors draw current, and its standard deviation. follows: Fisher's F of all that
    the motors do in the reading, in whatever way, 1 on average where it knows nothing of them."""

    resistance: float
    std: float
    follows: float


def not_sagging(columns: Columns, robot: RobotConfig) -> SensorFault | None:
    """A battery's reading that does not know of the motors: a number that stands for one, or another's.

    It was a battery of that voltage without a resistance, a scale of the back-EMF and a track, each with a
    probability of 1.
    """
    known, sag = robot.model.battery.internal_resistance, sag_of(columns, robot)
    if sag is None or known.value - INSIDE * known.std < STIFFEST:
        return None
    if sag.resistance + SURE * sag.std > STIFFEST or sag.follows > KNOWS:
        return None
    text = (
        f"{BATTERY} does not sag while the motors draw current (as of {1e3 * max(sag.resistance, 0.0):.1f} "
        f"mohm; no battery has less than {1e3 * STIFFEST:g}): it is no reading of this one"
    )
    return SensorFault(BATTERY, "steady", text)


def sag_of(columns: Columns, robot: RobotConfig) -> Sag | None:
    """What a drive's battery reading says of its resistance; None where a channel for that is missing, or no
    motor is driven."""
    time = np.asarray(columns["t"], float)
    reading, step = columns.get(BATTERY), usual_step(time)
    # Of a time that stands still, or is in another unit, others say so.
    if reading is None or step > BIN or not (np.diff(time) > 0.0).all():
        return None
    done = _done(columns, robot)
    if done is None:
        return None
    place = ((time - time[0]) / BIN).astype(np.intp)
    count = int(place[-1]) + 1
    voltage = bin_means(place, reading, count)
    charge = bin_means(place, np.cumsum(np.abs(done[0])) * step, count)
    behind = [low_passed(each, step, seconds) for each in done for seconds in FILTERS]
    table = np.column_stack([np.ones(count), charge, *(bin_means(place, each, count) for each in behind)])
    known = np.flatnonzero(np.isfinite(voltage) & np.isfinite(table).all(axis=1))
    if len(known) < FEWEST:
        return None
    sizes = np.abs(table[known]).max(axis=0)
    if not sizes[2 : 2 + len(FILTERS)].all():  # no current: whatever the resistance is, nothing sags
        return None
    sizes = np.maximum(sizes, 1e-9)
    table, target = table[known] / sizes, voltage[known]
    of_current = 2 + len(FILTERS)
    inverse, numbers, rest = _fitted(table[:, :of_current], target)
    scores = np.zeros((int(known[-1]) // BLOCK + 1, of_current))
    np.add.at(scores, known // BLOCK, table[:, :of_current] * rest[:, None])
    whole = np.array([0.0, 0.0] + [1.0] * len(FILTERS)) / sizes[:of_current]  # of a current that stays
    spread = whole @ inverse @ (scores.T @ scores) @ inverse @ whole
    (_, _, without), (_, _, with_all) = _fitted(table[:, :2], target), _fitted(table, target)
    left = max(float(with_all @ with_all), 1e-300)
    more, freedom = table.shape[1] - 2, len(known) - table.shape[1]
    follows = (float(without @ without) - left) / left * freedom / more
    return Sag(-float(whole @ numbers), float(np.sqrt(spread)), follows)


def _fitted(table: Array, target: Array) -> tuple[Array, Array, Array]:
    """Least squares: the inverse of the normal matrix, the numbers, and what is left."""
    inverse = np.asarray(np.linalg.pinv(table.T @ table), float)
    numbers = inverse @ (table.T @ target)
    return inverse, numbers, target - table @ numbers


def _done(columns: Columns, robot: RobotConfig) -> Array | None:
    """What both wheels do, (4, rows): A that they draw; the size of their commands; their power; what
    accelerates them. None where a command or a wheel's reading is missing."""
    time = np.asarray(columns["t"], float)
    total = np.zeros((4, len(time)))
    for port, motor in ((robot.drive.left, robot.model.left), (robot.drive.right, robot.model.right)):
        duty, bemf, speed = (columns.get(f"motor.{port}.{each}") for each in ("duty", "bemf", "speed"))
        if bemf is not None:
            made = BEMF_VOLTS_PER_COUNT * np.asarray(bemf, float)
        elif speed is not None:
            made = motor.back_emf_constant.value * np.asarray(speed, float)
        if duty is None or (bemf is None and speed is None):
            return None
        seen = np.isfinite(made)
        if seen.sum() < FEWEST:
            return None
        made = np.interp(time, time[seen], made[seen])
        if bemf is not None:  # before its filter: of a wheel that reverses it would be half of the current
            made += robot.model.bemf.filter_time_constant.value * np.gradient(made, time)
        command = until_next(duty)
        full = robot.model.battery.open_circuit_voltage.value
        drawn = command * (command * full - made) / motor.armature_resistance.value
        total += [drawn, np.abs(command), made**2, np.abs(np.gradient(made, time))]
    return total
