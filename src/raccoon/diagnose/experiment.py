"""Which safe manoeuvre would show or separate causes best on this robot, before driving it.

The evidence that a manoeuvre would give for cause A beside what is refitted and a rival B is, to first order,

    2 (log likelihood with A - without) = || P d_A ||^2

d_A: the whitened change of the recording by a usual deviation; P takes away what base numbers and B absorb
(T-optimal design after Atkinson and Fedorov 1975, with a linearised rival), and as in the search what a
wandering floor, its pushes and small deviations of everything else would hide. B is the cause of the
catalogue that leaves least, or also those that are asked for. Of a slope it is the evidence along that
direction in which it shows least, of other causes with two numbers that of the first. No half second counts
for more than it would in the search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.features import Features
from raccoon.diagnose.hypotheses import Cause, base_coordinates, neutral_settings
from raccoon.diagnose.linear import Group, Linear, linearise, slow_friction
from raccoon.diagnose.log import Channel, Log
from raccoon.diagnose.naming import TWINS
from raccoon.diagnose.noise import CHANGING, EVENT, white_noise
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.rollout import Habits, PlantRollout
from raccoon.diagnose.select.outlook import MOST_OF_EVENT
from raccoon.diagnose.select.refits import SCALE
from raccoon.diagnose.whitening import faint_parts, regimes_of
from raccoon.sim.chain import Chain

Array = NDArray[np.float64]

RATE = 200
ARROWS = ("drive.slope", "drive.wheel_eccentricity")
"""Causes whose two numbers are one arrow, of which nobody knows where it points."""
DECIDES = 30.0
"""Evidence from which a drive decides."""
FLOOR_SHARE = 0.04
"""Of Coulomb friction, by which a floor's friction wanders."""
PUSH_SHARE = 0.07
"""Of Coulomb friction, with which floor and gear push a wheel."""
PUSH_SECONDS = 0.15
"""How long such a push lasts: several bins then tell one thing, which hides whatever is steady."""
TYPICAL_NOISE = {"bemf_left": 4.0, "bemf_right": 4.0, "gyro": 0.008, "battery": 0.015}
"""Standard deviation of a bin beside that, on a robot that drives steadily."""
CHANGING_NOISE = 2.5
"""How much larger it is where a wheel speeds up or brakes: no model follows that as well."""


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
    """A manoeuvre and the evidence that it is expected to give.

    reach: m, the farthest from its start. nearest: the rival that leaves least of it; empty where none does.
    """

    manoeuvre: str
    evidence: float
    reach: float
    seconds: float
    nearest: str


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
    chosen = (cause, *rivals)
    for name in chosen:
        if name not in known:
            raise ConfigError(f"cause {name!r}: there is none of that name; see raccoon effects")
    drives = {name: make() for name, make in MANOEUVRES.items()}
    found = [
        _advice(robot, name, duty, known, chosen, size)
        for name, duty in drives.items()
        if duty.any()  # no diagnosis is made of a still robot
    ]
    allowed = [each for each in found if each.reach <= within and each.seconds <= seconds]
    return sorted(allowed, key=lambda each: -each.evidence)


def _advice(
    robot: RobotConfig,
    name: str,
    duty: Array,
    every: Mapping[str, Cause],
    chosen: tuple[str, ...],
    size: float,
) -> Advice:
    """chosen: the cause, then the rivals that were asked for."""
    cause = chosen[0]
    log = planned_log(duty)
    habits = Habits(Chain.firmware(), brake=False)
    problem = Problem(
        Features.of(log), PlantRollout(log, robot, habits, plain=True), robot, neutral_settings(robot),
        base_coordinates(robot), every,
    )  # fmt: skip
    linear = linearise(problem, problem.nominal(), list(every))
    white = _whitening(problem)
    columns = [(group, white(group.columns)) for group in linear.groups]
    off = [(group.name, each) for group, each in columns if group.name not in chosen]
    asked = [each for group, each in columns if group.name in chosen[1:] and group.name != cause]
    hidden_by = np.vstack([*_hiding(problem, linear, white, off), *asked])
    rivals = [each for each in off if _another(each[0], cause)]
    rows = EVENT * len(log.channels)
    evidence, nearest = min(
        _evidence(size * each, hidden_by, rivals, rows) for each in _wanted(columns, cause, size)
    )
    return Advice(name, evidence, _reach(problem), len(duty) / RATE, nearest)


Columns = Sequence[tuple[Group, Array]]


def _hiding(
    problem: Problem,
    linear: Linear,
    white: Callable[[Array], Array],
    off: Sequence[tuple[str, Array]],
) -> tuple[Array, ...]:
    """Whitened directions in which a recording may change without the cause: base numbers, a little of every
    effect that is `off`, floor and gear."""
    own = white(linear.own)
    small = np.vstack([own[:0], *(each for _, each in off)])
    inexact = faint_parts([name for name, each in off for _ in each], own, small)[:, None] * small
    floor = FLOOR_SHARE * white(slow_friction(problem, linear))
    pushes = PUSH_SHARE * white(slow_friction(problem, linear, PUSH_SECONDS))
    return own, inexact, floor, pushes


def _wanted(columns: Columns, cause: str, size: float) -> list[Array]:
    """Columns of the cause at about that size: the first, or every part of an arrow."""
    own = [(abs(_strength(group) - size), each) for group, each in columns if group.name == cause]
    nearest = min(away for away, _ in own)
    parts = None if cause.startswith(ARROWS) else 1
    return [column for away, each in own if away <= nearest for column in each[:parts]]


def _strength(group: Group) -> float:
    """Widths of the deviation at which a cause's columns were taken; a straight line's are those of any."""
    return group.start[0] if group.start else 1.0


def _another(name: str, cause: str) -> bool:
    """Whether a cause is a rival: not the same at another place, and no twin that is one class with it."""
    pair = {name.partition("@")[0], cause.partition("@")[0]}
    return len(pair) == 2 and not any(pair <= twins for twins in (*TWINS, frozenset(SCALE)))


def planned_log(duty: Array) -> Log:
    """A log of commands with every usual channel, as if nothing had been measured yet."""
    time = np.arange(len(duty)) / RATE
    zeros = np.zeros(len(duty))
    channels = tuple(Channel(role, role, "", zeros, noise) for role, noise in TYPICAL_NOISE.items())
    return Log(time, duty, channels)


def _whitening(problem: Problem) -> Callable[[Array], Array]:
    """Of the noise that a drive usually has, by what the wheels do in it as the nominal robot drives it."""
    features = problem.features
    expected = replace(features, measured=problem.predict([problem.nominal()])[0])
    noise = white_noise(features.floors, regimes_of(replace(problem, features=expected)))
    unmix = noise.unmix.copy()
    unmix[CHANGING] /= CHANGING_NOISE
    noise = replace(noise, unmix=unmix)
    return lambda columns: noise.whiten(columns).reshape(len(columns), -1)


def _evidence(
    column: Array, others: Array, rivals: Sequence[tuple[str, Array]], rows: int
) -> tuple[float, str]:
    """||P d||^2 with unit priors on the others and on that rival which leaves least, of which no event of so
    many rows may give more than the search lets it; and the rival."""
    inverse = np.linalg.inv(others @ others.T + np.eye(len(others)))

    def beside(columns: Array) -> Array:
        return np.asarray(columns - (columns @ others.T) @ inverse @ others, float)

    left = beside(column[None])[0]
    found = [(_limited(left * column, rows), "")]
    for name, rival in rivals:
        its = beside(rival)
        share = np.linalg.solve(np.eye(len(rival)) + its @ rival.T, rival @ left)
        found.append((_limited((left - share @ its) * column, rows), name))
    return min(found)


def _limited(products: Array, rows: int) -> float:
    events = np.add.reduceat(products, np.arange(0, len(products), rows))
    return max(float(np.clip(events, -2.0 * MOST_OF_EVENT, 2.0 * MOST_OF_EVENT).sum()), 0.0)


def _reach(problem: Problem) -> float:
    """m, the farthest from the start."""
    rollout = problem.rollout
    if not isinstance(rollout, PlantRollout):
        return 0.0
    x, y = rollout.path(problem.neutral)
    return float(np.hypot(x, y).max())
