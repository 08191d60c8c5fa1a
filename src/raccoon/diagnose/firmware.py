"""What is known of a controller whose firmware a recording names: how it filters, pauses and cuts off.

A Wombat is none of the robot's faults. What its firmware does is written in its source, so of a recording
that raccoon made of one nothing of it is asked for, and a search starts from a simulation that does the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, Device
from raccoon.diagnose.hypotheses import Cause
from raccoon.diagnose.silence import ZONE
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import SIDES, Parameters

Columns = Mapping[str, NDArray[np.float64]]

BATTERY = "battery.voltage"


@dataclass(frozen=True, slots=True)
class Firmware:
    """A firmware's habits.

    name: as a report says it. chain: of its samples. dead_zone: counts of back-EMF below which it says 0.
    silent: counts up to which it may say 0. cut: counts by which its filter's readings are too near to 0, on
    the average. low: V by which the battery's readings are too low where it falls. sag: part of the battery's
    resistance that its readings do not tell. smooths: whether the gyro is the board's own, which it sets to
    41 Hz.
    """

    name: str
    chain: Chain
    dead_zone: float = 0.0
    silent: float = 0.0
    cut: float = 0.0
    low: float = 0.0
    sag: float = 0.0
    smooths: bool = True

    def known_of(self, robot: RobotConfig) -> RobotConfig:
        """The robot with as much doubt about its battery's resistance as the readings leave."""
        number = robot.model.battery.internal_resistance
        if not self.sag or number.std == 0.0:
            return robot
        less_sure = replace(number, std=math.hypot(number.std, self.sag * number.value))
        battery = replace(robot.model.battery, internal_resistance=less_sure)
        return replace(robot, model=replace(robot.model, battery=battery))

    def start(self, robot: RobotConfig, model: Parameters | None) -> Parameters | None:
        """The simulation that a search starts from, with the dead zone that the firmware has."""
        if not self.dead_zone:
            return model
        start = Parameters.from_robot(robot) if model is None else model
        for side in SIDES:
            start = start.with_effect(ZONE, side, counts=self.dead_zone)
        return start

    def asked_for(self, causes: Sequence[Cause]) -> list[Cause]:
        """The causes less what is known."""
        return [each for each in causes if not (self.dead_zone and each.id == ZONE)]

    def before_cutting(self, columns: Columns, ports: Sequence[int]) -> Columns:
        """The columns as they were before filters cut fractions of a count off."""
        names = [f"motor.{port}.bemf" for port in ports if f"motor.{port}.bemf" in columns]
        whole = {name: columns[name] + self.cut * np.sign(columns[name]) for name in names if self.cut}
        if self.low and BATTERY in columns:
            whole[BATTERY] = columns[BATTERY] + self.low
        return {**columns, **whole} if whole else columns


_RACCOON = Chain(median=True, free_running=True, coast_share=0.1)
STOCK_CUT = 0.375 / 0.25
"""Counts. int(0.25 new + 0.75 old) cuts off 0, 1, 2 or 3 quarters, and settles four times as much lower."""
STOCK_SILENT = 10.0 / 0.25
"""Counts: a quarter of a sample must be 10 for the filter to leave 0."""
STOCK_LOW = 3.0 * BATTERY_VOLTS_PER_COUNT
"""V, with a count of noise: int(0.95 old + 0.05 new) loses a count whenever a sample is below it."""
SAG = 0.06
"""When in a slot the converter gets to the battery is in no source. A reading that never sees RaccoonOS's
motors coast sags by a ninth more than the mean."""
FIRMWARES = {
    "wombat-stock": Firmware(
        "the stock firmware", Chain.stock(), 10.0 + STOCK_CUT, STOCK_SILENT, STOCK_CUT, STOCK_LOW, SAG
    ),
    "wombat-raccoon-17": Firmware("RaccoonOS 17", _RACCOON, sag=SAG),
    "wombat-raccoon-21": Firmware("RaccoonOS 21", _RACCOON, 25.0, sag=SAG),
}
"""By the name of the device of a recording."""


def firmware_of(device: Device) -> Firmware | None:
    """The firmware that a recording names, None where it does not or nothing is known of it."""
    name, _, added = device.name.partition("+")
    known = FIRMWARES.get(name)
    return replace(known, smooths=False) if known is not None and added else known
