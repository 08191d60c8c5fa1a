"""Packed robots through the equations: one after the other, or block by block in lanes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.cpu_count import usable_cores
from raccoon.sim.plant.compiled import advance_lanes, advance_one, given, has_numba, vector
from raccoon.sim.plant.lanes import (
    BLOCK,
    GIVING,
    GIVING_KIND,
    GIVING_SELDOM_KIND,
    LINE,
    LOOSE,
    OLDER_ROW,
    PLAIN_KIND,
    READ_KIND,
    ROLLING_KIND,
    ROWS,
    SELDOM,
    SELDOM_KIND,
    STATE_ROWS,
    STRIDE,
)
from raccoon.sim.plant.quantities import PLANT_COLUMNS, Plant, State
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.packing import Lanes

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
FEW = 1  # robots up to which one after the other is faster where more than readings is asked
SHORT = 500  # rows up to which a second thread costs more than it gains
_SELDOM = {name: value for fields in SELDOM.values() for name, value in fields.items()}
_LOOSE = {name: value for each in LOOSE for name, value in SELDOM[each].items()}


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What robots run along: rows begin to end of commands, in steps no longer than `step` s.

    noise: counts on each raw back-EMF sample, (2, cycles, robots). readings_only: fields of the state on
    which no reading depends (`lanes.NO_READING`) need not be followed.
    """

    commands: Commands
    begin: int
    end: int
    step: float
    noise: Floats
    readings_only: bool = False


def cycles_of(commands: Commands, begin: int, end: int, cycle: float) -> int:
    """How many controller cycles there are between two rows: the sum of `driver.cycle_count`."""
    lengths = np.diff(commands.time[begin : end + 1])
    return int(np.sum(np.maximum(1, (lengths / cycle + 0.5).astype(np.int64))))


def run(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    """States at the end. out: (fields, rows + 1, robots), filled from row 1 on with the fields `kept`."""
    one_by_one = len(states) <= FEW and not course.readings_only
    if one_by_one or not has_numba():
        return _run_few(lanes, states, course, kept, out)
    return _run_blocks(lanes, states, course, kept, out)


def _run_few(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    advance = advance_one()
    rows = tuple(map(given, course.commands.rows))
    times, fields = given(course.commands.time), given(kept)
    final = np.empty_like(states)
    recorded = np.empty((len(kept), course.end - course.begin))  # not a part of `out`: that is compiled anew
    for robot, (state, plant) in enumerate(zip(states.tolist(), lanes.plant.tolist(), strict=True)):
        column = min(robot, course.noise.shape[2] - 1)
        noise = tuple(given(side[:, column]) for side in course.noise)
        final[robot] = advance(
            State._make(state), Plant._make(plant), rows, times, course.begin, course.end,
            lanes.cycle, course.step, lanes.slots, noise, fields, recorded,
        )  # fmt: skip
        out[:, 1:, robot] = recorded
    return final


def _run_blocks(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    commands = course.commands
    final = np.empty_like(states)
    threads = _threads() if course.end - course.begin > SHORT else 1
    jobs = [
        (advance_lanes(kind), part)
        for kind, places in _blocks(lanes.plant, course.readings_only)
        for part in _parts(places, threads)
    ]

    def advance(job: tuple[Callable[..., None], Indices]) -> None:
        compiled, places = job
        count = len(places)
        block = _block()
        block[:STATE_ROWS, :count] = states[places].T
        block[STATE_ROWS:OLDER_ROW, :count] = lanes.plant[places].T
        block[:OLDER_ROW, count:] = block[:OLDER_ROW, :1]  # idle lanes repeat the first robot
        noise = np.zeros((2, course.noise.shape[1], BLOCK))
        noise[:, :, :count] = course.noise[:, :, places]
        flat = block.reshape(-1)
        compiled(
            flat, _vectors(count), commands.rows, commands.time, course.begin, course.end, lanes.cycle,
            course.step, lanes.slots, noise, kept, out, places, count,
        )  # fmt: skip
        final[places] = flat.reshape(ROWS, STRIDE)[:STATE_ROWS, :count].T

    if threads == 1 or len(jobs) == 1:
        for job in jobs:
            advance(job)
    else:
        with ThreadPoolExecutor(threads) as pool:  # the equations run without the interpreter's lock
            list(pool.map(advance, jobs))
    return final


def _block() -> Floats:
    """Room for the numbers of a block of robots, whose rows begin with lines of the cache."""
    room = np.zeros(ROWS * STRIDE + LINE)
    begin = -room.ctypes.data % (LINE * room.itemsize) // room.itemsize
    return room[begin : begin + ROWS * STRIDE].reshape(ROWS, STRIDE)


def _threads() -> int:
    """How many blocks may run at once: one on each core, and no more than the threads that linear algebra may
    have. Whoever starts a process for each core says 1."""
    limits = [os.environ.get(name, "") for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")]
    return max(1, min([usable_cores(), *(int(each) for each in limits if each.isdecimal())]))


def _parts(places: Indices, threads: int) -> list[Indices]:
    """The robots of a block as so many threads share them, whole vectors each."""
    size = -(-_vectors(len(places)) // (threads * vector())) * vector()
    return [places[start : start + size] for start in range(0, len(places), size)]


def _blocks(plants: Floats, readings_only: bool) -> Iterator[tuple[str, Indices]]:
    """Which robots run side by side, and of which kind of `KINDS` all of them are.

    Each goes where least is computed for it; where that leaves lanes of a vector idle, others that the same
    text can run fill them.
    """
    giving, whole = _differ(plants, GIVING), _differ(plants, {"whole": 0.0})
    seldom = _differ(plants, _SELDOM) | whole
    if readings_only:
        loose = _differ(plants, _LOOSE) | whole
        kinds = [
            (GIVING_SELDOM_KIND, loose & giving, giving),
            (ROLLING_KIND, (seldom | _differ(plants, {"creep": 0.0})) & giving, giving),
            (READ_KIND, giving, giving),
        ]
    else:
        kinds = [(GIVING_SELDOM_KIND, seldom & giving, giving), (GIVING_KIND, giving, giving)]
    kinds += [(SELDOM_KIND, seldom & ~giving, ~giving), (PLAIN_KIND, ~giving, ~giving)]
    left = np.ones(len(plants), bool)
    for kind, needing, able in kinds:
        first, others = np.flatnonzero(left & needing), np.flatnonzero(left & able & ~needing)
        robots = np.concatenate([first, others[: _vectors(len(first)) - len(first)]])
        left[robots] = False
        for start in range(0, len(robots), BLOCK):
            yield kind, robots[start : start + BLOCK]


def _differ(plants: Floats, neutral: Mapping[str, float]) -> NDArray[np.bool_]:
    """Which robots have other numbers than these."""
    columns = [PLANT_COLUMNS[name] for name in neutral]
    return np.asarray((plants[:, columns] != list(neutral.values())).any(axis=1))


def _vectors(robots: int) -> int:
    """Lanes of the vectors that hold so many robots."""
    return -(-robots // vector()) * vector()
