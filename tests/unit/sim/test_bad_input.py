"""What cannot be is refused with its name, its value and what is allowed, from Python and from a file."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.schema import Measured
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from raccoon.sim.world.table import Box, Light, Line, Ramp, Thing, Wall

TIME = (np.arange(40) * 0.005).astype(np.float64)
ZERO, ONE = np.zeros(40), np.ones(40)
COMMANDS = Commands.of_wheels(TIME, 0.5 * ONE, 0.5 * ONE)
NAN = math.nan


def plain() -> Parameters:
    return Parameters.from_robot(RobotConfig())


def nominal(part: str, **values: float) -> Parameters:
    """A robot made in Python, whose numbers no reader of a file has checked."""
    model = RobotConfig().model
    section = replace(getattr(model, part), **{name: Measured(value) for name, value in values.items()})
    return Parameters.from_robot(replace(RobotConfig(), model=replace(model, **{part: section})))


@pytest.mark.parametrize(
    ("part", "name", "value", "allowed"),
    [
        ("drive", "track_width", 0.0, r"numbers from 0\.01 to 10"),
        ("drive", "track_width", -0.1, r"numbers from 0\.01 to 10"),
        ("drive", "wheel_radius", 0.0, r"numbers from 0\.001 to 1"),
        ("drive", "inertia_turn", -0.01, r"numbers from 1e-12 to 1e\+06"),
        ("left", "armature_resistance", -1.0, r"numbers from 0\.01 to 1000"),
        ("right", "armature_resistance", 0.0, r"numbers from 0\.01 to 1000"),
        ("left", "back_emf_constant", 0.0, r"numbers from 0\.001 to 100"),
        ("battery", "internal_resistance", -1.0, "numbers from 0"),
        ("battery", "open_circuit_voltage", -6.0, r"numbers from 3\.1 to 30"),
        ("friction", "coulomb", -1.0, "numbers from 0"),
        ("bemf", "filter_time_constant", -1.0, "numbers from 0"),
        ("imu", "gyro_scale", 7.0, r"numbers from 0\.5 to 2"),
    ],
)
def test_impossible_robots(part: str, name: str, value: float, allowed: str) -> None:
    robot = nominal(part, **{name: value})
    message = rf"model\.(motor\.)?{part}\.{name} is {value}: allowed are {allowed}"
    with pytest.raises(ConfigError, match=message):
        SimPort(robot)
    with pytest.raises(ConfigError, match=message):
        rollout(robot, COMMANDS)


def test_a_robot_too_light_for_any_step_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"time constant is .* s: allowed are 0\.0001 s and more"):
        SimPort(nominal("drive", inertia_straight=1e-9, inertia_turn=1e-9))


@pytest.mark.parametrize("value", ["x", None, True, NAN, math.inf, -0.1, 6.0])
def test_impossible_parameters(value: Any) -> None:
    with pytest.raises(ConfigError, match=r"friction\.coulomb: torque is .*: (allowed are|it must be)"):
        plain().with_effect("friction.coulomb", torque=value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: plain().with_effect("friction.none"), "effect 'friction.none': there is no such id"),
        (lambda: plain().with_effect("friction.coulomb", force=1), "no parameter force; allowed are torque"),
        (lambda: plain().with_effect("friction.coulomb", "up"), "where is 'up': allowed are left, right, 0"),
        (lambda: plain().with_effect("drive.track_width", "left"), "it belongs to the whole robot"),
        (lambda: plain().with_effect("tophat.height", height=0.001), r"numbers from 0\.002 to 0\.06"),
        (lambda: plain().with_effect("tophat.gain", "3"), r"robot\.toml has no tophat"),
        (lambda: Chain(battery_held=-0.1), r"battery_held is -0\.1: allowed are numbers from 0\.0 to 1\.0"),
        (lambda: Chain(coast_share=1.0), r"coast_share is 1\.0: allowed are numbers from 0\.0 to 0\.9"),
        (lambda: Chain(cycle=NAN), "cycle is nan"),
        (lambda: Chain(median=3), "median is 3: allowed are true and false"),  # type: ignore[arg-type]
        (lambda: Chain(whole=1), "whole is 1: allowed are true and false"),  # type: ignore[arg-type]
        (lambda: Chain(threshold=True, cut=True), "threshold and cut are both true"),
        (lambda: Chain(slots=True, free_running=True), "slots and free_running are both true"),
        (lambda: Noise(bemf=-1.0), "bemf is -1.0"),
        (lambda: SimPort(plain(), physics_step=0.1), r"physics_step is 0\.1: allowed .* 1e-05 to 0\.005"),
        (lambda: SimPort(plain(), rate_hz=NAN), "rate_hz is nan"),
        (lambda: SimPort(plain(), imu_rate_hz=-5.0), "imu_rate_hz is -5.0"),
        (lambda: SimPort(plain(), start=(NAN, 0.0, 0.0)), "start is"),
        (lambda: rollout(plain(), COMMANDS, longest_step=1.0), r"longest_step is 1\.0 s: .* up to 0\.02"),
        (lambda: rollout(plain(), COMMANDS, initial={"x": NAN}), "initial: x is nan"),
        (lambda: rollout([plain()] * 3, COMMANDS, initial={"x": [1.0, 2.0]}), r"shape \(2,\): .* or 3"),
        (lambda: Commands(TIME, NAN * ONE, ZERO, ONE, ONE), r"left\[0\] is nan: allowed are duties"),
        (lambda: Commands(TIME, ZERO, ZERO, 2.0 * ONE, ONE), r"closed_left\[0\] is 2\.0: .* from 0 to 1"),
        (lambda: Commands(NAN * TIME, ZERO, ZERO, ONE, ONE), "times must be finite"),
        (lambda: Commands.of_wheels(TIME, ZERO, math.inf * ONE), r"right\[0\] is inf"),
        (lambda: Commands.of_wheels(TIME, [0.1], ZERO), r"left has the shape \(1,\)"),
        (lambda: Commands.of_wheels(TIME, ZERO, ZERO, brake=NAN), "brake: allowed are True and False"),
        (lambda: Line(((0.0, 0.0), (0.0, 0.0))), "none twice in a row"),
        (lambda: Line(((0.0, 0.0), (1.0, 0.0)), width=0.0), "line: width is 0.0"),
        (lambda: Wall((1.0, 1.0), (1.0, 1.0)), "they must differ"),
        (lambda: Thing((NAN, 0.0), 0.1), "object: one of its numbers is nan"),
        (lambda: Thing((0.0, 0.0), NAN), "object: radius is nan"),
        (lambda: Box((0.0, 0.0), (0.0, 1.0)), "must be below high"),
        (lambda: Light(Box((0.0, 0.0), (1.0, 1.0)), 3.0), "ambient is 3.0"),
        (lambda: Ramp(Box((0.0, 0.0), (1.0, 1.0)), NAN), "ramp: one of its numbers is nan"),
    ],
)
def test_named_with_value_and_bound(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make()
