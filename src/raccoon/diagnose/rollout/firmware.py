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
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, MOTOR_PORTS, RACCOON_COASTS, SIMULATOR, Device
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.sample_clock import (
    SampleClock,
    count_arrivals,
    count_by_ticks,
    find_sample_clock,
    resample_to_one_age,
    resample_wheel_to_one_age,
)
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.dead_zone_evidence import ZONE
from raccoon.hal.wombat.firmware.devices import (
    RACCOON_21_DEAD_ZONE,
    RACCOON_BEMF_RATE_HZ,
    STOCK_COUNTS_PER_TICK,
)
from raccoon.hal.wombat.firmware.dialect import LARGEST_BEMF
from raccoon.hal.wombat.firmware.raccoon.commands import FULL_PWM
from raccoon.hal.wombat.firmware.stock.bemf import StockBemf
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import SIDES, Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BATTERY = "battery.voltage"
LAG = "bemf.filter_lag"
KEPT_READING_SHARE = 0.75
"""Part of the largest reading from which one that stays, as its counter does, is kept."""


@dataclass(frozen=True, slots=True)
class Firmware:
    """A firmware's habits.

    name: as a report says it. chain: of its samples. wombat: whether it is a Wombat's; of the simulator the
    chain alone is known, and all that it rehearses is asked for. rates: samples of each motor a second, at
    least and at most, and gyro_rates of the gyro where they follow no row. tick: counts of one sample that
    move a position by one. sums: whether its positions are all that it shows of samples. waits: how many
    times from sample to sample commands come into force. lead: s from then until a sample can be read. most:
    counts of back-EMF, of which it keeps the last less than these. dead_zone: counts below which it says 0.
    silent: counts up to which it may say 0. units: whether the recording itself names it, and with it the
    units of all words. low: V by which the battery's readings are too low where it
    falls. sag: part of the battery's resistance that its readings do not tell. smooths: whether the gyro is
    the board's own, which it sets to 41 Hz.
    """

    name: str
    chain: Chain
    wombat: bool = True
    rates: tuple[float, float] = (0.0, 0.0)
    tick: float = 0.0
    gyro_rates: tuple[float, float] | None = None
    sums: bool = False
    waits: int = 1
    lead: float = 0.0
    most: float = math.inf
    dead_zone: float = 0.0
    silent: float = 0.0
    low: float = 0.0
    sag: float = 0.0
    smooths: bool = True
    units: bool = True

    def with_battery_uncertainty(self, robot: RobotConfig) -> RobotConfig:
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

    def without_known_causes(self, causes: Sequence[Cause], *, filters: bool) -> list[Cause]:
        """The causes less what is known: a dead zone, or that there is none; and the filter of back-EMF,
        where the device and not robot.toml says what it is (filters)."""
        known = {ZONE, LAG} if filters else {ZONE}
        return [each for each in causes if not (self.wombat and each.id in known)]

    def undo_truncation(self, columns: Columns) -> Columns:
        """The columns with the battery as it was before its filter cut fractions of a count off. (What
        back-EMF loses so is made up for where it is read.)"""
        if not self.low or BATTERY not in columns:
            return columns
        return {**columns, BATTERY: columns[BATTERY] + self.low}

    def correct_log(self, log: Log, columns: Columns, robot: RobotConfig) -> Log:
        """The log with commands as the drivers get them, a whole number of PWM levels, of which a motor
        coasts at 0; with the clocks of its samples where their counters tell them, and readings by these."""
        if not self.wombat:
            return log
        channels = {each.role: each.values for each in log.channels}
        clocks: list[SampleClock | None] = []
        for side in SIDES:
            port = getattr(robot.drive, side)
            values, position = channels.get(f"bemf_{side}"), columns.get(f"motor.{port}.position")
            clock = None
            if values is not None and position is not None:
                values = self._without_saturated(values, position)
                ticks = position * (-1.0 if robot.motor(port).inverted else 1.0)
                seen = (log.time, values, ticks, self.tick)
                clock = find_sample_clock(log.time, count_by_ticks(*seen), self.rates, self.waits, self.lead)
                if clock is not None:
                    values = resample_wheel_to_one_age(clock, *seen, self.sums, self.dead_zone)
                channels[f"bemf_{side}"] = values
            clocks.append(clock)
        if "gyro" in channels and self.gyro_rates is not None:
            clock = find_sample_clock(log.time, count_arrivals(log.time, channels["gyro"]), self.gyro_rates)
            if clock is not None:
                channels["gyro"] = resample_to_one_age(clock, log.time, channels["gyro"])
        return replace(
            log,
            duty=np.rint(FULL_PWM * log.duty) / FULL_PWM,
            channels=tuple(replace(each, values=channels[each.role]) for each in log.channels),
            clocks=(clocks[0], clocks[1]),
            notes=(*log.notes, *_clock_notes([each for each in clocks if each is not None])),
        )

    def _without_saturated(self, bemf: Array, position: Array) -> Array:
        """Back-EMF without the readings that are kept while the wheel is faster than can be read."""
        kept = (np.diff(position, prepend=position[:1]) == 0.0) & (
            np.abs(bemf) > KEPT_READING_SHARE * self.most
        )
        twice = kept & (np.roll(kept, 1) | np.roll(kept, -1))
        return np.where(twice, np.nan, bemf)


def _clock_notes(clocks: Sequence[SampleClock]) -> tuple[str, ...]:
    if not clocks:
        return ()
    rate = 1.0 / clocks[0].period
    return (
        f"the counters tell when the controller took its samples, {rate:.1f} a second: readings are compared "
        "as if each were half a cycle old, and commands come into force where they did",
    )


RACCOON_PAUSE = 0.000544
"""s: 500 us of coasting and 44 of conversion."""
RACCOON_BATTERY = 0.004
"""s by which the battery's reading is late: the mean of 4 ms of conversions, 0 to 4 ms old. A current that
dies away with 60 ms is 7 % larger that much earlier, as a resistance was."""
_RACCOON = Chain(
    median=True,
    free_running=True,
    coast_share=RACCOON_COASTS,
    battery_time_constant=RACCOON_BATTERY,
    pause=RACCOON_PAUSE,
)
RACCOON_RATES = (172.0, 199.0)
"""Of four motors 175 to 187 were measured, of 200 by design."""
RACCOON_LEAD = 1.0 / (MOTOR_PORTS * RACCOON_BEMF_RATE_HZ) - RACCOON_PAUSE
"""s: a motor's slot less its pause. Then it is driven as commanded, and its reading is ready at the end
of the slot. Version 17 drives each motor anew in every slot."""
STOCK_SILENT = 10.0 / 0.25
"""Counts: a quarter of a sample must be 10 for the filter to leave 0."""
STOCK_LOW = 2.0 * BATTERY_VOLTS_PER_COUNT
"""V, with a count of noise: int(0.95 old + 0.05 new) loses a count whenever a sample is below it."""
SAG = 0.06
"""When in a slot the converter gets to the battery is in no source, and how many slots RaccoonOS's mean of
some 50 conversions takes. A reading that never sees its motors coast sags by a ninth more than the mean."""
FIRMWARES = {
    SIMULATOR.name: Firmware("the simulator", Chain(), wombat=False, smooths=False),
    "wombat-stock": Firmware(
        "the stock firmware",
        Chain.stock(),
        rates=(225.0, 275.0),
        tick=STOCK_COUNTS_PER_TICK,
        gyro_rates=(170.0, 199.0),
        sums=True,
        dead_zone=10.0 + StockBemf.TRUNCATION,
        silent=STOCK_SILENT,
        low=STOCK_LOW,
        sag=SAG,
    ),
    "wombat-raccoon-17": Firmware(
        "RaccoonOS 17",
        _RACCOON,
        rates=RACCOON_RATES,
        tick=1.0,
        waits=MOTOR_PORTS,
        lead=RACCOON_LEAD,
        most=LARGEST_BEMF,
        sag=SAG,
    ),
    "wombat-raccoon-21": Firmware(
        "RaccoonOS 21",
        _RACCOON,
        rates=RACCOON_RATES,
        tick=RACCOON_BEMF_RATE_HZ,
        most=LARGEST_BEMF,
        lead=RACCOON_LEAD,
        dead_zone=RACCOON_21_DEAD_ZONE,
        sag=SAG,
    ),
}
"""By the name of the device of a recording."""


def firmware_of(device: Device) -> Firmware | None:
    """The firmware that a recording names, None where it does not or nothing is known of it."""
    name, _, added = device.name.partition("+")
    known = FIRMWARES.get(name)
    return replace(known, smooths=False, gyro_rates=None) if known is not None and added else known
