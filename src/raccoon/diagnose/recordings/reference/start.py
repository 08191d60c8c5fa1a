"""Where a search starts that has a reference of the pose.

Gyro scale, track width and wheel radius all act on the gyro alone, which reads scale r w / b. A reference
gives the scale and the track width by themselves, so a search starts from a robot that has these numbers, and
asks for neither. What is left of the three is the wheels' radius, which the gyro then shows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.hypotheses.base_coordinates import INSIDE
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.recordings.reference.compared import Factor, Reference, reference_of
from raccoon.diagnose.recordings.reference.stretches import Columns
from raccoon.sim.effects.parameters import SIDES, Parameters

GYRO, TRACK, RADIUS = "imu.gyro_scale", "drive.track_width", "drive.wheel_radius"
READING = ("bemf.scale", "motor.back_emf_constant")
"""What makes the counts of a turning wheel larger than assumed, and is no length."""
DECIDED = (GYRO, TRACK)
"""What a reference tells whatever else is wrong. Of the radius it tells the product with what a reading says
of a turn, which K_E and the reading's scale are parts of."""
GROSS = 0.25
"""Logarithm of a factor on the radius from which a search would not find it from where robot.toml is."""
AGREES, WELL_KNOWN = 2.5, 0.007
"""Deviations within which a reference says that robot.toml is right, and how well it must know. What it calls
neither right nor wrong is left to the search."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where a search starts.

    robot: with the reference's numbers. shifts: those over robot.toml's, by id. clear: ids of those that are
    causes, by how many deviations. reference: what it says.
    """

    given: RobotConfig
    robot: RobotConfig
    shifts: Mapping[str, Factor]
    clear: Mapping[str, float]
    reference: Reference

    @property
    def decided(self) -> tuple[str, ...]:
        """What the search need not ask for."""
        return tuple(each for each in DECIDED if each in self.shifts)

    def undecided(self, causes: Sequence[Cause]) -> list[Cause]:
        """The causes that are still to be asked for."""
        return [each for each in causes if each.id not in self.decided]


def start_of(
    columns: Columns, robot: RobotConfig, model: Parameters | None = None, device: Device = SI_WORDS
) -> Start:
    """Where a search of this recording starts; without a reference where robot.toml is.

    model: the simulation that is asked about, if that has effects. Raises TraceError where the reference is
    in another unit than the format's.
    """
    reference = reference_of(columns, robot, device)
    shifts: dict[str, Factor] = {}
    clear: dict[str, float] = {}
    numbers = {GYRO: robot.model.imu.gyro_scale, TRACK: robot.model.drive.track_width}
    seen = {GYRO: reference.gyro, TRACK: reference.track}
    for id_, number in numbers.items():
        factor = seen[id_]
        if factor is None:
            continue
        factor = _over(factor, assumed(model, id_))
        open_ = number.std / number.value
        away = abs(factor.value - 1.0) / math.hypot(factor.std, open_)
        if away > INSIDE:
            clear[id_], shifts[id_] = away, factor
        elif away < AGREES and factor.std < WELL_KNOWN:
            shifts[id_] = _together(factor, Factor(1.0, open_))
    radius = _radius(reference, model)
    if radius is not None and abs(math.log(radius.value)) > GROSS:
        shifts[RADIUS] = radius
    return Start(robot, _shifted(robot, shifts), shifts, clear, reference)


def _together(one: Factor, two: Factor) -> Factor:
    """Two findings of the same number."""
    if two.std == 0.0:
        return two
    weights = (one.std**-2, two.std**-2)
    mean = (one.value * weights[0] + two.value * weights[1]) / sum(weights)
    return Factor(mean, sum(weights) ** -0.5)


def assumed(model: Parameters | None, id_: str) -> float:
    """The factor that the simulation which is asked about has already: of the wheels their mean."""
    if model is None:
        return 1.0
    if id_ != RADIUS:
        return model.value(id_, "factor")
    return 0.5 * sum(model.value(id_, "factor", side) for side in SIDES)


def _over(factor: Factor, has: float) -> Factor:
    return Factor(factor.value / has, factor.std / has)


def _radius(reference: Reference, model: Parameters | None) -> Factor | None:
    """Of both wheels over what the simulation has: it also knows what a reading says of a turn."""
    sides = []
    for side, factor in zip(SIDES, (reference.left, reference.right), strict=True):
        if factor is None:
            return None
        says = 1.0 if model is None else math.prod(model.value(each, "factor", side) for each in READING)
        sides.append(_over(factor, 1.0 / says))
    left, right = sides
    mean = Factor(0.5 * (left.value + right.value), 0.5 * (left.std + right.std))
    return _over(mean, assumed(model, RADIUS))


def _shifted(robot: RobotConfig, shifts: Mapping[str, Factor]) -> RobotConfig:
    imu, drive = robot.model.imu, robot.model.drive

    def moved(id_: str, number: Measured) -> Measured:
        factor = shifts.get(id_)
        if factor is None:
            return number
        open_ = number.std * factor.value if id_ == RADIUS else number.value * factor.std
        return replace(number, value=number.value * factor.value, std=open_)

    imu = replace(imu, gyro_scale=moved(GYRO, imu.gyro_scale))
    drive = replace(
        drive,
        track_width=moved(TRACK, drive.track_width),
        wheel_radius=moved(RADIUS, drive.wheel_radius),
    )
    return replace(robot, model=replace(robot.model, imu=imu, drive=drive))
