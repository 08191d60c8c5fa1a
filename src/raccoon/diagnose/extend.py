"""The better model: what a diagnosis found, as a simulated robot that knows where its numbers come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.diagnose.candidates import NO_CAUSE
from raccoon.diagnose.hypotheses import neutral_settings, places
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.result import CauseResult
from raccoon.diagnose.rollout import parameters_of
from raccoon.diagnose.spread import Spread
from raccoon.sim.chain import Chain
from raccoon.sim.effects import effect
from raccoon.sim.parameters import Key, Parameters
from raccoon.sim.provenance import Origin

REFITTED = "refitted inside robot.toml's standard deviation"
OF_EVERY_ROBOT = "refitted: every robot has it, and robot.toml does not say how much"
GIVEN = "of the model that was started from"


def extended(problem: Problem, spread: Spread, causes: Sequence[CauseResult], chain: Chain) -> Parameters:
    """The fitted robot of a drive: named causes, and base numbers as they were refitted."""
    model = parameters_of(spread.here, neutral_settings(problem.robot), problem.robot, chain)
    robot = _with_inertia(replace(model.robot, motors=problem.robot.motors), spread)
    model = replace(model, robot=robot)
    for key in model.effects:
        model = model.with_origin(*key, _origin(spread, causes, key))
    return model


def with_causes(start: Parameters, causes: Sequence[CauseResult]) -> Parameters:
    """A robot with the causes of a recording that is no drive; those of ports that it does not have are left
    out."""
    ports = {str(each.analog) for each in start.robot.tophats.values()}
    for each in causes:
        if each.id.startswith("tophat.") and each.where not in ports:
            continue
        values = {name: number.value for name, number in each.parameters.items()}
        start = start.with_effect(each.id, each.where, **values)
        start = start.with_origin(each.id, each.where, _named(each))
    return start


def _named(cause: CauseResult) -> Origin:
    std = {name: each.std for name, each in cause.parameters.items()}
    return Origin(std, f"named: {cause.explanation}", cause.probability)


def _origin(spread: Spread, causes: Sequence[CauseResult], key: Key) -> Origin:
    id_, place = key
    for each in causes:
        if each.id == id_ and place in places(each.id, each.where):
            return _named(each)
    std = {each.name: spread.std((id_, place, each.name)) for each in effect(id_).parameters}
    fitted = {name: each for name, each in std.items() if each > 0.0}
    refitted = OF_EVERY_ROBOT if id_ in NO_CAUSE else REFITTED
    return Origin(fitted, refitted if fitted else GIVEN)


def _with_inertia(robot: RobotConfig, spread: Spread) -> RobotConfig:
    """Inertias are numbers of robot.toml itself, whose deviations are now the fit's."""
    drive = robot.model.drive

    def fitted(number: Measured, kind: str) -> Measured:
        key = ("inertia", None, kind)
        std = number.value * spread.std(key) / spread.number(key)
        return replace(number, std=std) if std > 0.0 else number

    drive = replace(
        drive,
        inertia_straight=fitted(drive.inertia_straight, "straight"),
        inertia_turn=fitted(drive.inertia_turn, "turn"),
    )
    return replace(robot, model=replace(robot.model, drive=drive))
