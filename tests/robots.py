"""Simulated robots for the tests of motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any

from raccoon import Action, Robot, RobotConfig, open_robot, wait
from raccoon.core.config import ControllerConfig, Measured, MotorConfig, TophatConfig
from raccoon.core.port import Port
from raccoon.core.readings import SIMULATOR, Inputs, Outputs, Truth
from raccoon.estimate.tophat import TophatCalibration, calibrate
from raccoon.robot.actions.actions import Steps
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

# Both motors are calibrated, as before a match: motions are tested here, not the learning of scales.
SCALE = Measured(SIMULATOR.bemf_volts / RobotConfig().model.left.back_emf_constant.value, 1e-6)
FULL_RATE = RobotConfig(
    motors={port: MotorConfig(radians_per_tick=SCALE) for port in (0, 1)},
    tophats={"left": TophatConfig(0, 0.11, 0.03), "right": TophatConfig(1, 0.11, -0.03)},
)
"""200 Hz, for what depends on how many readings there are."""
CONFIG = replace(FULL_RATE, controller=ControllerConfig(rate_hz=100.0))
"""In half of the time."""


def simulated_port(
    seed: int = 1,
    world: World | None = None,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    config: RobotConfig = CONFIG,
    effects: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
    chain: Chain | None = None,
) -> SimPort:
    """The calibrated robot; effects by id, with @left or @right where it is one side's."""
    parameters = Parameters.from_robot(config)
    if chain is not None:
        parameters = parameters.with_chain(chain)
    for name, values in effects.items():
        effect, _, side = name.partition("@")
        parameters = parameters.with_effect(effect, side or None, **values)
    rate = config.controller.rate_hz
    return SimPort(parameters, world or World.empty(), robot=config, seed=seed, rate_hz=rate, start=start)


@cache
def tophat_calibration() -> TophatCalibration:
    """White at 1270 counts, black at 3800. Made once, by whoever needs it: not where tests are collected."""
    return calibrate([level + i % 5 for level in (1270.0, 3800.0) for i in range(200)])


class InterceptingPort:
    """A port before another one, by default the simulated robot's: `seen` changes what is read, `sent` what
    is commanded. It remembers every command and every remark."""

    def __init__(
        self,
        port: Port | None = None,
        *,
        seen: Callable[[Inputs], Inputs] = lambda inputs: inputs,
        sent: Callable[[Outputs], Outputs] = lambda outputs: outputs,
    ) -> None:
        self.port = simulated_port() if port is None else port
        self.seen, self.sent = seen, sent
        self.written: list[Outputs] = []
        self.notes: list[str] = []

    def read(self) -> Inputs:
        return self.seen(self.port.read())

    def write(self, outputs: Outputs) -> None:
        self.written.append(outputs)
        self.port.write(self.sent(outputs))

    def close(self) -> None:
        self.port.close()

    def annotate(self, name: str, values: tuple[float, ...]) -> None:
        """Estimates are not looked at here."""

    def event(self, text: str) -> None:
        self.notes.append(text)


def endless_action(ended: list[str], name: str, error: Exception | None = None) -> Action[None]:
    """One that does nothing until it is ended; it notes its name then, and raises `error`."""

    def steps(_robot: Robot) -> Steps[None]:
        try:
            while True:
                yield
        finally:
            ended.append(name)
            if error is not None:
                raise error

    return Action(name, steps)


def run(
    action: Action[Any], port: Port | None = None, config: RobotConfig = CONFIG
) -> tuple[Any, Truth, Robot]:
    """Result, true end pose and the robot, after 0.3 s of standing still at first."""
    with open_robot(config, port=port or simulated_port()) as robot:
        robot.run(wait(0.3))
        result = robot.run(action)
        robot.run(wait(0.2))
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        return result, robot.inputs.truth, robot
