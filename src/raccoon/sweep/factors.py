"""What varies from match to match: parameters of the simulator's effects and their distributions."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.core.schema import Bounds
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.bemf import is_plausible_k_e_share
from raccoon.sim.effects.calibrated import calibrated_factor, simulated_device
from raccoon.sim.effects.effect import Place, effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.sweep.faults import FAULT_KINDS

if TYPE_CHECKING:
    from numpy.random import Generator

AMBIENT_LIGHT = "light.ambient"
"""Light over the whole table, 0 indoors to 1 direct sun. It and the faults are not effects of the robot."""
BACK_EMF_CONSTANT_SD = 0.03
"""Relative standard deviation of motors' K_E."""
OFFSET_SD_COUNTS = 42.0
"""Counts; RMS of the readings of six motors at rest on RaccoonOS."""
PLAIN_TICKS_SD = OdometrySettings().calibrated_scale
"""Relative standard deviation of ticks that robot.toml has as a plain number, which does not say how well it
is known: the odometry's."""
_SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class Factor:
    """A parameter of an effect and its distribution over matches.

    low, high: ends of a uniform distribution, or with `normal` its mean minus and plus one standard
    deviation. where: left, right or an analog port; None for an effect of the robot or of both sides. A fault
    has no parameter: low = high is the share of matches that have it.
    """

    effect: str
    parameter: str
    low: float
    high: float
    normal: bool = False
    where: str | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low <= self.high):
            raise ConfigError(
                f"{self.name}: {self.low}:{self.high}: allowed are two numbers, the lower first"
            )
        if not self.is_of_robot and (self.where or self.parameter):
            raise ConfigError(f"{self.name}: it has neither parameters nor places")
        if self.is_fault and self.low != self.high:
            raise ConfigError(
                f"{self.name}: {self.low}:{self.high}: give one number, the share of matches that have it"
            )
        for value in (0.5 * (self.low + self.high),) if self.normal else (self.low, self.high):
            self._check(value)

    @property
    def is_fault(self) -> bool:
        """Whether it is a fault that a match may have."""
        return self.effect in FAULT_KINDS

    @property
    def is_of_robot(self) -> bool:
        """Whether it is a parameter of one of the simulated robot's effects."""
        return not self.is_fault and self.effect != AMBIENT_LIGHT

    @property
    def name(self) -> str:
        """Name of its column, such as motor.back_emf_constant.factor@left."""
        parts = (self.effect, self.parameter) if self.parameter else (self.effect,)
        return ".".join(parts) + (f"@{self.where}" if self.where else "")

    @property
    def unit(self) -> str:
        """Unit of its values; empty for a factor."""
        return effect(self.effect).parameter(self.parameter).unit if self.is_of_robot else ""

    def draw(self, random: Generator) -> float:
        """A random value within the bounds of the parameter; of a fault 1 or 0."""
        if self.is_fault:
            return float(random.uniform() < self.low)
        if not self.normal:
            return float(random.uniform(self.low, self.high))
        middle, sd = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        bounds = self._bounds()
        drawn = (float(random.normal(middle, sd)) for _ in range(100))
        return next((value for value in drawn if bounds.allows(value)), middle)

    def _bounds(self) -> Bounds:
        if self.is_of_robot:
            return effect(self.effect).parameter(self.parameter).bounds
        return Bounds(0.0, 1.0)

    def _check(self, value: float) -> None:
        if self.is_of_robot:
            effect(self.effect).check(self.parameter, value)
        elif not self._bounds().allows(value):
            raise ConfigError(f"{self.effect} is {value}: allowed are {self._bounds()}")


def _normal(name: str, parameter: str, mean: float, sd: float, where: str | None = None) -> Factor:
    return Factor(name, parameter, mean - sd, mean + sd, normal=True, where=where)


def default_factors(robot: RobotConfig) -> tuple[Factor, ...]:
    """The variation between real robots, batteries, tables and halls of one make.

    Battery 6.1 to 7.0 V and the spread of motors and tophats: the measured tables of the variability paper.
    Offsets, dead zone, gyro and dead time: measured on RaccoonOS robots. Floor and wear: widths of the effect
    catalogue. Calibrated numbers of robot.toml vary by their stated standard deviation: the program uses
    these numbers, and a robot that differed more would behave as after a replacement of its motors.
    """
    track = robot.model.drive.track_width
    factors = [
        Factor("battery.open_circuit_voltage", "voltage", 6.1, 7.0),
        Factor("battery.internal_resistance", "resistance", 0.05, 0.15),
        Factor("drive.turn_scrub", "torque", 0.0, 0.03),
        Factor("actuation.latency", "seconds", 0.0, 0.01),
        Factor("bemf.dead_zone", "counts", 0.0, 25.0),
        _normal("drive.track_width", "factor", 1.0, 0.01 if track.date is None else track.std / track.value),
        _normal("drive.slope", "along_x", 0.0, 0.005),
        _normal("drive.slope", "along_y", 0.0, 0.005),
        _normal("imu.gyro_bias", "rate", 0.0, 0.002),
        _normal("imu.gyro_scale", "factor", 1.0, 0.003),
    ]
    for side in _SIDES:
        factors += [
            _normal("motor.back_emf_constant", "factor", *_back_emf_constant_prior(robot, side), side),
            _normal("motor.armature_resistance", "factor", 1.0, 0.09, side),
            Factor("friction.coulomb", "torque", 0.16, 0.26, where=side),
            # A calibration knows K_E and radius only as their product, which is K_E's here.
            _normal("drive.wheel_radius", "factor", 1.0, 0.0 if _is_calibrated(robot, side) else 0.005, side),
            Factor("drive.backlash", "angle", 0.0, 0.05, where=side),
            _normal("bemf.offset", "counts", *_offset_prior(robot, side), side),
        ]
    return (*factors, *_tophat_factors(robot))


def _is_calibrated(robot: RobotConfig, side: str) -> bool:
    """Whether robot.toml has calibrated ticks of the wheel that are plausible."""
    known = robot.wheel_motor(side).radians_per_tick is not None
    return known and is_plausible_k_e_share(_back_emf_factor(robot, side))


def _back_emf_constant_prior(robot: RobotConfig, side: str) -> tuple[float, float]:
    """Mean and standard deviation of a motor's K_E relative to that of `[model]`."""
    ticks = robot.wheel_motor(side).radians_per_tick
    if ticks is None or not _is_calibrated(robot, side):
        return 1.0, BACK_EMF_CONSTANT_SD
    mean = _back_emf_factor(robot, side)
    return mean, mean * (ticks.std / ticks.value or PLAIN_TICKS_SD)


def _offset_prior(robot: RobotConfig, side: str) -> tuple[float, float]:
    """Mean and standard deviation of a motor's reading at rest, counts."""
    offset = robot.wheel_motor(side).bemf_offset
    if offset is None:
        return 0.0, OFFSET_SD_COUNTS
    return offset.value, offset.std or robot.model.bemf.offset.std


def _back_emf_factor(robot: RobotConfig, side: str) -> float:
    """K_E by the calibrated ticks of a side's motor, relative to that of `[model]`; 1 if it is not
    calibrated."""
    return calibrated_factor(robot, side, simulated_device(robot))


def nominal_values(robot: RobotConfig, factors: tuple[Factor, ...]) -> dict[str, float]:
    """The values of these factors for the robot that robot.toml describes: those of calibrated motors, and
    the model's for all others."""
    return {
        each.name: _back_emf_factor(robot, each.where)
        for each in factors
        if each.effect == "motor.back_emf_constant"
        and each.where in _SIDES
        and _is_calibrated(robot, each.where)
    }


def fault_factors(share: float) -> tuple[Factor, ...]:
    """Every fault, each with the share of matches (0 to 1) that have it."""
    return tuple(Factor(kind, "", share, share) for kind in FAULT_KINDS)


def _tophat_factors(robot: RobotConfig) -> list[Factor]:
    ports = sorted({str(tophat.analog) for tophat in robot.tophats.values()})
    factors = [Factor(AMBIENT_LIGHT, "", 0.0, 0.2)] if ports else []
    for port in ports:
        factors.append(_normal("tophat.gain", "factor", 1.0, 0.1, port))
        factors.append(Factor("tophat.height", "height", 0.005, 0.012, where=port))
    return factors


_TEXT = re.compile(
    r"(?P<effect>[a-z_]+(\.[a-z_]+)?)(\.(?P<parameter>[a-z_]+))?(@(?P<where>\w+))?=(?P<range>.+)"
)


def parse_factor(text: str) -> Factor:
    """A factor from `battery.open_circuit_voltage=6.1:7.0` or `motor.back_emf_constant.factor@left=1.0~0.03`.

    `low:high` is uniform, `mean~sd` normal, a single number fixed; of a fault it is the share of matches that
    have it. The parameter may be left out if the effect has only one. Raises ConfigError.
    """
    found = _TEXT.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"{text!r}: write EFFECT[.PARAMETER][@WHERE]=LOW:HIGH or =MEAN~SD or =VALUE")
    name, parameter = found["effect"], found["parameter"] or ""
    if name.startswith("fault.") and name not in FAULT_KINDS:
        meant = did_you_mean(name, FAULT_KINDS)
        raise ConfigError(f"{text!r}: there is no such fault{meant}; allowed are {', '.join(FAULT_KINDS)}")
    if name != AMBIENT_LIGHT and name not in FAULT_KINDS:
        entry = effect(name)
        if not parameter and len(entry.parameters) > 1:
            names = ", ".join(each.name for each in entry.parameters)
            raise ConfigError(f"{text!r}: say which parameter of {name}: {names}")
        parameter = parameter or entry.parameters[0].name
    low, high, normal = _parse_range(text, found["range"])
    return Factor(name, parameter, low, high, normal, found["where"])


def _parse_range(text: str, given: str) -> tuple[float, float, bool]:
    mark = "~" if "~" in given else ":"
    try:
        numbers = [float(each) for each in given.split(mark)]
    except ValueError:
        numbers = []
    if len(numbers) == 1 and mark == ":":
        return numbers[0], numbers[0], False
    if len(numbers) != 2:
        raise ConfigError(f"{text!r}: {given!r} is neither LOW:HIGH nor MEAN~SD nor a number")
    if mark == "~":
        if numbers[1] < 0.0:
            raise ConfigError(f"{text!r}: the standard deviation {numbers[1]:g} must be 0 or more")
        return numbers[0] - numbers[1], numbers[0] + numbers[1], True
    return numbers[0], numbers[1], False


def place_of(robot: RobotConfig, factor: Factor) -> tuple[object, str]:
    """The place that a factor changes: the same for left and for the motor port of that side. Raises
    ConfigError if a robot does not have it."""
    if not factor.is_of_robot:
        return factor.effect, ""
    (place,) = Parameters.from_robot(robot).with_effect(factor.effect, factor.where).effects
    return place, factor.parameter


def refuse_ineffective(robot: RobotConfig, factors: tuple[Factor, ...]) -> None:
    """Raise ConfigError for a factor without effect: another one has the same place, or it is of tophats that
    the robot does not have."""
    known: dict[tuple[object, str], str] = {}
    for factor in factors:
        place = place_of(robot, factor)
        if place in known:
            how = "twice" if known[place] == factor.name else f"already, as {known[place]}"
            raise ConfigError(f"{factor.name} is varied {how}")
        known[place] = factor.name
        by_tophats = factor.is_of_robot and effect(factor.effect).place is Place.TOPHAT
        if (by_tophats or factor.effect == AMBIENT_LIGHT) and not robot.tophats:
            raise ConfigError(f"{factor.name}: nothing would change, as robot.toml has no tophat")


def robot_with(parameters: Parameters, factors: tuple[Factor, ...], values: dict[str, float]) -> Parameters:
    """The simulated robot with the drawn values. Raises ConfigError for a place that it does not have."""
    for factor in sorted(factors, key=lambda each: each.where is not None):  # everywhere replaces any place
        if factor.is_of_robot:
            value = {factor.parameter: values[factor.name]}
            parameters = parameters.with_effect(factor.effect, factor.where, **value)
    return parameters
