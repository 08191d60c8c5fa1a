"""A model.toml that is behind its robot.toml: what a diagnosis from it finds may stand there already."""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.diagnose.reports.cause_text import ROBOT_TOML_KEYS, with_robot_toml_value
from raccoon.diagnose.result import CauseResult, Diagnosis
from raccoon.sim.effects.parameters import SIDES

ALIKE = 2.0
"""Standard deviations of both within which a number that was found is the one of robot.toml."""


def as_robot_toml_has_it(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that began from a model.toml; of a number that `robot`, its robot.toml, has already it does
    not say to put it there."""
    return replace(found, causes=tuple(_told(each, robot) for each in found.causes))


def _told(cause: CauseResult, robot: RobotConfig) -> CauseResult:
    if cause.id not in ROBOT_TOML_KEYS or cause.where in SIDES or not cause.parameters:
        return cause
    group = cause.id.partition(".")[0]
    number, own = (
        next(iter(cause.parameters.values())),
        getattr(getattr(robot.model, group), ROBOT_TOML_KEYS[cause.id]),
    )
    has_it = abs(number.value - own.value) <= ALIKE * math.hypot(number.std, own.std)
    return with_robot_toml_value(cause, own.value) if has_it else cause
