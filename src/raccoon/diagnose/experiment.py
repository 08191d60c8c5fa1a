"""Which safe manoeuvre would show or separate causes best on this robot, before driving it.

The evidence that a manoeuvre would give for cause A beside what is refitted and a rival B is, to first order,

    2 (log likelihood with A - without) = || P d_A ||^2

d_A: the whitened change of the recording by a usual deviation; P takes away what base numbers and B absorb
(T-optimal design after Atkinson and Fedorov 1975, with a linearised rival), and as in the search what a
wandering floor and small deviations of everything else would hide. No half second counts for more than it
would there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.features import Features
from raccoon.diagnose.hypotheses import Cause, base_coordinates, neutral_settings
from raccoon.diagnose.linear import linearise, slow_friction
from raccoon.diagnose.log import Channel, Log
from raccoon.diagnose.noise import EVENT, NoiseModel, white_noise
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.rollout import Habits, PlantRollout
from raccoon.diagnose.select.outlook import MOST_OF_EVENT
from raccoon.diagnose.whitening import faint_parts
from raccoon.sim.chain import Chain

Array = NDArray[np.float64]

RATE = 200
FLOOR_SHARE = 0.04
"""Of Coulomb friction, by which a floor's friction wanders."""
TYPICAL_NOISE = {"bemf_left": 12.0, "bemf_right": 12.0, "gyro": 0.015, "battery": 0.03}
"""Standard deviation of a bin on a moving robot, with the pushes of the floor in it."""


def _hold(left: float, right: float, seconds: float) -> Array:
    return np.tile([left, right], (max(int(seconds * RATE), 1), 1))


def _leg(left: float, right: float, seconds: float) -> Array:
    return np.vstack([_hold(left, right, seconds), _hold(0.0, 0.0, 0.5)])


def _ramp(left: float, right: float, seconds: float) -> Array:
    return np.linspace([0.0, 0.0], [left, right], max(int(seconds * RATE), 2))


def _creep() -> Array:
    up = _ramp(0.3, 0.3, 1.25)
    spin = _ramp(-0.3, 0.3, 1.25)
    return np.vstack([up, up[::-1], -up, -up[::-1], spin, spin[::-1], -spin, -spin[::-1]])


def _steps() -> Array:
    rng = np.random.default_rng(1)
    levels = rng.uniform(-1.0, 1.0, (12, 2))
    pairs = np.vstack([levels, -levels])  # each step is taken back, so the robot stays about where it is
    return np.vstack([_hold(left, right, 0.4) for left, right in pairs])


MANOEUVRES: Mapping[str, Callable[[], Array]] = {
    "straight": lambda: np.vstack([_leg(0.8, 0.8, 2.0), _leg(-0.8, -0.8, 2.0)]),
    "back and forth": lambda: np.vstack([_hold(1, 1, 0.7), _hold(-1, -1, 0.7)] * 5 + [_hold(0, 0, 0.5)]),
    "spin": lambda: np.vstack([_hold(-0.8, 0.8, 0.9), _hold(0.8, -0.8, 0.9)] * 5),
    "creep": _creep,
    "steps": _steps,
    "circles": lambda: np.vstack([_leg(0.9, 0.45, 4.0), _leg(0.45, 0.9, 4.0)]),
    "still": lambda: _hold(0.0, 0.0, 6.0),
}  # fmt: skip
"""Safe drives by name: duty (n, 2) at 200 Hz, left before right."""


@dataclass(frozen=True, slots=True)
class Advice:
    """A manoeuvre and the evidence that it is expected to give (20 and more decides)."""

    manoeuvre: str
    evidence: float
    reach: float
    seconds: float


def manoeuvre(name: str) -> Array:
    """Duty (n, 2) of a manoeuvre. Raises ConfigError for a name that does not exist."""
    if name not in MANOEUVRES:
        raise ConfigError(
            f"manoeuvre {name!r}: there is none of that name; allowed are {', '.join(MANOEUVRES)}"
        )
    return MANOEUVRES[name]()


def advise(
    robot: RobotConfig,
    cause: str,
    rivals: Sequence[str] = (),
    *,
    within: float = 2.0,
    seconds: float = 20.0,
    size: float = 1.0,
) -> list[Advice]:
    """Manoeuvres by the evidence they would give for `cause` against `rivals` (names such as id@left).

    within: m, how far from its start the robot may get. seconds: the longest drive. size: of the deviation
    that is looked for, in usual ones. Raises ConfigError for an unknown cause.
    """
    known = {each.name: each for each in drive_causes()}
    for name in (cause, *rivals):
        if name not in known:
            raise ConfigError(f"cause {name!r}: there is none of that name; see raccoon effects")
    chosen = {name: known[name] for name in (cause, *rivals)}
    found = [_advice(robot, name, cause, chosen, size) for name in MANOEUVRES]
    allowed = [each for each in found if each.reach <= within and each.seconds <= seconds]
    return sorted(allowed, key=lambda each: -each.evidence)


def _advice(robot: RobotConfig, name: str, cause: str, chosen: Mapping[str, Cause], size: float) -> Advice:
    duty = manoeuvre(name)
    log = planned_log(duty)
    habits = Habits(Chain.firmware(), brake=False)
    every = {each.name: each for each in drive_causes()}
    problem = Problem(
        Features.of(log), PlantRollout(log, robot, habits), robot, neutral_settings(robot),
        base_coordinates(robot), every,
    )  # fmt: skip
    linear = linearise(problem, problem.nominal(), list(every))
    white = _whitening(problem)
    own, wanted = white(linear.own), [white(each.columns) for each in linear.groups if each.name == cause]
    against = [white(each.columns) for each in linear.groups if each.name in chosen and each.name != cause]
    off = {each.name: white(each.columns) for each in linear.groups if each.name not in chosen}
    columns = np.vstack([own[:0], *off.values()])
    names = [name for name, each in off.items() for _ in each]
    noise = faint_parts(names, own, columns)[:, None] * columns
    floor = FLOOR_SHARE * white(slow_friction(problem, linear))
    others = np.vstack([own, *against, noise, floor])
    rows = EVENT * len(log.channels)
    evidence = max(_evidence(size * each, others, rows) for columns in wanted for each in columns)
    return Advice(name, evidence, _reach(problem), len(duty) / RATE)


def planned_log(duty: Array) -> Log:
    """A log of commands with every usual channel, as if nothing had been measured yet."""
    time = np.arange(len(duty)) / RATE
    zeros = np.zeros(len(duty))
    channels = tuple(Channel(role, role, "", zeros, noise) for role, noise in TYPICAL_NOISE.items())
    return Log(time, duty, channels)


def _whitening(problem: Problem) -> Callable[[Array], Array]:
    features = problem.features
    noise: NoiseModel = white_noise(features.floors, np.ones(len(features.time), np.intp))
    return lambda columns: noise.whiten(columns).reshape(len(columns), -1)


def _evidence(column: Array, others: Array, rows: int) -> float:
    """||P d||^2 with unit priors on the others, of which no event of so many rows may give more than the
    search lets it."""
    gram = others @ others.T + np.eye(len(others))
    left = column - np.linalg.solve(gram, others @ column) @ others
    events = np.add.reduceat(left * column, np.arange(0, len(column), rows))
    return float(np.clip(events, -2.0 * MOST_OF_EVENT, 2.0 * MOST_OF_EVENT).sum())


def _reach(problem: Problem) -> float:
    """m, the farthest from the start."""
    rollout = problem.rollout
    if not isinstance(rollout, PlantRollout):
        return 0.0
    x, y = rollout.path(problem.neutral)
    return float(np.hypot(x, y).max())
