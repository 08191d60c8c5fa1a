"""Sentences on numbers that a drive determines only jointly; robot.toml decides how they share the effect."""

from __future__ import annotations

import math

from raccoon.core.config import NominalModel
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.select.gates import MANY_CAUSES
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import BACK_EMF_LINE
from raccoon.sim.effects.parameters import SIDES

GYRO_EXPONENTS = {"imu.gyro_scale": 1.0, "drive.wheel_radius": 1.0, "drive.track_width": -1.0}
"""Exponent of each factor in the gyro's reading."""
BACK_EMF_CONSTANT = "motor.back_emf_constant"
K_E_EXPONENTS = {
    "inertia": BACK_EMF_LINE["inertia", "turn"],
    "dry friction": BACK_EMF_LINE["friction.coulomb", "torque"],
    "the track": BACK_EMF_LINE["drive.track_width", "factor"],
}
"""Numbers that have to change with K_E of both motors for the same drive, with their exponents."""
SCALE_SETTING_EFFECTS = {
    "drive.inertia", "drive.track_width", "drive.wheel_radius", "friction.coulomb", "friction.viscous",
    "imu.gyro_scale", "motor.armature_resistance",
}  # fmt: skip
"""Effects whose numbers in robot.toml also determine the reported K_E."""
MIN_K_E_CHANGE = 0.02
"""Relative change of K_E of both motors from which it is worth a sentence."""

UNMEASURED_ROBOT_NOTE = (
    "robot.toml's [model] is that of the default robot: of another robot many numbers are off, and only the "
    "fewest that explain its drive are named. Measure wheels and track (raccoon calibrate drive), write them "
    "and the results of this report into robot.toml, and diagnose again"
)


def unmeasured_robot_notes(search: Search) -> tuple[str, ...]:
    """A note if many causes are named for a robot whose numbers are all the defaults."""
    default = search.problem.robot.model == NominalModel()
    return (UNMEASURED_ROBOT_NOTE,) if default and len(search.fit.point.active) >= MANY_CAUSES else ()


def describe_joint_numbers(search: Search, cause: Cause, uncertainty: FitUncertainty) -> str:
    """Sentences on what a cause shares with other named ones, or with those that may be in its place."""
    product = describe_known_product(search, cause, uncertainty)
    scale = describe_common_scale(search, cause, uncertainty)
    return product + describe_joint_rivals(search, cause) + scale


def describe_known_product(search: Search, cause: Cause, uncertainty: FitUncertainty) -> str:
    """The known product of numbers that the gyro does not distinguish, if more than one was named."""
    active = [each for each in GYRO_EXPONENTS if each in search.fit.point.active]
    if cause.name not in active or len(active) < 2:
        return ""
    factors = {}
    for each in active:
        key = (each, search.problem.causes[each].places[0], "factor")
        factors[each] = uncertainty.value_of(key) / search.problem.neutral[key]
    together = math.prod(factors[each] ** GYRO_EXPONENTS[each] for each in active)
    others = " and ".join(each for each in active if each != cause.name)
    return (
        f" Together with {others}, only their combined effect is known: the gyro reads {together:.3f} times "
        "what is assumed."
    )


def describe_joint_rivals(search: Search, cause: Cause) -> str:
    """A set of causes that explains a drive equally well in the place of a cause, but only together."""
    tried = search.rivals.get(cause.name, [])
    sets = [(each.name, *each.together) for each in tried if each.together]
    if not sets:
        return ""
    *most, last = sorted(sets[0])
    return f" {', '.join(most)} and {last} together would look the same."


def describe_common_scale(search: Search, cause: Cause, uncertainty: FitUncertainty) -> str:
    """With K_E of both motors named, the other numbers that would make the same drive if K_E were as assumed.

    It is reported once, and only if another number of robot.toml that decides it is named: for an unmeasured
    robot, where all numbers are off, the smallest set that explains its drive need not contain those that are
    off most.
    """
    active, problem = search.fit.point.active, search.problem
    both_k_e = (
        [BACK_EMF_CONSTANT]
        if BACK_EMF_CONSTANT in active
        else [f"{BACK_EMF_CONSTANT}@{side}" for side in SIDES]
    )
    deciding = {problem.causes[name].id for name in active} & SCALE_SETTING_EFFECTS
    if cause.name != both_k_e[0] or not all(each in active for each in both_k_e) or not deciding:
        return ""
    keys = [(BACK_EMF_CONSTANT, side, "factor") for side in SIDES]
    off = math.sqrt(math.prod(uncertainty.value_of(key) / problem.neutral[key] for key in keys))
    if abs(off - 1.0) < MIN_K_E_CHANGE:
        return ""
    *most, last = (f"{name} {_change_text(off**-power)}" for name, power in K_E_EXPONENTS.items())
    others = f"{', '.join(most)} and {last}"
    return (
        f" With both K_E {_change_text(1.0 / off)}, {others} than this, the drive would be the same: only "
        "robot.toml's numbers decide, so measure the track and the wheels with a ruler first."
    )


def _change_text(factor: float) -> str:
    return f"{100.0 * abs(factor - 1.0):.0f} % {'more' if factor > 1.0 else 'less'}"
