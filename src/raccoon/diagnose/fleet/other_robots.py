"""Detects recordings of another robot than that of robot.toml and of the other recordings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

from raccoon.diagnose.result import CauseResult, Diagnosis

MAX_LOG_FACTOR = 0.25
"""Magnitude of the logarithm of a factor above which robot.toml is probably not this robot's."""
ROBOT_CONSTANTS = (
    "motor.back_emf_constant", "motor.armature_resistance", "drive.inertia", "drive.wheel_radius",
    "drive.track_width",
)  # fmt: skip
ROBOT_TOML_QUESTION = "is this robot.toml of this robot?"
MIN_FAR_CONSTANTS = 2
"""Least number of such constants in a recording of another robot: a replaced pair of motors does not change
the track width."""


def is_far_off(cause: CauseResult) -> bool:
    """Whether a cause's factor is larger than usual differences between a robot and its robot.toml."""
    return abs(math.log(max(cause.parameters["factor"].value, 1e-9))) > MAX_LOG_FACTOR


def far_constants_text(diagnosis: Diagnosis) -> str:
    """The constants of the whole robot that are far off, and by how much; "" if they are too few to make the
    recording another robot's."""
    far = [
        f"{each.name} {100.0 * (each.parameters['factor'].value - 1.0):+.0f} %"
        for each in diagnosis.causes
        if each.id in ROBOT_CONSTANTS and each.where is None and is_far_off(each)
    ]
    return ", ".join(far) if len(far) >= MIN_FAR_CONSTANTS else ""


def recordings_of_others(results: Mapping[str, Diagnosis], robots: Mapping[str, str]) -> dict[str, str]:
    """The recordings that seem to be of another robot, with the reason: several constants of the whole robot
    are far off in them, but not in most recordings of the same robot. robots: the nominal robot of each
    recording."""
    reasons = {name: far for name, each in results.items() if (far := far_constants_text(each))}
    every, odd = (Counter(robots[name] for name in names) for names in (results, reasons))
    return {
        name: f"it seems to be of another robot than the others ({far})"
        for name, far in reasons.items()
        if 2 * odd[robots[name]] < every[robots[name]]
    }
