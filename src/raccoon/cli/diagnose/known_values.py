"""Values that robot.toml already has, and that a diagnosis from an older model.toml finds again."""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.core.config import RobotConfig
from raccoon.diagnose.reports.cause_text import ROBOT_TOML_KEYS, with_robot_toml_value
from raccoon.diagnose.result import CauseResult, Diagnosis
from raccoon.sim.effects.parameters import SIDES

MAX_STDS_APART = 2.0
"""Largest difference, in standard deviations of both values together, at which a value found counts as
robot.toml's."""


def without_known_values(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that started from a model.toml, without the advice to store values that `robot`, its
    robot.toml, already has."""
    return replace(found, causes=tuple(_without_known_value(each, robot) for each in found.causes))


def _without_known_value(cause: CauseResult, robot: RobotConfig) -> CauseResult:
    if cause.id not in ROBOT_TOML_KEYS or cause.where in SIDES or not cause.parameters:
        return cause
    group = cause.id.partition(".")[0]
    number, own = (
        next(iter(cause.parameters.values())),
        getattr(getattr(robot.model, group), ROBOT_TOML_KEYS[cause.id]),
    )
    has_it = abs(number.value - own.value) <= MAX_STDS_APART * math.hypot(number.std, own.std)
    return with_robot_toml_value(cause, own.value) if has_it else cause
