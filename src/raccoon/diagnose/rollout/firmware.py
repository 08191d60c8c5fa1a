"""Known properties of a controller whose firmware a recording names: its filters, pauses and thresholds.

A Wombat's firmware is no fault of the robot, and its behaviour is known from its source. So for a recording
that raccoon made of a Wombat none of it is estimated, and a search starts from a simulation with the same
behaviour.
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
HELD_READING_SHARE = 0.75
"""Share of the largest reading, above which a reading is held if its position counter does not change."""


@dataclass(frozen=True, slots=True)
class Firmware:
    """Known properties of a firmware.

    name: as in a report. chain: its sensor chain. wombat: whether it is a Wombat's; of the simulator only the
    chain is known, and every effect is searched for. sample_rates: lowest and highest samples of each motor
    per second; gyro_rates: the same of the gyro, None if it has no clock of its own. counts_per_tick:
    back-EMF counts of one sample that change a position by one. shows_only_positions: whether only the
    positions show single samples. command_slots_per_sample: number of times in one sample period at which
    commands come into force. command_to_sample_time: s from then until a sample can be read. max_bemf:
    counts; above it the last reading below is held. dead_zone: counts below which it reads 0.
    max_silent_counts: counts up to which a reading may be 0. battery_bias: V by which the battery reads too
    low while its voltage falls. unread_resistance_share: share of the battery's resistance that its readings
    do not show. has_gyro_low_pass: whether the gyro is the board's own, which it sets to 41 Hz.
    is_named_by_recording: whether the recording itself names it, and with it the units of all numbers.
    """

    name: str
    chain: Chain
    wombat: bool = True
    sample_rates: tuple[float, float] = (0.0, 0.0)
    counts_per_tick: float = 0.0
    gyro_rates: tuple[float, float] | None = None
    shows_only_positions: bool = False
    command_slots_per_sample: int = 1
    command_to_sample_time: float = 0.0
    max_bemf: float = math.inf
    dead_zone: float = 0.0
    max_silent_counts: float = 0.0
    battery_bias: float = 0.0
    unread_resistance_share: float = 0.0
    has_gyro_low_pass: bool = True
    is_named_by_recording: bool = True

    def with_battery_uncertainty(self, robot: RobotConfig) -> RobotConfig:
        """The robot with the standard deviation of its battery's resistance increased by the share that the
        readings do not show."""
        number = robot.model.battery.internal_resistance
        if not self.unread_resistance_share or number.std == 0.0:
            return robot
        widened = replace(number, std=math.hypot(number.std, self.unread_resistance_share * number.value))
        battery = replace(robot.model.battery, internal_resistance=widened)
        return replace(robot, model=replace(robot.model, battery=battery))

    def with_dead_zone(self, robot: RobotConfig, model: Parameters | None) -> Parameters | None:
        """The simulation from which a search starts, with the firmware's dead zone; None for the nominal
        one."""
        if not self.dead_zone:
            return model
        start = Parameters.from_robot(robot) if model is None else model
        for side in SIDES:
            start = start.with_effect(ZONE, side, counts=self.dead_zone)
        return start

    def without_known_causes(self, causes: Sequence[Cause], *, filters: bool) -> list[Cause]:
        """The causes without those that the firmware determines: the dead zone and, if `filters`, the filter
        of back-EMF, which the device and not robot.toml then specifies."""
        known = {ZONE, LAG} if filters else {ZONE}
        return [each for each in causes if not (self.wombat and each.id in known)]

    def undo_truncation(self, columns: Columns) -> Columns:
        """The columns with the battery's voltage as before its filter truncated it to whole counts. (The
        truncation of back-EMF is corrected where it is read.)"""
        if not self.battery_bias or BATTERY not in columns:
            return columns
        return {**columns, BATTERY: columns[BATTERY] + self.battery_bias}

    def correct_log(self, log: Log, columns: Columns, robot: RobotConfig) -> Log:
        """The log with commands as the motor drivers receive them, in whole PWM levels (at level 0 a motor
        coasts). If position counters show the sample clocks, the log has these, and readings are resampled to
        one age."""
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
                samples = (log.time, values, ticks, self.counts_per_tick)
                clock = find_sample_clock(
                    log.time,
                    count_by_ticks(*samples),
                    self.sample_rates,
                    self.command_slots_per_sample,
                    self.command_to_sample_time,
                )
                if clock is not None:
                    values = resample_wheel_to_one_age(
                        clock, *samples, self.shows_only_positions, self.dead_zone
                    )
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
        """Back-EMF with NaN for readings that are held while the wheel is faster than the largest reading."""
        held = (np.diff(position, prepend=position[:1]) == 0.0) & (
            np.abs(bemf) > HELD_READING_SHARE * self.max_bemf
        )
        repeated = held & (np.roll(held, 1) | np.roll(held, -1))
        return np.where(repeated, np.nan, bemf)


def _clock_notes(clocks: Sequence[SampleClock]) -> tuple[str, ...]:
    if not clocks:
        return ()
    rate = 1.0 / clocks[0].period
    return (
        f"the counters show when the controller took its samples, {rate:.1f} a second: readings are compared "
        "as if each were half a cycle old, and commands act from when the controller applied them",
    )


RACCOON_PAUSE = 0.000544
"""Time in s: 500 us of coasting and 44 us of conversion."""
RACCOON_BATTERY = 0.004
"""Delay in s of the battery's reading: the mean of 4 ms of conversions, 0 to 4 ms old. A current that decays
in 60 ms was 7 % larger that much earlier, and without this delay a resistance came out so much too large."""
_RACCOON = Chain(
    median=True,
    free_running=True,
    coast_share=RACCOON_COASTS,
    battery_time_constant=RACCOON_BATTERY,
    pause=RACCOON_PAUSE,
)
RACCOON_RATES = (172.0, 199.0)
"""Samples of each motor per second, bounds. With four motors 175 to 187 were measured; the design value is
200."""
RACCOON_COMMAND_TO_SAMPLE = 1.0 / (MOTOR_PORTS * RACCOON_BEMF_RATE_HZ) - RACCOON_PAUSE
"""Time in s: a motor's slot less its pause. After the pause it is driven as commanded, and its reading is
ready at the end of the slot. Version 17 sets every motor's command in every slot."""
STOCK_MAX_SILENT_COUNTS = 10.0 / 0.25
"""Counts: a quarter of a sample must reach 10 for the filtered reading to leave 0."""
STOCK_BATTERY_BIAS = 2.0 * BATTERY_VOLTS_PER_COUNT
"""Voltage in V, with a count of noise: int(0.95 old + 0.05 new) loses a count whenever a sample is below
it."""
UNREAD_RESISTANCE_SHARE = 0.06
"""Share of the battery's resistance that its readings may not show. No source states when in a slot the
converter samples the battery, nor how many slots RaccoonOS's mean of some 50 conversions takes. A reading
that never falls into a motor's pause sags by a ninth more than the mean."""
FIRMWARES = {
    SIMULATOR.name: Firmware("the simulator", Chain(), wombat=False, has_gyro_low_pass=False),
    "wombat-stock": Firmware(
        "the stock firmware",
        Chain.stock(),
        sample_rates=(225.0, 275.0),
        counts_per_tick=STOCK_COUNTS_PER_TICK,
        gyro_rates=(170.0, 199.0),
        shows_only_positions=True,
        dead_zone=10.0 + StockBemf.TRUNCATION,
        max_silent_counts=STOCK_MAX_SILENT_COUNTS,
        battery_bias=STOCK_BATTERY_BIAS,
        unread_resistance_share=UNREAD_RESISTANCE_SHARE,
    ),
    "wombat-raccoon-17": Firmware(
        "RaccoonOS 17",
        _RACCOON,
        sample_rates=RACCOON_RATES,
        counts_per_tick=1.0,
        command_slots_per_sample=MOTOR_PORTS,
        command_to_sample_time=RACCOON_COMMAND_TO_SAMPLE,
        max_bemf=LARGEST_BEMF,
        unread_resistance_share=UNREAD_RESISTANCE_SHARE,
    ),
    "wombat-raccoon-21": Firmware(
        "RaccoonOS 21",
        _RACCOON,
        sample_rates=RACCOON_RATES,
        counts_per_tick=RACCOON_BEMF_RATE_HZ,
        max_bemf=LARGEST_BEMF,
        command_to_sample_time=RACCOON_COMMAND_TO_SAMPLE,
        dead_zone=RACCOON_21_DEAD_ZONE,
        unread_resistance_share=UNREAD_RESISTANCE_SHARE,
    ),
}
"""Firmwares by the name of a recording's device."""


def firmware_of(device: Device) -> Firmware | None:
    """The firmware that a recording names; None if it names none or an unknown one."""
    name, _, added = device.name.partition("+")
    known = FIRMWARES.get(name)
    return replace(known, has_gyro_low_pass=False, gyro_rates=None) if known is not None and added else known
