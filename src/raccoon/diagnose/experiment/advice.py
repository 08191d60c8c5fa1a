"""Predicts, before a drive, which safe manoeuvre shows or separates causes best on this robot, and how well.

The evidence of a manoeuvre for cause A, beside the refitted base numbers and a rival B, is to first order

    2 (log likelihood with A - without) = || P d_A ||^2

d_A: the whitened change of the recording by a usual deviation of A. P: projection that removes what base
numbers and B absorb (T-optimal design after Atkinson and Fedorov 1975, with a linearised rival) and, as in
the search, what wandering floor friction, pushes of the floor and small deviations of all other causes would
hide. B is the cause of the catalogue that leaves the least evidence, in addition to given rivals. For a slope
it is the evidence in the direction in which it shows least; for other causes with two parameters, that of the
first. No half second counts for more than it would in the search.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.core.progress import report
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.diagnose.experiment.manoeuvres import MANOEUVRES, RATE
from raccoon.diagnose.findings.cause_results import INDISTINGUISHABLE_CLASSES
from raccoon.diagnose.fit.linear_model import ColumnGroup, linearise
from raccoon.diagnose.fit.noise_estimation import classify_regimes, form_error_parts
from raccoon.diagnose.fit.noise_model import CHANGING, EVENT_BINS, white_noise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.fit.wander import creeping_battery_columns, wandering_friction_columns
from raccoon.diagnose.hypotheses.base_coordinates import base_coordinates, with_default_stds
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause, neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.diagnose.select.detection_limits import MIN_VISIBLE_EVIDENCE, format_detection_limit
from raccoon.diagnose.select.fit_comparison import MAX_EVENT_LEAD
from raccoon.diagnose.select.gates import gate
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import all_effects, effect

Array = NDArray[np.float64]

DIRECTED_CAUSES = ("drive.slope", "drive.wheel_eccentricity")
"""Causes whose two parameters are the components of a vector of unknown direction."""
DECISIVE_EVIDENCE = 30.0
"""Evidence above which a drive decides between causes."""
FLOOR_SHARE = 0.04
"""Amplitude of the floor's wandering friction, as a share of Coulomb friction."""
PUSH_SHARE = 0.07
"""Amplitude of short pushes of floor and gear on a wheel, as a share of Coulomb friction."""
PUSH_SECONDS = 0.15
"""Duration of such a push, s: the noise of several bins is then correlated, which hides steady effects."""
TYPICAL_NOISE = {"bemf_left": 4.0, "bemf_right": 4.0, "gyro": 0.008, "battery": 0.015}
"""Standard deviation of the other noise in a bin of each channel (counts, rad/s, V) on a robot that drives
steadily."""
CHANGING_NOISE = 2.5
"""Factor on this noise while a wheel speeds up or brakes, which no model follows as well."""

REACH_MARGIN_SHARE, REACH_MARGIN_M = 0.15, 0.02
"""Margin on the planned distance from the start, as a share and in m, for robots that `sweep.factors` draws
and for a usual deviation of any cause: nothing steers a drive of open-loop duties, so unequal wheels bend all
of it."""


@dataclass(frozen=True, slots=True)
class Advice:
    """A manoeuvre and its expected evidence.

    reach: largest distance from its start, m (`estimate_reach`). seconds: its duration. nearest: the rival
    that leaves the least evidence, "" if none reduces it.
    """

    manoeuvre: str
    evidence: float
    reach: float
    seconds: float
    nearest: str


def rank_manoeuvres(
    robot: RobotConfig,
    cause: str,
    rivals: Sequence[str] = (),
    *,
    within: float = 2.0,
    seconds: float = 20.0,
    size: float = 1.0,
) -> list[Advice]:
    """Manoeuvres sorted by their expected evidence for `cause` against `rivals` (names such as id@left).

    within: largest allowed distance from the start, m. seconds: longest allowed drive, s. size: deviation of
    the cause, in usual ones. Raises ConfigError for a cause that is unknown, that no drive shows or that is
    its own rival.
    """
    known = {each.name for each in drive_causes()}
    for name in (cause, *rivals):
        if name not in known:
            raise ConfigError(f"cause {name!r}: {_reason_without_drive(name, known)}")
    if cause in rivals:
        raise ConfigError(f"rival {cause!r}: it is the cause itself; name another one")
    found = []
    for name, make in MANOEUVRES.items():
        duty = make()
        lasts = len(duty) / RATE
        if lasts > seconds or not duty.any():  # a robot that stands still cannot be diagnosed
            continue
        reach = estimate_reach(robot, duty)
        if reach <= within:
            report(f"what {name} would show")
            evidence, nearest = DrivePlan.of(robot, duty).evidence(cause, rivals, size)
            found.append(Advice(name, evidence, reach, lasts, nearest))
    return sorted(found, key=lambda each: -each.evidence)


def _reason_without_drive(name: str, known: Collection[str]) -> str:
    """Reason why no drive is planned for a name, which may still be in the catalogue."""
    id_, _, where = name.partition("@")
    catalogue = {each.id for each in all_effects()}
    if id_.startswith("tophat.") and id_ in catalogue:
        return "no drive shows it; hold the tophats over black and over white while recording"
    if where and id_ in known and f"{id_}@left" not in known:
        return f"it belongs to the whole robot and has no side; name {id_}"
    if f"{id_}@left" in known:
        sides = f"{id_}@left or {id_}@right"
        return f"it has a side; name {id_ + ', ' if id_ in known else ''}{sides}"
    if id_ in catalogue:
        return "no known manoeuvre shows it"
    return f"there is none of that name{did_you_mean(name, known)}; see raccoon effects"


@dataclass(frozen=True)
class DrivePlan:
    """A planned drive: the predicted change of the recording by each cause, in units of the usual noise.

    columns: of each cause, whitened. base: whitened changes by the base numbers. disturbances: whitened
    changes by wandering floor friction, pushes of the floor and a drifting battery voltage.
    """

    columns: tuple[tuple[ColumnGroup, Array], ...]
    base: Array
    disturbances: Array

    @classmethod
    def of(cls, robot: RobotConfig, duty: Array) -> DrivePlan:
        """The plan of a drive with duty (n, 2) at 200 Hz.

        As in a diagnosis, values of robot.toml without a standard deviation are not taken as exact.
        """
        robot, _ = with_default_stds(robot)
        every = {each.name: each for each in drive_causes()}
        problem = _planned_problem(robot, duty, every)
        linear = linearise(problem, problem.nominal(), list(every))
        white = _make_whitener(problem)
        floor = FLOOR_SHARE * white(wandering_friction_columns(problem, linear))
        pushes = PUSH_SHARE * white(wandering_friction_columns(problem, linear, PUSH_SECONDS))
        creep = white(creeping_battery_columns(problem, linear))
        columns = tuple((group, white(group.columns)) for group in linear.groups)
        return cls(columns, white(linear.jacobian), np.vstack([floor, pushes, creep]))

    def evidence(self, cause: str, rivals: Sequence[str] = (), size: float = 1.0) -> tuple[float, str]:
        """Evidence of a cause's deviation of `size` usual ones beside small deviations of all other causes,
        the given rivals and the further rival that leaves the least evidence; and that rival's name."""
        other_causes = [
            (group.name, each) for group, each in self.columns if group.name not in (cause, *rivals)
        ]
        asked_rivals = [each for group, each in self.columns if group.name in rivals and group.name != cause]
        small = np.vstack([self.base[:0], *(each for _, each in other_causes)])
        inexact = (
            form_error_parts([name for name, each in other_causes for _ in each], self.base, small)[:, None]
            * small
        )
        project = _make_projector(np.vstack([self.base, self.disturbances, inexact, *asked_rivals]))
        nearest = [each for each in other_causes if _is_rival(each[0], cause)]
        left = project(np.vstack([self.base[:0], *(each for _, each in nearest)]))
        ends = np.cumsum([len(each) for _, each in nearest])
        parts = np.split(left, ends[:-1]) if nearest else []
        rivals_left = [(name, each, rest) for (name, each), rest in zip(nearest, parts, strict=True)]
        return min(
            _evidence_and_rival(size * each, project, rivals_left)
            for each in _columns_of_cause(self.columns, cause, size)
        )

    def visible_sizes(self) -> dict[str, str]:
        """By id, the size in words above which each cause would be named if nothing else were wrong; "" if
        the drive does not show it at all. For a cause with a side, on the side where it shows least."""
        project = _make_projector(np.vstack([self.base, self.disturbances]))

        def power(name: str) -> float:
            wanted = _columns_of_cause(self.columns, name, 1.0)
            return min(float(np.linalg.eigvalsh(project(each) @ each.T)[0]) for each in wanted)

        names = dict.fromkeys(group.name for group, _ in self.columns)
        found = {}
        for id_ in dict.fromkeys(each.partition("@")[0] for each in names):
            asked = [id_] if id_ in names else [each for each in names if each.startswith(f"{id_}@")]
            least = min(map(power, asked))
            size = format_detection_limit(effect(id_).parameters[0], least, gate(id_, alone=True))
            found[id_] = f"{size}, more than is usual" if size and least < MIN_VISIBLE_EVIDENCE else size
        return found


Columns = Sequence[tuple[ColumnGroup, Array]]


def estimate_reach(robot: RobotConfig, duty: Array) -> float:
    """Largest distance from the start, m, that the robot may reach in a drive, with a margin: its battery may
    be fuller than in robot.toml, its motors unequal, or a cause present."""
    x, y = _rollout(robot, planned_log(duty)).path(neutral_settings(robot))
    return (1.0 + REACH_MARGIN_SHARE) * float(np.hypot(x, y).max()) + REACH_MARGIN_M


def _rollout(robot: RobotConfig, log: Log) -> PlantRollout:
    return PlantRollout(log, robot, Habits(Chain.firmware(), brake=False), plain=True)


def _planned_problem(robot: RobotConfig, duty: Array, causes: Mapping[str, Cause]) -> Problem:
    log = planned_log(duty)
    rollout, settings = _rollout(robot, log), neutral_settings(robot)
    return Problem(Features.of(log), rollout, robot, settings, base_coordinates(robot), causes)


def _columns_of_cause(columns: Columns, cause: str, size: float) -> list[Array]:
    """Columns of each variant of the cause taken at the size nearest to this one: only the first parameter,
    or all components for a vector."""
    own = [(abs(_variant_size(group) - size), each) for group, each in columns if group.name == cause]
    nearest = min(away for away, _ in own)
    parts = None if cause.startswith(DIRECTED_CAUSES) else 1
    return [each[:parts] for away, each in own if away <= nearest]


def _variant_size(group: ColumnGroup) -> float:
    """Size, in usual deviations, at which a cause's columns were taken; 1 for a linear cause, whose columns
    hold for any size."""
    return group.start[0] if group.start else 1.0


def _is_rival(name: str, cause: str) -> bool:
    """Whether a cause counts as a rival: neither the same at another place, nor of the same indistinguishable
    class."""
    pair = {name.partition("@")[0], cause.partition("@")[0]}
    return len(pair) == 2 and not any(pair <= each for each in INDISTINGUISHABLE_CLASSES)


def planned_log(duty: Array) -> Log:
    """A log of commands with every usual channel and no measurements."""
    time = np.arange(len(duty)) / RATE
    zeros = np.zeros(len(duty))
    channels = tuple(Channel(role, role, "", zeros, noise) for role, noise in TYPICAL_NOISE.items())
    return Log(time, duty, channels)


def _make_whitener(problem: Problem) -> Callable[[Array], Array]:
    """A function that whitens by a drive's usual noise, which depends on the motion of the nominal robot."""
    features = problem.features
    expected = replace(features, measured=problem.predict([problem.nominal()])[0])
    noise = white_noise(features.floors, classify_regimes(replace(problem, features=expected)))
    unmix = noise.whitening_factors.copy()
    unmix[CHANGING] /= CHANGING_NOISE
    noise = replace(noise, whitening_factors=unmix)
    return lambda columns: noise.whiten(columns).reshape(len(columns), -1)


def _make_projector(others: Array) -> Callable[[Array], Array]:
    """A projection of columns that removes what `others`, with unit priors, absorb."""
    factor = cho_factor(others @ others.T + np.eye(len(others)))
    return lambda columns: np.asarray(columns - cho_solve(factor, others @ columns.T).T @ others, float)


def _evidence_and_rival(
    columns: Array, project: Callable[[Array], Array], rivals: Sequence[tuple[str, Array, Array]]
) -> tuple[float, str]:
    """||P d||^2 beside all others and the rival that leaves least; and that rival's name. columns: of one
    parameter, or of a vector, which is taken in the direction in which it shows least. rivals: name, columns,
    and what is left of the columns beside the others."""
    left = project(columns)
    found = [(_least_evidence(left, columns), "")]
    for name, rival, rest in rivals:
        shares = np.linalg.solve(np.eye(len(rival)) + rest @ rival.T, rival @ left.T)
        found.append((_least_evidence(left - shares.T @ rest, columns), name))
    return min(found)


def _least_evidence(left: Array, columns: Array) -> float:
    """Evidence in the direction among the columns that has the least; left: the projected columns."""
    way = np.linalg.eigh(left @ columns.T)[1][:, 0]
    return _clipped_evidence((way @ left) * (way @ columns))


def _clipped_evidence(products: Array) -> float:
    """Sum of the products, with the contribution of each event (half a second) limited as in the search."""
    events = np.add.reduceat(products, np.arange(0, len(products), EVENT_BINS * len(TYPICAL_NOISE)))
    return max(float(np.clip(events, -2.0 * MAX_EVENT_LEAD, 2.0 * MAX_EVENT_LEAD).sum()), 0.0)
