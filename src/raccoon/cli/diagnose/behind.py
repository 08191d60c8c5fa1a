"""A model.toml that is behind its robot.toml: what a diagnosis from it finds may stand there already."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.diagnose.reports.wording import KEYS
from raccoon.diagnose.result import CauseResult, Diagnosis

ALIKE = 2.0
"""Standard deviations of both within which a number that was found is the one of robot.toml."""


def as_robot_toml_has_it(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that began from a model.toml; of a number that `robot`, its robot.toml, has already it does
    not say to put it there."""
    return replace(found, causes=tuple(_told(each, robot) for each in found.causes))


def _told(cause: CauseResult, robot: RobotConfig) -> CauseResult:
    if cause.id not in KEYS or not cause.parameters:
        return cause
    group, key = cause.id.split(".")[0], KEYS[cause.id]
    number, own = next(iter(cause.parameters.values())), getattr(getattr(robot.model, group), key)
    if not abs(number.value - own.value) <= ALIKE * math.hypot(number.std, own.std):
        return cause
    said = (
        f"robot.toml has {key} = {own.value:.4g} in [model.{group}] already, and the model.toml of --model "
        "is behind it (--save-model writes a new one)"
    )
    advice = re.compile(rf"put {key} = .*? into \[model\.{group}\] of robot\.toml")
    return replace(cause, explanation=advice.sub(lambda _: said, cause.explanation))
