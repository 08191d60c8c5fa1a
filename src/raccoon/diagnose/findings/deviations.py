"""Numbers of robot.toml that a fit moves by many of their standard deviations, without being a cause.

Base numbers are fitted without being reported, so a fault within their standard deviations is not named: an
inertia that is 16 % too large is three and a half deviations of the inertia straight ahead, which costs less
evidence than a cause needs. Nothing remains to be explained then, and still the number is worth a look.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from raccoon.diagnose.hypotheses.coordinates import Coordinate
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import cause_id_of, is_wheel_offset
from raccoon.sim.effects.effect import effect

MIN_STDS = 3.0
"""Standard deviations from which a number is worth a note: of thirty correct numbers of robot.toml, one
exceeds this on one robot in twelve."""
MEASURABLE_EFFECTS = (
    "battery.open_circuit_voltage", "battery.internal_resistance", "motor.armature_resistance",
    "motor.back_emf_constant", "drive.wheel_radius", "drive.track_width", "drive.inertia", "friction.coulomb",
    "friction.viscous", "imu.gyro_bias", "imu.gyro_scale",
)  # fmt: skip
"""Effects whose numbers in robot.toml a team can measure; the others are habits of controllers and gears."""
MEASURE_ADVICE = ", too little to be named as a cause: measure it, or drive the checkup (raccoon excite)"
UNKNOWN_CAUSE_NOTE = (
    " of robot.toml end at the limit of their standard deviations, because of what no cause describes"
)


def without_deviation_notes(notes: Sequence[str]) -> tuple[str, ...]:
    """Notes without those of `deviation_notes`, for a simulation that cannot follow the drive, which moves
    all numbers."""
    return tuple(each for each in notes if not each.endswith((MEASURE_ADVICE, UNKNOWN_CAUSE_NOTE)))


def deviation_notes(search: Search, *, unknown: bool = False) -> tuple[str, ...]:
    """A sentence for each large deviation, with what to do. unknown: whether an effect outside the catalogue
    acts: it moves all numbers, so they are not reported individually."""
    deviations = list(large_deviations(search))
    if unknown and deviations:
        return (f"{', '.join(dict.fromkeys(id_ for id_, _ in deviations))}{UNKNOWN_CAUSE_NOTE}",)
    return tuple(f"{text}{MEASURE_ADVICE}" for _, text in deviations)


def large_deviations(search: Search) -> Iterator[tuple[str, str]]:
    """The id of each cause that was not named but has a large deviation of its number, and a sentence with
    that."""
    problem, point = search.problem, search.fit.point
    named = {problem.causes[name].id for name in point.active}
    for index, (each, u) in enumerate(zip(problem.base, point.base, strict=True)):
        id_ = cause_id_of(each)
        if (
            abs(u) >= MIN_STDS
            and id_ in MEASURABLE_EFFECTS
            and id_ not in named
            and not is_wheel_offset(problem, index)
        ):
            yield (
                id_,
                f"robot.toml's {_number_name(each)} is {abs(u):.1f} of its standard deviations off"
                f"{_deviation_text(each, u)}",
            )


def _number_name(coordinate: Coordinate) -> str:
    id_, place, _ = coordinate.settings[0]
    whole = coordinate.name if id_ == "inertia" else id_
    return whole if place is None or len(coordinate.settings) > 1 else f"{whole} at the {place}"


def _deviation_text(coordinate: Coordinate, u: float) -> str:
    """Difference between the robot and robot.toml's number, in per cent or units."""
    change = coordinate.value(u)
    if coordinate.factor:
        return f" (the drive says {100.0 * (change - 1.0):+.0f} %)"
    id_, _, name = coordinate.settings[0]
    return f" (the drive says {change:+.2g} {effect(id_).parameter(name).unit})"
