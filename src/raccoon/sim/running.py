"""Packed robots through the equations: one after the other, or block by block in lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.sim.commands import Commands
from raccoon.sim.compiled import advance_lanes, advance_one, has_numba
from raccoon.sim.lanes import BLOCK, OLDER_ROW, ROWS, STATE_ROWS, STRIDE, VECTOR
from raccoon.sim.packing import Lanes
from raccoon.sim.quantities import Plant, State

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
FEW = 1  # robots up to which one after the other is faster


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What robots run along: rows begin to end of commands, in steps no longer than `step` s.

    noise: counts on each raw back-EMF sample, (2, cycles, robots).
    """

    commands: Commands
    begin: int
    end: int
    step: float
    noise: Floats


def cycles_of(commands: Commands, begin: int, end: int, cycle: float) -> int:
    """How many controller cycles there are between two rows: the sum of `driver.cycle_count`."""
    lengths = np.diff(commands.time[begin : end + 1])
    return int(np.sum(np.maximum(1, (lengths / cycle + 0.5).astype(np.int64))))


def run(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    """States at the end. out: (fields, rows + 1, robots), filled from row 1 on with the fields `kept`."""
    if len(states) <= FEW or not has_numba():
        return _run_few(lanes, states, course, kept, out)
    return _run_blocks(lanes, states, course, kept, out)


def _run_few(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    advance = advance_one()
    commands = course.commands
    final = np.empty_like(states)
    for robot, (state, plant) in enumerate(zip(states.tolist(), lanes.plant.tolist(), strict=True)):
        column = min(robot, course.noise.shape[2] - 1)
        noise = tuple(np.ascontiguousarray(side[:, column]) for side in course.noise)
        final[robot] = advance(
            State._make(state), Plant._make(plant), commands.rows, commands.time, course.begin, course.end,
            lanes.cycle, course.step, lanes.slots, noise, kept, out[:, 1:, robot],
        )  # fmt: skip
    return final


def _run_blocks(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    advance = advance_lanes()
    commands = course.commands
    final = np.empty_like(states)
    for first in range(0, len(states), BLOCK):
        count = min(BLOCK, len(states) - first)
        width = -(-count // VECTOR) * VECTOR
        block = np.zeros((ROWS, STRIDE))
        block[:STATE_ROWS, :count] = states[first : first + count].T
        block[STATE_ROWS:OLDER_ROW, :count] = lanes.plant[first : first + count].T
        block[:OLDER_ROW, count:] = block[:OLDER_ROW, :1]  # idle lanes repeat the first robot
        noise = np.zeros((2, course.noise.shape[1], BLOCK))
        noise[:, :, :count] = course.noise[:, :, first : first + count]
        flat = block.reshape(-1)
        advance(
            flat, width, commands.rows, commands.time, course.begin, course.end, lanes.cycle, course.step,
            lanes.slots, noise, kept, out, first, count,
        )  # fmt: skip
        final[first : first + count] = flat.reshape(ROWS, STRIDE)[:STATE_ROWS, :count].T
    return final
