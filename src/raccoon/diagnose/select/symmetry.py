"""Sets of causes that are the same drive in other numbers.

Without a current and a reference nothing tells what a whole group of numbers is when all of them change
together. With U = R I + K w at the motor, K I its torque and e = K w what its reading shows:

* K by s, and with it inertia by s^2, torques by s, viscous friction by s^2, quadratic by s^3, angles of the
  wheels and the track by 1/s: the same currents, the same e, the same turns;
* R and the battery's resistance by s, inertia and friction by 1/s: the currents are 1/s, torques as well;
* both wheels' radius and the track by s: the same turns.

What robot.toml says of them decides. A search by single causes can stop in one such set of numbers where
another needs a cause less, and no step between the two helps. So each cause that is on is taken back to
nominal along each of these lines, and what then no longer fits robot.toml is a cause in its place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.coordinates import Cause, Coordinate, cause_name
from raccoon.diagnose.select.set_scoring import overlaps_none

Array = NDArray[np.float64]
SymmetryLine = Mapping[tuple[str, str], float]

INERTIA = "drive.inertia"
"""The cause of both numbers that robot.toml has of it."""
BACK_EMF_LINE: SymmetryLine = {
    ("motor.back_emf_constant", "factor"): 1.0,
    ("drive.track_width", "factor"): -1.0,
    ("inertia", "straight"): 2.0,
    ("inertia", "turn"): 2.0,
    ("friction.coulomb", "torque"): 1.0,
    ("friction.viscous", "coefficient"): 2.0,
    ("friction.quadratic", "coefficient"): 3.0,
    ("friction.direction_dependent", "asymmetry"): 1.0,
    ("friction.direction_dependent", "viscous_asymmetry"): 2.0,
    ("friction.stiction", "torque"): 1.0,
    ("friction.stiction", "speed"): -1.0,
    ("friction.presliding", "compliance"): -2.0,
    ("friction.presliding", "damping"): 2.0,
    ("friction.presliding", "creep"): -1.0,
    ("drive.turn_scrub", "torque"): 1.0,
    ("drive.slope", "along_x"): 1.0,
    ("drive.slope", "along_y"): 1.0,
    ("drive.backlash", "angle"): -1.0,
}
"""Along which K_E of both motors changes."""
SYMMETRY_LINES: tuple[SymmetryLine, ...] = (
    BACK_EMF_LINE,
    {
        ("motor.armature_resistance", "factor"): 1.0,
        ("battery.internal_resistance", "resistance"): 1.0,
        ("battery.discharge", "volts_per_coulomb"): 1.0,
        ("motor.heating", "gain"): 2.0,
        ("motor.current_limit", "limit"): -1.0,
        ("inertia", "straight"): -1.0,
        ("inertia", "turn"): -1.0,
        ("friction.coulomb", "torque"): -1.0,
        ("friction.viscous", "coefficient"): -1.0,
        ("friction.quadratic", "coefficient"): -1.0,
        ("friction.direction_dependent", "asymmetry"): -1.0,
        ("friction.direction_dependent", "viscous_asymmetry"): -1.0,
        ("friction.stiction", "torque"): -1.0,
        ("friction.presliding", "compliance"): 1.0,
        ("friction.presliding", "damping"): -1.0,
        ("drive.turn_scrub", "torque"): -1.0,
        ("drive.slope", "along_x"): -1.0,
        ("drive.slope", "along_y"): -1.0,
    },
    {("drive.wheel_radius", "factor"): 1.0, ("drive.track_width", "factor"): 1.0},
)  # fmt: skip
"""Power with which each parameter follows. Friction that differs by direction is counted in parts of a usual
robot's friction, and so as a torque."""
MAX_OPEN_STDS = 2.5
"""Standard deviations of robot.toml up to which a number is left to it, and no cause."""
MIN_LOG_FACTOR, MAX_LOG_FACTOR = 0.01, 0.5
"""Of the logarithm of the factor along a line: less is the same set, and more no robot."""


def exact_twins(problem: Problem, point: Point) -> Iterator[tuple[str, Point]]:
    """Each cause that is on, and a point without it that is the same drive, for each line that has one."""
    for name in point.active:
        for line in SYMMETRY_LINES:
            factor = _factor_to_nominal(problem, point, name, line)
            if MIN_LOG_FACTOR < abs(math.log(factor)) < MAX_LOG_FACTOR:
                other = move_along_line(problem, point, line, factor)
                if other is not None and name not in other.active:
                    yield name, other


def causes_of_strained_numbers(
    problem: Problem, point: Point, deviations: float
) -> Iterator[tuple[str, Point]]:
    """Each cause that is off and whose numbers are all bent one way by more than that many of robot.toml's
    standard deviations, and the same drive with the cause on instead."""
    for name, cause in problem.causes.items():
        own = cause.coordinates
        if len(own) > 1 or not overlaps_none(name, point.active):
            continue
        indices = _base_indices_of(problem, cause)
        bent = point.base[indices]
        if indices and (np.all(bent > deviations) or np.all(bent < -deviations)):
            base, active = point.base.copy(), dict(point.active)
            _move_mean_to_cause(problem, active, [name], indices, base)
            yield name, problem.inside(Point(base, active))


def _base_indices_of(problem: Problem, cause: Cause) -> list[int]:
    """The base numbers that a cause changes alike: of one wheel, or of both without what each has beyond."""
    return [
        index
        for index, each in enumerate(problem.base)
        if cause_id_of(each) == cause.id
        and (
            not is_wheel_offset(problem, index)
            if cause.where is None
            else {place for _, place, _ in each.settings} == {cause.where}
        )
    ]


def move_along_line(problem: Problem, point: Point, line: SymmetryLine, factor: float) -> Point | None:
    """The same drive, every parameter of a line times the factor to its power. None where what is needed for
    that is not among the causes.

    What robot.toml gives stays inside it where it can; otherwise its cause is on. Causes of one side where
    robot.toml has one number for both stay as they are where they are a factor on it, and follow where they
    are added.
    """
    base, active = point.base.copy(), dict(point.active)
    moved: dict[str, list[int]] = {}
    for index, each in enumerate(problem.base):
        power = _exponent(line, each)
        if power and is_wheel_offset(problem, index):
            base[index] *= 1.0 if each.factor else factor**power
        elif power:
            base[index] = _multiply_number(problem, each, total_stds(problem, point, index), factor**power)
            moved.setdefault(cause_id_of(each), []).append(index)
    for name, u in point.active.items():
        cause = problem.causes[name]
        its = {each for index in moved.get(cause.id, ()) for each in _causes_moving(problem, index)}
        if not its or not (name in its or cause.coordinates[0].factor):
            active[name] = _scale_effect(cause, u, line, factor)
    for id_, indices in moved.items():
        if not _share_with_causes(problem, active, id_, indices, base):
            return None
    return problem.inside(Point(base, active))


def _factor_to_nominal(problem: Problem, point: Point, name: str, line: SymmetryLine) -> float:
    """The factor along a line at which what a cause changes is nominal again; 1 where there is none."""
    for index, each in enumerate(problem.base):
        power = _exponent(line, each)
        if not power or is_wheel_offset(problem, index) or name not in _causes_moving(problem, index):
            continue
        total = total_stds(problem, point, index)
        if each.factor:
            return math.exp(-total * math.log(each.value(1.0)) / power)
        nominal = problem.neutral[each.settings[0]]
        there = nominal + each.value(total)
        return (nominal / there) ** (1.0 / power) if nominal > 0.0 and there > 0.0 else 1.0
    return 1.0


def _exponent(line: SymmetryLine, coordinate: Coordinate) -> float:
    id_, _, parameter = coordinate.settings[0]
    return line.get((id_, parameter), 0.0)


def is_wheel_offset(problem: Problem, index: int) -> bool:
    """Whether a base coordinate is only what one wheel has beyond a number of both, another coordinate."""
    settings = set(problem.base[index].settings)
    return any(settings < set(each.settings) for each in problem.base)


def cause_id_of(coordinate: Coordinate) -> str:
    """The id of the cause that moves what a base coordinate moves."""
    id_ = coordinate.settings[0][0]
    return INERTIA if id_ == "inertia" else id_


def _causes_moving(problem: Problem, index: int) -> list[str]:
    """The causes that move all that a base coordinate moves."""
    each = problem.base[index]
    places = {place for _, place, _ in each.settings}
    where = next(iter(places)) if len(places) == 1 else None
    return [
        name
        for name in dict.fromkeys((cause_id_of(each), cause_name(cause_id_of(each), where)))
        if name in problem.causes
    ]


def total_stds(problem: Problem, point: Point, index: int) -> float:
    """How far a number is from robot.toml's in all, in its standard deviations."""
    each, total = problem.base[index], float(point.base[index])
    for name in _causes_moving(problem, index):
        if name in point.active:
            total += _in_base_units(each, problem.causes[name].coordinates[0], float(point.active[name][0]))
    return total


def _in_base_units(base: Coordinate, cause: Coordinate, u: float) -> float:
    """A cause's coordinate in the units of a base coordinate."""
    if base.factor:
        return math.log(cause.value(u)) / math.log(base.value(1.0))
    return (cause.from_zero * u if cause.factor else cause.value(u)) / base.value(1.0)


def _multiply_number(problem: Problem, each: Coordinate, total: float, factor: float) -> float:
    """Where a base coordinate is when its number is that many times what it was."""
    if each.factor:
        return total + math.log(factor) / math.log(each.value(1.0))
    nominal = problem.neutral[each.settings[0]]
    return float((factor * (nominal + each.value(total)) - nominal) / each.value(1.0))


def _scale_effect(cause: Cause, u: Array, line: SymmetryLine, factor: float) -> Array:
    """Coordinates of an effect that a textbook robot has none of, its size times a factor to its power, and
    so its shape."""
    sizes = [factor ** line.get((cause.id, each.name), 0.0) for each in cause.effect.parameters]
    if cause.id == "motor.current_limit":  # counted by its inverse
        return np.asarray(u / sizes[0], float)
    if cause.id == "friction.stiction":
        shape = cause.coordinates[1]
        return np.array(
            [u[0] * sizes[0], u[1] + math.log(sizes[1]) / math.log(shape.value(1.0) / shape.value(0.0))]
        )
    return np.asarray(u * sizes[: len(u)], float)


def _share_with_causes(
    problem: Problem, active: dict[str, Array], id_: str, indices: Sequence[int], base: Array
) -> bool:
    """Share what numbers of one effect are off by between robot.toml's deviations and a cause; whether the
    cause that is needed is one that is asked for."""
    for index in indices:
        for name in _causes_moving(problem, index):
            active.pop(name, None)
    off = [index for index in indices if abs(base[index]) > MAX_OPEN_STDS]
    if not off:
        return True
    alone = len(indices) > 1 and (len(off) == 1 or np.ptp(base[indices]) > 2.0 * MAX_OPEN_STDS)
    if alone and id_ != INERTIA:
        return all(
            _move_mean_to_cause(problem, active, _causes_moving(problem, each)[-1:], [each], base)
            for each in off
        )
    return _move_mean_to_cause(problem, active, _causes_moving(problem, off[0])[:1], indices, base)


def _move_mean_to_cause(
    problem: Problem, active: dict[str, Array], names: Sequence[str], indices: Sequence[int], base: Array
) -> bool:
    """Put what these have in common into the first of the causes."""
    if not names:
        return False
    own = problem.causes[names[0]].coordinates[0]
    widths = np.array([_in_base_units(problem.base[index], own, 1.0) for index in indices])
    common = float(np.mean(base[list(indices)] / widths))
    active[names[0]] = np.array([common])
    base[list(indices)] -= common * widths
    return True
