"""How the controller samples and filters what it measures, and the noise of its sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from raccoon.core.errors import ConfigError
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, RACCOON_COASTS, STOCK_COASTS

SHORTEST_CYCLE = 0.001
"""Shortest time between two back-EMF samples, s."""
_RANGES = (
    ("coast_share", 0.0, 0.9),
    ("battery_time_constant", 0.0, 5.0),
    ("battery_held", 0.0, 1.0),
    ("pause", 0.0, 0.005),
    ("cycle", SHORTEST_CYCLE, 0.1),
)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True, slots=True)
class Chain:
    """Properties of the controller that are neither the robot's nor an effect's.

    median: back-EMF passes a median of its last three samples first. coast_share: share of the time in which
    a motor is unpowered so that its back-EMF can be measured. slots: motors are sampled one after the other
    in each cycle, port 0 a quarter of it after the start and port 3 at its end; otherwise all at its end.
    free_running: its cycle has a clock of its own, so that a row shows a sample that is up to a cycle old;
    the mean age, half a cycle, is simulated. battery_time_constant: s, of the battery reading's filter.
    battery_held: V by which a rising voltage may be above its reading, as with a filter that truncates
    fractions of a count; a falling one is followed, a little early. pause: s for which a motor has coasted
    when it is sampled: its wheel is then slower than its mean, by half of what it loses in a pause. together:
    all motors coast at once; while they are driven the battery sags under all of their current, and its
    readings are from that time. cycle: s between two back-EMF samples. whole: the battery carries all of each
    motor's current, whichever way it flows. A real driver connects a motor for a share of the time, and
    shorts it otherwise, so that it takes that share of the current from the battery, or returns it; a
    simulation that adds up currents neglects that. threshold, cut: the duty of a command beyond the deadband.
    With threshold, the whole command; with cut, the command less the deadband; with neither, the part beyond
    the deadband is stretched so that full power is full power.

    The default is the plain filter that robot.toml describes; `Chain.firmware()` is the RaccoonOS firmware's
    chain, `Chain.stock()` the stock firmware's.
    """

    median: bool = False
    slots: bool = False
    free_running: bool = False
    coast_share: float = 0.0
    battery_time_constant: float = 0.0
    battery_held: float = 0.0
    together: bool = False
    pause: float = 0.0
    cycle: float = 0.005
    whole: bool = False
    threshold: bool = False
    cut: bool = False

    def __post_init__(self) -> None:
        for name in ("median", "slots", "free_running", "together", "whole", "threshold", "cut"):
            if not isinstance(getattr(self, name), bool):
                raise ConfigError(f"chain: {name} is {getattr(self, name)!r}: allowed are true and false")
        if self.slots and self.free_running:
            raise ConfigError("chain: slots and free_running are both true: allowed is one of them")
        if self.threshold and self.cut:
            raise ConfigError("chain: threshold and cut are both true: allowed is one of them")
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not (_is_number(value) and low <= value <= high):
                raise ConfigError(f"chain: {name} is {value!r}: allowed are numbers from {low} to {high}")

    @classmethod
    def firmware(cls) -> Chain:
        """RaccoonOS: median of three, slots of a quarter cycle, 500 us of coasting in each 5 ms."""
        return cls(median=True, slots=True, coast_share=RACCOON_COASTS, battery_time_constant=0.02)

    @classmethod
    def stock(cls) -> Chain:
        """The stock firmware: all motors coast for a quarter of the time, every fourth pass of its loop,
        which is not synchronous with any row.

        Its battery filter, int(0.95 old + 0.05 new), needs 20 counts to rise by one; with a count or two of
        noise it ends 17 counts below a rising voltage, and 3 below a falling one. So the one sample in four
        that the coasting motors do not load has no effect.
        """
        return cls(
            free_running=True,
            coast_share=STOCK_COASTS,
            battery_time_constant=0.02,
            battery_held=14.0 * BATTERY_VOLTS_PER_COUNT,
            together=True,
            pause=0.00102,
        )


FIRMWARE_IMU_HZ = 50.0
"""Rate of new IMU readings of RaccoonOS, Hz."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the noise in a recording of one robot, at rest and moving.

    bemf: counts, of one sample before the filter. gyro: rad/s per reading. gyro_bias: rad/s, drawn once.
    accel: m/s2 per reading. battery, analog: counts per reading.
    """

    bemf: float = 6.0
    gyro: float = 0.001
    gyro_bias: float = math.radians(0.005)
    accel: float = 0.03
    battery: float = 1.5
    analog: float = 1.5

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (_is_number(value) and math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"noise: {each.name} is {value!r}: allowed are numbers from 0")

    @classmethod
    def none(cls) -> Noise:
        """A robot whose sensors have no noise."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
