"""Sentences on the causes of one motor or axis, with values and units, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

from raccoon.diagnose.result import ParameterResult

Values = Mapping[str, ParameterResult]


def axis_sentence(id: str, place: str, values: Values, parameter: str) -> str:  # noqa: A002
    """One sentence: what is wrong with `place` (such as "the left motor"), its value, what to do. parameter:
    name of the model parameter, for effects that have several."""
    if id == "friction.direction_dependent":
        return _direction_sentence(place, values)
    first = next(iter(values.values()))
    number = f"{first.value:.3g} {first.unit}".strip()
    text = {
        "friction.coulomb": f"dry friction of {number} brakes {place}; the textbook motor has none: "
        "compensate for it with feedforward, and check gears and axle if the other motor has less",
        "friction.viscous": f"friction that grows with speed, {number}, brakes {place} beyond its "
        "back-EMF: check bearings and grease",
        "friction.stiction": f"breaking loose takes {number} more than keeping {place} moving: small "
        "commands will stutter",
        "friction.load_dependent": f"the gear of {place} loses {100 * first.value:.0f} % of the force it "
        "transmits: check mesh and alignment",
        "friction.quadratic": f"a drag of {number} that grows with the square of the speed brakes "
        f"{place}: drive slower or compensate for it with feedforward",
        "actuation.latency": f"commands reach {place} {1000 * first.value:.1f} ms late: plan ahead by "
        "that much",
        "actuation.deadband": f"the first {number} of a command do nothing at {place}: add that much to "
        "small commands"
        if parameter != "dead_below"
        else f"commands below {number} do nothing at {place}, larger ones act in full: command nothing "
        "smaller",
        "drive.slope": f"a constant force of {number} pulls at {place}: gravity, a slope or a spring",
    }[id]
    return text[0].upper() + text[1:] + "."


def _direction_sentence(place: str, values: Values) -> str:
    parts = []
    for name, kind in (("viscous_asymmetry", "speed-dependent"), ("asymmetry", "dry")):
        if name in values and abs(values[name].value) > 2.0 * values[name].std:
            value = values[name].value
            harder, easier = ("forwards", "backwards") if value > 0.0 else ("backwards", "forwards")
            parts.append(
                f"{kind} friction is {100 * abs(value):.1f} % above its mean {harder} and as much below it "
                f"{easier}"
            )
    what = " and ".join(parts) or "friction differs by direction"
    return (
        f"The {what} ({place}): something rubs in one direction, such as a worn screw or gear flank; look "
        "there before tuning."
    )
