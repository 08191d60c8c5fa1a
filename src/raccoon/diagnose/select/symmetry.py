"""Twins along exact symmetries: sets of causes that are the same drive in other numbers.

Without a measured current and a reference, nothing determines the common scale of a whole group of numbers.
With U = R I + K w at the motor, K I its torque and e = K w its back-EMF reading, the drive does not change if

* K is multiplied by s, and with it inertia by s^2, torques by s, viscous friction by s^2, quadratic friction
  by s^3, angles of the wheels and the track by 1/s: the currents, e and the turns stay the same;
* R and the battery's resistance are multiplied by s, inertia and friction by 1/s: currents and torques become
  1/s of what they were;
* the radius of both wheels and the track are multiplied by s: the turns stay the same.

Only robot.toml's values of these numbers decide. A search by single causes can stop at one set of numbers
where another needs one cause less, and no single step between the two improves the score. So each active
cause is taken back to its nominal value along each of these lines, and the numbers that then contradict
robot.toml become causes instead.
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
"""The one cause that changes both inertias of robot.toml."""
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
"""The line along which K_E of both motors changes: the exponent of each parameter's factor."""
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
"""The lines: the exponent of each parameter's factor. Direction-dependent friction is counted in units of a
usual robot's friction, and so as a torque."""
MAX_OPEN_STDS = 2.5
"""Standard deviations of robot.toml up to which a deviation stays in the base number and does not become a
cause."""
MIN_LOG_FACTOR, MAX_LOG_FACTOR = 0.01, 0.5
"""Bounds on the absolute logarithm of the factor along a line: below the first it is the same set, above the
second no plausible robot."""


def exact_twins(problem: Problem, point: Point) -> Iterator[tuple[str, Point]]:
    """Each active cause, with a point without it that is the same drive, for each line that has one."""
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
    """Each inactive cause whose base numbers all deviate in the same direction by more than `deviations` of
    robot.toml's standard deviations, and the same drive with that cause active instead."""
    for name, cause in problem.causes.items():
        if len(cause.coordinates) > 1 or not overlaps_none(name, point.active):
            continue
        indices = _base_indices_of(problem, cause)
        strained = point.base[indices]
        if indices and (np.all(strained > deviations) or np.all(strained < -deviations)):
            base, active = point.base.copy(), dict(point.active)
            _move_mean_to_cause(problem, active, [name], indices, base)
            yield name, problem.inside(Point(base, active))


def _base_indices_of(problem: Problem, cause: Cause) -> list[int]:
    """Indices of the base numbers that a cause multiplies alike: those of its wheel, or those of both wheels
    without the wheels' own offsets."""
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
    """The same drive with every parameter of a line multiplied by the factor to its exponent. None if that
    needs a cause that is not among the candidates.

    Deviations stay in base numbers if robot.toml allows them; otherwise the number's cause becomes active. If
    robot.toml has one number for both sides, a cause of one side does not change if it is a factor on that
    number, and follows the line if it is added to it.
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
        movers = {each for index in moved.get(cause.id, ()) for each in _causes_moving(problem, index)}
        if not movers or not (name in movers or cause.coordinates[0].factor):
            active[name] = _scale_effect(cause, u, line, factor)
    for id_, indices in moved.items():
        if not _share_with_causes(problem, active, id_, indices, base):
            return None
    return problem.inside(Point(base, active))


def _factor_to_nominal(problem: Problem, point: Point, name: str, line: SymmetryLine) -> float:
    """The factor along a line at which the number that a cause changes is nominal again; 1 if there is
    none."""
    for index, each in enumerate(problem.base):
        power = _exponent(line, each)
        if not power or is_wheel_offset(problem, index) or name not in _causes_moving(problem, index):
            continue
        total = total_stds(problem, point, index)
        if each.factor:
            return math.exp(-total * math.log(each.value(1.0)) / power)
        nominal = problem.neutral[each.settings[0]]
        current = nominal + each.value(total)
        return (nominal / current) ** (1.0 / power) if nominal > 0.0 and current > 0.0 else 1.0
    return 1.0


def _exponent(line: SymmetryLine, coordinate: Coordinate) -> float:
    """The exponent of a base coordinate along a line, 0 if the line does not change it."""
    id_, _, parameter = coordinate.settings[0]
    return line.get((id_, parameter), 0.0)


def is_wheel_offset(problem: Problem, index: int) -> bool:
    """Whether a base coordinate is one wheel's offset from a number of both wheels, which is another
    coordinate."""
    settings = set(problem.base[index].settings)
    return any(settings < set(each.settings) for each in problem.base)


def cause_id_of(coordinate: Coordinate) -> str:
    """The id of the cause that changes the same number as a base coordinate."""
    id_ = coordinate.settings[0][0]
    return INERTIA if id_ == "inertia" else id_


def _causes_moving(problem: Problem, index: int) -> list[str]:
    """The causes that change all settings that a base coordinate changes."""
    each = problem.base[index]
    places = {place for _, place, _ in each.settings}
    where = next(iter(places)) if len(places) == 1 else None
    return [
        name
        for name in dict.fromkeys((cause_id_of(each), cause_name(cause_id_of(each), where)))
        if name in problem.causes
    ]


def total_stds(problem: Problem, point: Point, index: int) -> float:
    """Total deviation of a number from robot.toml, by base coordinate and causes, in standard deviations."""
    each, total = problem.base[index], float(point.base[index])
    for name in _causes_moving(problem, index):
        if name in point.active:
            total += _in_base_units(each, problem.causes[name].coordinates[0], float(point.active[name][0]))
    return total


def _in_base_units(base: Coordinate, cause: Coordinate, u: float) -> float:
    """A cause's coordinate u converted to the units of a base coordinate."""
    if base.factor:
        return math.log(cause.value(u)) / math.log(base.value(1.0))
    return (cause.from_zero * u if cause.factor else cause.value(u)) / base.value(1.0)


def _multiply_number(problem: Problem, each: Coordinate, total: float, factor: float) -> float:
    """The base coordinate at which a number is `factor` times its value at `total`."""
    if each.factor:
        return total + math.log(factor) / math.log(each.value(1.0))
    nominal = problem.neutral[each.settings[0]]
    return float((factor * (nominal + each.value(total)) - nominal) / each.value(1.0))


def _scale_effect(cause: Cause, u: Array, line: SymmetryLine, factor: float) -> Array:
    """Coordinates of an effect that the nominal robot does not have, with its parameters multiplied by the
    factor to their exponents."""
    sizes = [factor ** line.get((cause.id, each.name), 0.0) for each in cause.effect.parameters]
    if cause.id == "motor.current_limit":  # its coordinate is the inverse of the limit
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
    """Divide the deviations of one effect's numbers between base coordinates and causes, in place. Returns
    whether the causes needed for that are among the candidates."""
    for index in indices:
        for name in _causes_moving(problem, index):
            active.pop(name, None)
    deviating = [index for index in indices if abs(base[index]) > MAX_OPEN_STDS]
    if not deviating:
        return True
    differ = len(indices) > 1 and (len(deviating) == 1 or np.ptp(base[indices]) > 2.0 * MAX_OPEN_STDS)
    if differ and id_ != INERTIA:
        return all(
            _move_mean_to_cause(problem, active, _causes_moving(problem, each)[-1:], [each], base)
            for each in deviating
        )
    return _move_mean_to_cause(problem, active, _causes_moving(problem, deviating[0])[:1], indices, base)


def _move_mean_to_cause(
    problem: Problem, active: dict[str, Array], names: Sequence[str], indices: Sequence[int], base: Array
) -> bool:
    """Move the mean deviation of these base numbers into the first of the causes, in place. False if there is
    no cause."""
    if not names:
        return False
    coordinate = problem.causes[names[0]].coordinates[0]
    widths = np.array([_in_base_units(problem.base[index], coordinate, 1.0) for index in indices])
    common = float(np.mean(base[list(indices)] / widths))
    active[names[0]] = np.array([common])
    base[list(indices)] -= common * widths
    return True
