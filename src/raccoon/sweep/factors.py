"""What differs from match to match: parameters of the simulator's effects and how they are distributed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.sim.effects import effect
from raccoon.sim.parameters import Parameters

if TYPE_CHECKING:
    from numpy.random import Generator

LIGHT = "light.ambient"
"""The one factor that is no effect: light over the whole table, 0 indoors to 1 direct sun."""
_SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class Factor:
    """A parameter of an effect and its distribution over matches.

    low, high: ends of a uniform distribution, or with `normal` its mean minus and plus one standard
    deviation. where: left, right or an analog port; None where the effect is the robot's or both sides'.
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
        if self.effect != LIGHT:
            for value in (self.low, self.high):
                effect(self.effect).check(self.parameter, value)
        elif not 0.0 <= self.low <= self.high <= 1.0:
            raise ConfigError(f"{LIGHT}: {self.low}:{self.high}: allowed are numbers from 0 to 1")

    @property
    def name(self) -> str:
        """Name of its column, such as motor.back_emf_constant.factor@left."""
        if self.effect == LIGHT:
            return LIGHT
        return f"{self.effect}.{self.parameter}" + (f"@{self.where}" if self.where else "")

    @property
    def unit(self) -> str:
        """Unit of its values; empty for a factor."""
        return "" if self.effect == LIGHT else effect(self.effect).parameter(self.parameter).unit

    def draw(self, random: Generator) -> float:
        """A value, inside the bounds of the parameter."""
        if not self.normal:
            return float(random.uniform(self.low, self.high))
        value = float(random.normal((self.low + self.high) / 2.0, (self.high - self.low) / 2.0))
        bounds = effect(self.effect).parameter(self.parameter).bounds
        return value if bounds.allows(value) else min(max(value, self.low), self.high)


def _normal(name: str, parameter: str, mean: float, sd: float, where: str | None = None) -> Factor:
    return Factor(name, parameter, mean - sd, mean + sd, normal=True, where=where)


def default_factors(robot: RobotConfig) -> tuple[Factor, ...]:
    """What differs between real robots, batteries, tables and halls of one make.

    Battery 6.1 to 7.0 V and the spread of motors and tophats: the measured tables of the variability paper.
    Offsets, gyro and dead time: what RaccoonOS robots show. Floor and wear: widths of the effect catalogue.
    """
    factors = [
        Factor("battery.open_circuit_voltage", "voltage", 6.1, 7.0),
        Factor("battery.internal_resistance", "resistance", 0.05, 0.15),
        Factor("drive.turn_scrub", "torque", 0.0, 0.03),
        Factor("actuation.latency", "seconds", 0.0, 0.01),
        _normal("drive.track_width", "factor", 1.0, 0.01),
        _normal("drive.slope", "along_x", 0.0, 0.005),
        _normal("drive.slope", "along_y", 0.0, 0.005),
        _normal("imu.gyro_bias", "rate", 0.0, 0.002),
        _normal("imu.gyro_scale", "factor", 1.0, 0.003),
    ]
    for side in _SIDES:
        factors += [
            _normal("motor.back_emf_constant", "factor", 1.0, 0.03, side),
            _normal("motor.armature_resistance", "factor", 1.0, 0.09, side),
            Factor("friction.coulomb", "torque", 0.16, 0.26, where=side),
            _normal("drive.wheel_radius", "factor", 1.0, 0.005, side),
            Factor("drive.backlash", "angle", 0.0, 0.05, where=side),
            _normal("bemf.offset", "counts", 0.0, 30.0, side),
        ]
    return (*factors, *_tophat_factors(robot))


def _tophat_factors(robot: RobotConfig) -> list[Factor]:
    ports = sorted({str(tophat.analog) for tophat in robot.tophats.values()})
    factors = [Factor(LIGHT, "", 0.0, 0.2)] if ports else []
    for port in ports:
        factors.append(_normal("tophat.gain", "factor", 1.0, 0.1, port))
        factors.append(Factor("tophat.height", "height", 0.005, 0.012, where=port))
    return factors


_TEXT = re.compile(r"(?P<effect>[a-z_]+\.[a-z_]+)(\.(?P<parameter>[a-z_]+))?(@(?P<where>\w+))?=(?P<range>.+)")


def parse_factor(text: str) -> Factor:
    """A factor from `battery.open_circuit_voltage=6.1:7.0` or `motor.back_emf_constant.factor@left=1.0~0.03`.

    `low:high` is uniform, `mean~sd` normal, a single number fixed. The parameter may be left out where the
    effect has only one. Raises ConfigError.
    """
    found = _TEXT.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"{text!r}: write EFFECT[.PARAMETER][@WHERE]=LOW:HIGH or =MEAN~SD or =VALUE")
    name, parameter = found["effect"], found["parameter"] or ""
    if name != LIGHT:
        entry = effect(name)
        if not parameter and len(entry.parameters) > 1:
            names = ", ".join(each.name for each in entry.parameters)
            raise ConfigError(f"{text!r}: say which parameter of {name}: {names}")
        parameter = parameter or entry.parameters[0].name
    low, high, normal = _range(text, found["range"])
    return Factor(name, parameter, low, high, normal, found["where"])


def _range(text: str, given: str) -> tuple[float, float, bool]:
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
        return numbers[0] - numbers[1], numbers[0] + numbers[1], True
    return numbers[0], numbers[1], False


def robot_with(robot: RobotConfig, factors: tuple[Factor, ...], values: dict[str, float]) -> Parameters:
    """The simulated robot with the drawn values. Raises ConfigError where a place does not exist on it."""
    parameters = Parameters.from_robot(robot)
    for factor in factors:
        if factor.effect != LIGHT:
            value = {factor.parameter: values[factor.name]}
            parameters = parameters.with_effect(factor.effect, factor.where, **value)
    return parameters
