"""What of numbers is only known together, in words: how they share what a drive shows is robot.toml's."""

from __future__ import annotations

import math

from raccoon.core.config import NominalModel
from raccoon.diagnose.findings.spread import Spread
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.select.gates import MANY
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import BACK_EMF
from raccoon.sim.effects.parameters import SIDES

TURN_READS = {"imu.gyro_scale": 1.0, "drive.wheel_radius": 1.0, "drive.track_width": -1.0}
"""Power with which the gyro's reading follows each of them."""
K_E = "motor.back_emf_constant"
WITH_K_E = {
    "inertia": BACK_EMF["inertia", "turn"],
    "dry friction": BACK_EMF["friction.coulomb", "torque"],
    "the track": BACK_EMF["drive.track_width", "factor"],
}
"""What is said to follow both K_E where the drive stays the same, and the power with which."""
MEASURED = {
    "drive.inertia", "drive.track_width", "drive.wheel_radius", "friction.coulomb", "friction.viscous",
    "imu.gyro_scale", "motor.armature_resistance",
}  # fmt: skip
"""Of which robot.toml has a number that also decides how large K_E is said to be."""
SMALL = 0.02
"""Part by which both K_E are off from which that is worth a word."""

NOT_MEASURED = (
    "robot.toml's [model] is that of the documentation's robot: of another one that nobody has measured many "
    "numbers are off, and the fewest that explain its drive are named. Measure wheels and track (raccoon "
    "calibrate drive), write them and what is said here into robot.toml, and diagnose again"
)


def unmeasured_note(search: Search) -> tuple[str, ...]:
    """What the causes rest on, where many are named of a robot whose numbers are all the default's."""
    default = search.problem.robot.model == NominalModel()
    return (NOT_MEASURED,) if default and len(search.fit.point.active) >= MANY else ()


def together_told(search: Search, cause: Cause, spread: Spread) -> str:
    """What a cause shares with others that are named, or that may be in its place."""
    twins, scale = product_told(search, cause, spread), scale_told(search, cause, spread)
    return twins + others_told(search, cause) + scale


def product_told(search: Search, cause: Cause, spread: Spread) -> str:
    """What is known of twins where more than one was named: how they share it is a guess."""
    active = [each for each in TURN_READS if each in search.fit.point.active]
    if cause.name not in active or len(active) < 2:
        return ""
    factors = {}
    for each in active:
        key = (each, search.problem.causes[each].places[0], "factor")
        factors[each] = spread.number(key) / search.problem.neutral[key]
    together = math.prod(factors[each] ** TURN_READS[each] for each in active)
    others = " and ".join(each for each in active if each != cause.name)
    return (
        f" With {others} beside it only what they do together is known: the gyro reads {together:.3f} times "
        "what is assumed."
    )


def others_told(search: Search, cause: Cause) -> str:
    """What explains a drive as well in the place of a cause, but only together."""
    tried = search.rivals.get(cause.name, [])
    sets = [(each.name, *each.together) for each in tried if each.together]
    if not sets:
        return ""
    *most, last = sorted(sets[0])
    return f" {', '.join(most)} and {last} together would look the same."


def scale_told(search: Search, cause: Cause, spread: Spread) -> str:
    """Beside K_E of both motors, what else would be the same drive were K_E as assumed.

    It is said once, and where another number of robot.toml is named that decides it: of a robot that nobody
    has measured, where all are off, the fewest that explain its drive are not those that are off most.
    """
    active, problem = search.fit.point.active, search.problem
    own = [K_E] if K_E in active else [f"{K_E}@{side}" for side in SIDES]
    beside = {problem.causes[name].id for name in active} & MEASURED
    if cause.name != own[0] or not all(each in active for each in own) or not beside:
        return ""
    keys = [(K_E, side, "factor") for side in SIDES]
    off = math.sqrt(math.prod(spread.number(key) / problem.neutral[key] for key in keys))
    if abs(off - 1.0) < SMALL:
        return ""
    *most, last = (f"{name} {_changed(off**-power)}" for name, power in WITH_K_E.items())
    others = f"{', '.join(most)} and {last}"
    return (
        f" With both K_E {_changed(1.0 / off)}, {others} than this the drive would be the same: robot.toml "
        "decides, so measure the track and the wheels with a ruler first."
    )


def _changed(factor: float) -> str:
    return f"{100.0 * abs(factor - 1.0):.0f} % {'more' if factor > 1.0 else 'less'}"
