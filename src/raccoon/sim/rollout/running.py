"""Running packed robots through the equations: one after the other, or block by block in lanes."""

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
    CREEPING,
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
FEW = 1  # robots; up to so many, one after the other is faster unless only readings are needed
SHORT = 500  # rows; up to so many, a second thread costs more time than it saves
_SELDOM = {name: value for fields in SELDOM.values() for name, value in fields.items()}
_LOOSE = {name: value for each in LOOSE for name, value in SELDOM[each].items()}


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What the robots run along: the rows from begin to end of the commands, in steps no longer than `step`
    s.

    noise: counts added to each raw back-EMF sample, (2, cycles, robots). readings_only: fields of the state
    on which no reading depends (`lanes.NO_READING`) need not be computed.
    """

    commands: Commands
    begin: int
    end: int
    step: float
    noise: Floats
    readings_only: bool = False


def cycles_of(commands: Commands, begin: int, end: int, cycle: float) -> int:
    """Number of controller cycles between two rows: the sum of `driver.cycle_count`. cycle: s."""
    lengths = np.diff(commands.time[begin : end + 1])
    return int(np.sum(np.maximum(1, (lengths / cycle + 0.5).astype(np.int64))))


def run(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    """Run the robots along a course; returns their final states, (robots, fields of State).

    kept: indices of the fields to record. out: (kept fields, rows + 1, robots), filled from row 1 on.
    """
    one_by_one = len(states) <= FEW and not course.readings_only
    if one_by_one or not has_numba():
        return _run_few(lanes, states, course, kept, out)
    return _run_blocks(lanes, states, course, kept, out)


def _run_few(lanes: Lanes, states: Floats, course: Course, kept: Indices, out: Floats) -> Floats:
    advance = advance_one()
    rows = tuple(map(given, course.commands.rows))
    times, fields = given(course.commands.time), given(kept)
    final = np.empty_like(states)
    recorded = np.empty((len(kept), course.end - course.begin))  # a view of `out` would be compiled anew
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
        block[:OLDER_ROW, count:] = block[:OLDER_ROW, :1]  # idle lanes compute the first robot again
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
        with ThreadPoolExecutor(threads) as pool:  # the equations release the interpreter's lock
            list(pool.map(advance, jobs))
    return final


def _block() -> Floats:
    """An array for the numbers of a block of robots, (ROWS, STRIDE), whose rows are aligned to cache
    lines."""
    room = np.zeros(ROWS * STRIDE + LINE)
    begin = -room.ctypes.data % (LINE * room.itemsize) // room.itemsize
    return room[begin : begin + ROWS * STRIDE].reshape(ROWS, STRIDE)


def _threads() -> int:
    """Number of blocks that may run at once: one per core, but no more than the thread limits of linear
    algebra (OMP_NUM_THREADS, OPENBLAS_NUM_THREADS). A program that starts one process per core sets these to
    1."""
    limits = [os.environ.get(name, "") for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")]
    return max(1, min([usable_cores(), *(int(each) for each in limits if each.isdecimal())]))


def _parts(places: Indices, threads: int) -> list[Indices]:
    """The robots of a block divided among so many threads, each part in whole vectors."""
    size = -(-_vectors(len(places)) // (threads * vector())) * vector()
    return [places[start : start + size] for start in range(0, len(places), size)]


def _blocks(plants: Floats, readings_only: bool) -> Iterator[tuple[str, Indices]]:
    """The blocks of robots that run side by side, each with the kind of `KINDS` to which all its robots
    belong.

    Each robot goes to the kind that computes least for it. Where this leaves lanes of a vector idle, other
    robots that the same code can run fill them.
    """
    giving, whole = _differ(plants, GIVING), _differ(plants, {"whole": 0.0})
    seldom = _differ(plants, _SELDOM) | whole
    if readings_only:
        loose = _differ(plants, _LOOSE) | whole
        kinds = [
            (GIVING_SELDOM_KIND, loose & giving, giving),
            (ROLLING_KIND, (seldom | _differ(plants, CREEPING)) & giving, giving),
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
    """Mask of the robots, (robots,), that differ from these values in at least one field of Plant."""
    columns = [PLANT_COLUMNS[name] for name in neutral]
    return np.asarray((plants[:, columns] != list(neutral.values())).any(axis=1))


def _vectors(robots: int) -> int:
    """Number of robots rounded up to whole vectors."""
    return -(-robots // vector()) * vector()
