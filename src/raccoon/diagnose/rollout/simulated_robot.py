"""The simulated robot that the settings of a diagnosis stand for."""

from __future__ import annotations

from dataclasses import dataclass, replace

from raccoon.core.config import Measured, RobotConfig
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters


def to_parameters(settings: Settings, neutral: Settings, robot: RobotConfig, chain: Chain) -> Parameters:
    """The simulator's parameters, with every effect switched on that has a setting other than neutral. A
    team's own effects are left out: they act on commands and readings, not in the simulator."""
    effects: dict[tuple[str, str | None], dict[str, float]] = {}
    for (id_, place, name), value in settings.items():
        if id_ != "inertia" and value != neutral.get((id_, place, name), value):
            effects.setdefault((id_, place), {})[name] = value
    straight = settings[("inertia", None, "straight")]
    turn = settings[("inertia", None, "turn")]
    if straight != 1.0 or turn != 1.0:
        robot = with_inertia(robot, straight, turn)
    for (id_, place), named in effects.items():
        for key, value in settings.items():
            if key[:2] == (id_, place):
                named.setdefault(key[2], value)
    return Parameters(robot, effects, chain)


def with_inertia(robot: RobotConfig, straight: float, turn: float) -> RobotConfig:
    """The robot with both inertias multiplied by these factors."""
    drive = robot.model.drive

    def scaled(number: Measured, factor: float) -> Measured:
        return replace(number, value=number.value * factor)

    changed = replace(
        drive,
        inertia_straight=scaled(drive.inertia_straight, straight),
        inertia_turn=scaled(drive.inertia_turn, turn),
    )
    return replace(robot, model=replace(robot.model, drive=changed))


@dataclass(frozen=True, slots=True)
class Variant:
    """The part of `Parameters` that packing a plant's numbers needs: a diagnosis packs thousands of plants,
    and this is cheaper to make."""

    robot: RobotConfig
    chain: Chain
    settings: Settings

    def value(self, id: str, name: str, where: str | None = None) -> float:  # noqa: A002
        """The value of a parameter of an effect."""
        return self.settings[(id, where, name)]


def gyro_numbers(settings: Settings, robot: RobotConfig) -> tuple[float, float, float, float]:
    """The gyro's scale, bias (rad/s), drift (rad/s^2) and latency (s)."""
    return (
        settings[("imu.gyro_scale", None, "factor")] * robot.model.imu.gyro_scale.value,
        settings[("imu.gyro_bias", None, "rate")],
        settings[("imu.gyro_drift", None, "rate_per_second")],
        settings[("imu.latency", None, "seconds")],
    )
