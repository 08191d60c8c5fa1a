"""The change that an effect makes in a recording: the same drive simulated with and without it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.core.readings import Outputs
from raccoon.sim.effects.effect import Effect, Place
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from raccoon.sim.world.table import World

Floats = NDArray[np.float64]
ROBOT = replace(RobotConfig(), tophats={"front": TophatConfig(analog=0)})
SHOWN_WIDTHS = 4.0  # prior widths: large enough to see
STEP = 0.005
PIECES = (
    (0.05, 0.05, 0.5), (0.12, 0.12, 0.5), (0.6, 0.6, 1.0), (-0.6, -0.6, 1.0),
    (0.6, -0.6, 0.7), (-0.6, 0.6, 0.7), (1.0, 0.5, 1.0), (0.0, 0.0, 0.5),
)  # fmt: skip
"""Pieces of the drive: duty left, duty right (-1..1), duration in s."""
UNITS = {"bemf": "counts", "battery": "V", "gyro": "rad/s", "heading": "rad", "x": "m", "y": "m"}
CHANNELS = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage", "truth.heading", "truth.x")


@dataclass(frozen=True)
class Comparison:
    """One channel of the same drive without and with an effect.

    unit: of the channel. time: s. values: the effect's parameters.
    """

    channel: str
    unit: str
    time: Floats
    without: Floats
    with_effect: Floats
    values: dict[str, float]


def comparison(entry: Effect) -> Comparison:
    """The channel in which an effect shows most, relative to the channel's range."""
    values = shown_values(entry)
    plain = Parameters.from_robot(ROBOT)
    where = "left" if entry.place is Place.SIDE else None
    changed = plain.with_effect(entry.id, where, **values)
    if entry.place is Place.TOPHAT:
        time, before, after = (*_over_lines(plain), _over_lines(changed)[1])
        return Comparison("analog.0", "counts", time, before, after, values)
    commands = drive()
    first, second = (rollout(each, commands, channels=CHANNELS) for each in (plain, changed))
    name = max(CHANNELS, key=lambda each: _difference(first[each][0], second[each][0]))
    unit = next(unit for word, unit in UNITS.items() if word in name.split("."))
    return Comparison(name, unit, first.time, first[name][0], second[name][0], values)


def shown_values(entry: Effect) -> dict[str, float]:
    """Parameter values at which an effect is easy to see: SHOWN_WIDTHS prior widths from neutral, clipped to
    the bounds."""
    plain = Parameters.from_robot(ROBOT)
    values = {}
    for each in entry.parameters:
        neutral = plain.value(entry.id, each.name, "left" if entry.place is Place.SIDE else None)
        if each.initial is not None:
            values[each.name] = each.initial
        elif math.isinf(neutral):
            values[each.name] = each.prior_width
        else:
            shown = neutral + SHOWN_WIDTHS * each.prior_width
            values[each.name] = min(max(shown, each.bounds.low), each.bounds.high)
    return values


def drive() -> Commands:
    """Commands of a drive in which every effect can show: creeping, steps forward and back, turns."""
    lengths = [round(seconds / STEP) for _, _, seconds in PIECES]
    left = np.repeat([piece[0] for piece in PIECES], lengths)
    right = np.repeat([piece[1] for piece in PIECES], lengths)
    return Commands.of_wheels(np.arange(len(left)) * STEP, left, right)


def _difference(first: Floats, second: Floats) -> float:
    return float(np.sqrt(np.mean((first - second) ** 2)) / (np.ptp(first) + 1e-9))


def _over_lines(parameters: Parameters) -> tuple[Floats, Floats]:
    port = SimPort(parameters, World.default(), start=(0.6, 0.2, 0.0), seed=1)
    port.write(Outputs(duty=(0.8, 0.8, 0.0, 0.0)))
    cycles = [port.read() for _ in range(600)]
    return np.array([each.time for each in cycles]), np.array([float(each.analog[0] or 0) for each in cycles])
