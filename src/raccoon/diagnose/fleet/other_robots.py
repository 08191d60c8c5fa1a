"""Detects recordings of another robot than that of robot.toml and of the other recordings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from raccoon.diagnose.result import CauseResult, Diagnosis, Verdict

MAX_LOG_FACTOR = 0.25
"""Magnitude of the logarithm of a factor above which robot.toml is probably not this robot's."""
ROBOT_CONSTANTS = (
    "motor.back_emf_constant", "motor.armature_resistance", "drive.inertia", "drive.wheel_radius",
    "drive.track_width",
)  # fmt: skip
ROBOT_TOML_QUESTION = "is this robot.toml of this robot?"
MIN_OFF_CONSTANTS = 3
"""Least number of such constants that are named, one of them far off, from which causes of a recording are
doubted: for a robot.toml with half of the K_E and two thirds of the lengths only the track seemed far off,
since numbers compensate for each other along the scales on which the drive stays the same."""
CHECK_ROBOT_TOML = (
    "Check first whether robot.toml is this robot's: with another robot's, this is no fault, and its number "
    "may be wrong."
)
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


def with_doubted_robot(found: Diagnosis) -> Diagnosis:
    """The diagnosis; not as explained, and with its causes in doubt, if so many constants of the whole robot
    are off that robot.toml is probably another robot's."""
    constants = [each for each in found.causes if each.id in ROBOT_CONSTANTS and each.where is None]
    far = [each for each in constants if is_far_off(each)]
    if len(far) < MIN_FAR_CONSTANTS and not (far and len(constants) >= MIN_OFF_CONSTANTS):
        return found
    verdict = Verdict.PARTLY if found.verdict is Verdict.EXPLAINED else found.verdict
    doubted = tuple(
        each if each.is_negligible else replace(each, explanation=f"{each.explanation} {CHECK_ROBOT_TOML}")
        for each in found.causes
    )
    return replace(found, verdict=verdict, causes=doubted)


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
