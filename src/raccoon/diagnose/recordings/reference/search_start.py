"""The start of a search for a recording with a reference of the pose.

Gyro scale, track width and wheel radius all act on the gyro alone, which reads scale r w / b. A reference
determines the scale and the track width independently, so the search starts from a robot with these values
and considers neither as a cause. The gyro then shows the third, the wheels' radius.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.recordings.reference.factors import Factor, ReferenceFactors, factors_of_reference
from raccoon.diagnose.recordings.reference.stretches import Columns
from raccoon.sim.effects.parameters import SIDES, Parameters

GYRO_SCALE, TRACK_WIDTH, WHEEL_RADIUS = "imu.gyro_scale", "drive.track_width", "drive.wheel_radius"
READING_CAUSES = ("bemf.scale", "motor.back_emf_constant")
"""Causes, other than lengths, that increase the counts of a turning wheel."""
DECIDED_BY_REFERENCE = (GYRO_SCALE, TRACK_WIDTH)
"""Causes that a reference determines whatever else is wrong. It determines the radius only as a product with
the counts per turn, which depend on K_E and the reading's scale."""
MIN_LOG_RADIUS_SHIFT = 0.25
"""Logarithm of the radius factor beyond which a search does not find the radius from robot.toml's value."""
MAX_AGREEING_SIGMAS, MAX_AGREEING_STD = 2.5, 0.007
"""Standard deviations within which a reference confirms robot.toml, and largest standard deviation of its
factor for that. A value that is neither confirmed nor contradicted is left to the search."""


@dataclass(frozen=True, slots=True)
class SearchStart:
    """The start of a search.

    configured: the robot without the reference. robot: with the reference's values. factors: of these values
    relative to robot.toml's, by id. significant: by id, the standard deviations by which some differ from
    robot.toml; these are causes. reference: all factors by the reference.
    """

    configured: RobotConfig
    robot: RobotConfig
    factors: Mapping[str, Factor]
    significant: Mapping[str, float]
    reference: ReferenceFactors

    @property
    def decided(self) -> tuple[str, ...]:
        """Causes that the reference determined and the search need not consider."""
        return tuple(each for each in DECIDED_BY_REFERENCE if each in self.factors)

    def undecided(self, causes: Sequence[Cause]) -> list[Cause]:
        """The causes that the search must still consider."""
        return [each for each in causes if each.id not in self.decided]


def search_start(
    columns: Columns, robot: RobotConfig, model: Parameters | None = None, device: Device = SI_WORDS
) -> SearchStart:
    """The start of a search for this recording; without a reference, robot.toml's robot.

    model: effects of the simulation, if any. Raises TraceError if the reference is in another unit than the
    format's.
    """
    reference = factors_of_reference(columns, robot, device)
    factors: dict[str, Factor] = {}
    significant: dict[str, float] = {}
    configured = {GYRO_SCALE: robot.model.imu.gyro_scale, TRACK_WIDTH: robot.model.drive.track_width}
    measured = {GYRO_SCALE: reference.gyro, TRACK_WIDTH: reference.track}
    for id_, number in configured.items():
        factor = measured[id_]
        if factor is None:
            continue
        factor = _relative_to(factor, assumed_factor(model, id_))
        prior_std = number.std / number.value
        sigmas = abs(factor.value - 1.0) / math.hypot(factor.std, prior_std)
        if sigmas > MAX_BASE_STDS:
            significant[id_], factors[id_] = sigmas, factor
        elif sigmas < MAX_AGREEING_SIGMAS and factor.std < MAX_AGREEING_STD:
            factors[id_] = _weighted_mean(factor, Factor(1.0, prior_std))
    radius = _radius_factor(reference, model)
    if radius is not None and abs(math.log(radius.value)) > MIN_LOG_RADIUS_SHIFT:
        factors[WHEEL_RADIUS] = radius
    return SearchStart(robot, _with_factors(robot, factors), factors, significant, reference)


def _weighted_mean(one: Factor, two: Factor) -> Factor:
    """Inverse-variance weighted mean of two estimates; the second one if it is exact."""
    if two.std == 0.0:
        return two
    weights = (one.std**-2, two.std**-2)
    mean = (one.value * weights[0] + two.value * weights[1]) / sum(weights)
    return Factor(mean, sum(weights) ** -0.5)


def assumed_factor(model: Parameters | None, id_: str) -> float:
    """The factor that the simulation's effects already have; for the wheels their mean."""
    if model is None:
        return 1.0
    if id_ != WHEEL_RADIUS:
        return model.value(id_, "factor")
    return 0.5 * sum(model.value(id_, "factor", side) for side in SIDES)


def _relative_to(factor: Factor, assumed: float) -> Factor:
    return Factor(factor.value / assumed, factor.std / assumed)


def _radius_factor(reference: ReferenceFactors, model: Parameters | None) -> Factor | None:
    """Mean factor of both wheels' radii relative to the simulation, given its counts per turn; None if one is
    unknown."""
    sides = []
    for side, factor in zip(SIDES, (reference.left, reference.right), strict=True):
        if factor is None:
            return None
        reading_factor = (
            1.0 if model is None else math.prod(model.value(each, "factor", side) for each in READING_CAUSES)
        )
        sides.append(_relative_to(factor, 1.0 / reading_factor))
    left, right = sides
    mean = Factor(0.5 * (left.value + right.value), 0.5 * (left.std + right.std))
    return _relative_to(mean, assumed_factor(model, WHEEL_RADIUS))


def _with_factors(robot: RobotConfig, factors: Mapping[str, Factor]) -> RobotConfig:
    imu, drive = robot.model.imu, robot.model.drive

    def scaled(id_: str, number: Measured) -> Measured:
        factor = factors.get(id_)
        if factor is None:
            return number
        std = number.std * factor.value if id_ == WHEEL_RADIUS else number.value * factor.std
        return replace(number, value=number.value * factor.value, std=std)

    imu = replace(imu, gyro_scale=scaled(GYRO_SCALE, imu.gyro_scale))
    drive = replace(
        drive,
        track_width=scaled(TRACK_WIDTH, drive.track_width),
        wheel_radius=scaled(WHEEL_RADIUS, drive.wheel_radius),
    )
    return replace(robot, model=replace(robot.model, imu=imu, drive=drive))
