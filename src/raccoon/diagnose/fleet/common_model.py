"""The common model of a fleet's robot, and the leave-one-out check of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.diagnose.fleet.current_standing import COMMON_SHARE
from raccoon.diagnose.fleet.series import STD_PER_MAD
from raccoon.diagnose.fleet.silent_recordings import is_silent
from raccoon.diagnose.fleet.summary import HEIGHT, Fleet, FleetCause
from raccoon.diagnose.hypotheses.coordinates import affected_places
from raccoon.diagnose.result import Diagnosis
from raccoon.sim.effects.effect import Parameter, Place, effect
from raccoon.sim.effects.parameters import Key, Parameters
from raccoon.sim.effects.provenance import Origin

Array = NDArray[np.float64]

RELATIVE_TO_START = ("drive.slope", "drive.wheel_eccentricity")
"""Effects whose direction is relative to the start pose, which differs between recordings."""
REFITTED_NOTE = "refitted inside robot.toml's standard deviation, the median of {} recordings"
NAMED_NOTE = "named in {} of {} recordings"


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """Leave-one-out check of a recording with the model of the other recordings. before, after: error of
    robot.toml's simulation and of that model on held-out data, root mean square over the channels in units of
    their noise. own: the same with the recording's own model. still: causes that remain with the others'
    model."""

    before: float
    after: float
    own: float
    still: tuple[str, ...]


def make_cross_check(with_own_robot: Diagnosis, with_common_model: Diagnosis) -> CrossCheck:
    """Compare two diagnoses of a recording: with_own_robot starts from robot.toml, with_common_model from the
    model of the others."""
    floors = {each.name: each.noise_floor for each in with_own_robot.channels if each.noise_floor > 0.0}

    def size(errors: Mapping[str, float]) -> float:
        parts = [error / floors[name] for name, error in errors.items() if name in floors]
        return float(np.sqrt(np.mean(np.square(parts)))) if parts else math.nan

    before, after = (
        {each.name: each.rmse_before for each in it.channels} for it in (with_own_robot, with_common_model)
    )
    own = {each.name: each.rmse_after for each in with_own_robot.channels}
    still = [each.name for each in with_common_model.causes if not each.is_negligible]
    still += [f"something that depends on {each}" for each in with_common_model.unexplained.depends_on]
    return CrossCheck(size(before), size(after), size(own), tuple(still))


def common_model(fleet: Fleet, held_out: str | None = None) -> Parameters | None:
    """The simulation parameters of a fleet's single robot: the causes that most of its recordings name, and
    all other parameters as refitted. A parameter that changed has its latest value. None if no recording
    has a model.

    held_out: a recording to predict. The model then comes from the other recordings only, and a parameter
    that changed comes from those between the same jumps.
    """
    every = list(fleet.results)
    models = {name: fleet.results[name].model for name in every if name != held_out}
    made = {name: each for name, each in models.items() if each is not None}
    if not made:
        return None
    pool = _ModelPool(
        made, {name: row for row, name in enumerate(every)}, every[-1] if held_out is None else held_out
    )
    first = next(iter(made.values()))
    common = replace(first, robot=_with_median_inertia([*made.values()]), effects={}, origins={})
    common = _with_common_refits(common, pool, fleet)
    for cause in reversed(fleet.causes):
        common = _with_common_cause(common, cause, pool, fleet)
    return common


@dataclass(frozen=True, slots=True)
class _ModelPool:
    """The material of a common model. models: by recording. rows: index of each recording. at: the recording
    at whose place in the order the model applies."""

    models: Mapping[str, Parameters]
    rows: Mapping[str, int]
    at: str

    def with_median_effect(
        self, common: Parameters, key: Key, having: Sequence[str], origin: Origin, creeps: bool = False
    ) -> Parameters:
        """The model with an effect as these recordings have it: the median of each parameter; if it drifts,
        the first parameter has its value on the line. Its standard deviation is that of the prediction for
        the next recording: the scatter of these recordings and the uncertainty of the median."""
        values, stds = {}, {}
        for number, each in enumerate(effect(key[0]).parameters):
            found = np.array([self.models[name].value(key[0], each.name, key[1]) for name in having])
            own = [self._parameter_std(name, key, each.name) for name in having]
            values[each.name], stds[each.name] = _median_with_std(found, own)
            if creeps and number == 0 and len(having) > 1:
                values[each.name], stds[each.name] = self._value_on_trend(each, having, found, own)
            if key[0] == HEIGHT:  # the uncertainty of the law of light is common to all of them
                stds[each.name] = max(stds[each.name], float(np.median(own)))
        std = {name: each for name, each in stds.items() if each > 0.0}
        return common.with_effect(key[0], key[1], **values).with_origin(*key, replace(origin, std=std))

    def _parameter_std(self, name: str, key: Key, parameter: str) -> float:
        origin = self.models[name].origins.get(key)
        return 0.0 if origin is None else origin.std.get(parameter, 0.0)

    def _value_on_trend(
        self, parameter: Parameter, having: Sequence[str], values: Array, stds: Sequence[float]
    ) -> tuple[float, float]:
        """Value of a drifting parameter at `at` by a linear fit, and its standard deviation there, which is
        larger at the ends of the line than in the middle, with two fitted coefficients."""
        rows = np.array([self.rows[name] for name in having], float) - self.rows[self.at]
        rate, start = np.polyfit(rows, values, 1)
        left = values - start - rate * rows
        scatter = math.sqrt(float(left @ left) / max(len(rows) - 2, 1))
        middle = rows.mean()
        share = 1.0 / len(rows) + float(middle**2 / ((rows - middle) ** 2).sum())
        value = min(max(float(start), parameter.bounds.low), parameter.bounds.high)
        return value, math.hypot(scatter, max(scatter, float(np.median(stds))) * math.sqrt(share))


def _with_common_refits(common: Parameters, pool: _ModelPool, fleet: Fleet) -> Parameters:
    """The model with the effects that most drives refitted without naming them as a cause."""
    named = {name: _named_effects(fleet.results[name]) for name in pool.models}
    refitted = {name: each.effects.keys() - named[name] for name, each in pool.models.items()}
    drives = [name for name, each in refitted.items() if each]
    for key in sorted({key for each in refitted.values() for key in each}, key=str):
        able = [name for name in drives if key not in named[name]]
        having = [name for name in able if key in refitted[name]]
        if len(having) >= COMMON_SHARE * len(able):
            common = pool.with_median_effect(
                common, key, having, Origin({}, REFITTED_NOTE.format(len(having)))
            )
    return common


def _named_effects(diagnosis: Diagnosis) -> set[Key]:
    return {(each.id, place) for each in diagnosis.causes for place in _effect_places(each.id, each.where)}


def _effect_places(id_: str, where: str | None) -> tuple[str | None, ...]:
    return (where,) if effect(id_).place is Place.TOPHAT else affected_places(id_, where)


def _with_common_cause(common: Parameters, cause: FleetCause, pool: _ModelPool, fleet: Fleet) -> Parameters:
    """The model with a cause if most recordings that can tell name it, among those between the same jumps as
    the recording to predict. Of two causes that they cannot distinguish only one is included."""
    id_, _, where = cause.name.partition("@")
    piece, creeps = _recordings_between_jumps(cause, [*fleet.results], pool.at)
    able = [name for name in piece if name in pool.models and not is_silent(cause.name, fleet.results[name])]
    naming = [name for name in able if name in cause.recordings]
    # What changed is followed through the recordings that refitted it, too: a battery that runs down is
    # within robot.toml's standard deviation at first.
    having = [name for name in able if name in naming or (cause.series.courses and name in cause.refitted)]
    if id_ in RELATIVE_TO_START or cause.instead or not naming or len(having) < COMMON_SHARE * len(able):
        return common
    named = [each for name in naming for each in fleet.results[name].causes if each.name == cause.name]
    sure = float(np.median([each.probability for each in named]))
    origin = Origin({}, NAMED_NOTE.format(len(naming), len(able)), sure)
    for place in _effect_places(id_, where or None):
        keep = [name for name in having if (id_, place) in pool.models[name].effects]
        common = pool.with_median_effect(common, (id_, place), keep, origin, creeps)
    return common


def _recordings_between_jumps(cause: FleetCause, every: Sequence[str], at: str) -> tuple[list[str], bool]:
    """The recordings between the same jumps as `at`, without outliers, and whether the value drifts there."""
    names, creeps = list(every), False
    for course in cause.series.courses:
        starts = [0, *(each.first for each in course.pieces[1:]), len(every)]
        number = sum(start <= every.index(at) for start in starts[:-1]) - 1
        names, creeps = names[starts[number] : starts[number + 1]], course.pieces[number].creeps
    return [name for name in names if name not in cause.series.outliers], creeps


def _median_with_std(values: Array, stds: Sequence[float]) -> tuple[float, float]:
    middle = float(np.median(values))
    if not np.isfinite(values).all():  # infinite: no current limit
        return middle, 0.0
    scatter = STD_PER_MAD * float(np.median(np.abs(values - middle)))
    return middle, math.hypot(scatter, float(np.median(stds)) / math.sqrt(len(values)))


def _with_median_inertia(models: Sequence[Parameters]) -> RobotConfig:
    """The first model's robot with the median of all inertias, which are values of robot.toml itself."""
    robot = models[0].robot

    def middle(numbers: Sequence[Measured]) -> Measured:
        value, std = _median_with_std(
            np.array([each.value for each in numbers]), [each.std for each in numbers]
        )
        return replace(numbers[0], value=value, std=std)

    drives = [each.robot.model.drive for each in models]
    drive = replace(
        robot.model.drive,
        inertia_straight=middle([each.inertia_straight for each in drives]),
        inertia_turn=middle([each.inertia_turn for each in drives]),
    )
    return replace(robot, model=replace(robot.model, drive=drive))
