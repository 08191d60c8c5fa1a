"""The fitted model: the results of a diagnosis as parameters of a simulated robot, with the origin of each
number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.cause_catalogue import NUISANCE_EFFECTS
from raccoon.diagnose.hypotheses.coordinates import Settings, affected_places, neutral_settings
from raccoon.diagnose.result import CauseResult
from raccoon.diagnose.rollout.simulated_robot import to_parameters
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import Key, Parameters
from raccoon.sim.effects.provenance import Origin

REFITTED = "refitted inside robot.toml's standard deviation"
OF_EVERY_ROBOT = "refitted: every robot has it, and robot.toml does not say how much"
FROM_GIVEN_MODEL = "of the model that was started from"


def make_fitted_model(
    problem: Problem, uncertainty: FitUncertainty, causes: Sequence[CauseResult], chain: Chain
) -> Parameters:
    """The fitted robot of a drive: named causes, and refitted base numbers. A number that a simulator does
    not allow (with another robot's robot.toml) is replaced by the nearest allowed one."""
    neutral = neutral_settings(problem.robot)
    model = to_parameters(clamp_to_bounds(uncertainty.settings, neutral), neutral, problem.robot, chain)
    robot = _with_inertia_stds(replace(model.robot, motors=problem.robot.motors), uncertainty)
    model = replace(model, robot=robot)
    for key in model.effects:
        model = model.with_origin(*key, _origin(uncertainty, causes, key))
    return model


def clamp_to_bounds(here: Settings, neutral: Settings) -> Settings:
    """Settings with each number of the catalogue's effects clamped to the bounds of its effect."""
    return dict(here) | {key: _clamp(key[0], key[2], here[key]) for key in neutral if key[0] != "inertia"}


def _clamp(id: str, name: str, value: float) -> float:  # noqa: A002
    bounds = effect(id).parameter(name).bounds
    if not math.isfinite(value) or bounds.allows(value):
        return value
    return min(max(value, bounds.low), bounds.high)


def rebase_model(model: Parameters, given: RobotConfig, factors: Mapping[str, float]) -> Parameters:
    """A model of a robot whose lengths and gyro scale were multiplied by factors, as effects on the given
    robot.

    factors: by the effect's id. A factor outside the effect's bounds remains in the robot itself.
    """
    shifted, drive = model.robot.model, given.model.drive
    too_large = set()
    for id_, factor in factors.items():
        values = {each: factor * model.value(id_, "factor", each) for each in affected_places(id_, None)}
        bounds = effect(id_).parameter("factor").bounds
        if not all(bounds.allows(each) for each in values.values()):
            too_large.add(id_)
            continue
        for place, value in values.items():
            before = model.effects.get((id_, place))
            if before is None and value == 1.0:
                continue
            origin = model.origins.get((id_, place))
            model = model.with_effect(id_, place, factor=value)
            if origin is not None:
                std = {name: factor * each for name, each in origin.std.items()}
                model = model.with_origin(id_, place, replace(origin, std=std))

    def choose_number(id_: str, own: Measured, theirs: Measured) -> Measured:
        return theirs if id_ in too_large else own

    imu = replace(
        shifted.imu,
        gyro_scale=choose_number("imu.gyro_scale", given.model.imu.gyro_scale, shifted.imu.gyro_scale),
    )
    lengths = replace(
        shifted.drive,
        track_width=choose_number("drive.track_width", drive.track_width, shifted.drive.track_width),
        wheel_radius=choose_number("drive.wheel_radius", drive.wheel_radius, shifted.drive.wheel_radius),
    )
    return replace(model, robot=replace(model.robot, model=replace(shifted, imu=imu, drive=lengths)))


def with_causes(start: Parameters, causes: Sequence[CauseResult]) -> Parameters:
    """A robot with the causes of a recording that is no drive; those of ports that it does not have are
    omitted."""
    ports = {str(each.analog) for each in start.robot.tophats.values()}
    for each in causes:
        if each.id.startswith("tophat.") and each.where not in ports:
            continue
        values = {name: _clamp(each.id, name, number.value) for name, number in each.parameters.items()}
        start = start.with_effect(each.id, each.where, **values)
        start = start.with_origin(each.id, each.where, cause_origin(each))
    return start


def cause_origin(cause: CauseResult) -> Origin:
    """Origin of the numbers of a cause."""
    std = {name: each.std for name, each in cause.parameters.items()}
    return Origin(std, f"named: {cause.explanation}", cause.probability)


def _origin(uncertainty: FitUncertainty, causes: Sequence[CauseResult], key: Key) -> Origin:
    id_, place = key
    for each in causes:
        if each.id == id_ and place in affected_places(each.id, each.where):
            return cause_origin(each)
    std = {each.name: uncertainty.std((id_, place, each.name)) for each in effect(id_).parameters}
    fitted = {name: each for name, each in std.items() if each > 0.0}
    refitted = OF_EVERY_ROBOT if id_ in NUISANCE_EFFECTS else REFITTED
    return Origin(fitted, refitted if fitted else FROM_GIVEN_MODEL)


def _with_inertia_stds(robot: RobotConfig, uncertainty: FitUncertainty) -> RobotConfig:
    """The robot with the fit's standard deviations of its inertias, which are numbers of robot.toml
    itself."""
    drive = robot.model.drive

    def fitted(number: Measured, kind: str) -> Measured:
        key = ("inertia", None, kind)
        std = number.value * uncertainty.std(key) / uncertainty.value_of(key)
        return replace(number, std=std) if std > 0.0 else number

    drive = replace(
        drive,
        inertia_straight=fitted(drive.inertia_straight, "straight"),
        inertia_turn=fitted(drive.inertia_turn, "turn"),
    )
    return replace(robot, model=replace(robot.model, drive=drive))
