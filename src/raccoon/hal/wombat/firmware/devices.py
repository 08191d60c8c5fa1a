"""Scales and signs of the Wombat's words for each firmware.

This is the only place where signs and scales of the two firmwares are unified; everything else uses these.

**Motor polarity.** On the same socket a positive command turns the shaft one way under the stock firmware (D0
high, back-EMF = H - L) and the other way under RaccoonOS (D1 high, back-EMF = L - H). The stock direction is
the reference: the codec multiplies duties, back-EMF and positions of RaccoonOS by `RACCOON_POLARITY`, so that
the same robot.toml drives in the same direction on both.

**IMU axes.** The chip is mounted with z down: lying flat, the stock registers read -1 g on z. Up is therefore
-z for both the accelerometer and the gyroscope. Forward is the chip's y and left its x: RaccoonOS takes its
forward axis from the chip's y, and left follows from right-handedness. Only z is certain. RaccoonOS rotates
its vectors into the world frame of its own quaternion; the codec rotates them back.

**Position ticks.** The counters of stock and version 17 sum back-EMF samples without regard to time, so the
size of a tick depends on the rate of the firmware's loop. Nominal rates are given here; pass a measured one
to `stock_device` or `raccoon_device` if it is known.

**Lag of the back-EMF.** Both firmwares smooth it, f <- f + a (raw - f), and sum the smoothed value. Summed
over the samples: sum(raw) = sum(f) + (1/a - 1) f, so the counter lags by exactly (1/a - 1) samples times the
smoothed back-EMF: 3 samples for the stock weight of 1/4, 4 for RaccoonOS's 1/5, whose median of three adds
one more.

**Dead zone.** The back-EMF below which motion may not be counted: the stock filter, in whole counts and cut
off below 10, needs 40 counts to leave 0; RaccoonOS 21 cuts off below 25; 17 has no dead zone.

**Range.** RaccoonOS does not accept a smoothed value beyond 2000 counts (6.6 V induced): back-EMF and counter
stay constant until the motor is slower. A fresh battery drives motors that fast. The stock firmware has no
such limit.
"""

from __future__ import annotations

import math

from raccoon.core.errors import ConfigError
from raccoon.core.readings import (
    BATTERY_VOLTS_PER_COUNT,
    BEMF_VOLTS_PER_COUNT,
    GRAVITY,
    RACCOON_COASTS,
    STOCK_COASTS,
    Device,
)

RACCOON_POLARITY = -1

STOCK_COUNTS_PER_TICK = 250
"""Back-EMF counts summed in one stock tick."""

STOCK_BEMF_RATE_HZ = 235.0
"""Updates a second of the shipped stock firmware; the published source would give about 268."""

STOCK_LAG_SAMPLES, RACCOON_LAG_SAMPLES = 3.0, 5.0
"""Lag of back-EMF and counters, in updates."""
STOCK_DEAD_ZONE, RACCOON_21_DEAD_ZONE = 40.0, 25.0
"""Back-EMF below which motion may not be counted, counts."""
RACCOON_RANGE = 2000.0
"""Largest back-EMF that RaccoonOS measures, counts."""

RACCOON_BEMF_RATE_HZ = 181.0
"""Updates a second of each motor in RaccoonOS: 200 by design, 175 to 187 measured on the counters of four
motors."""


def stock_device(bemf_rate_hz: float = STOCK_BEMF_RATE_HZ) -> Device:
    """The device of the stock firmware, whose back-EMF loop runs `bemf_rate_hz` times a second."""
    return Device(
        name="wombat-stock",
        bemf_volts=BEMF_VOLTS_PER_COUNT,
        position_counts_seconds=STOCK_COUNTS_PER_TICK / _rate(bemf_rate_hz),
        gyro_rad_s=math.radians(1.0) / 16.4,
        accel_m_s2=GRAVITY / 8192,
        battery_volts=BATTERY_VOLTS_PER_COUNT,
        bemf_lag=STOCK_LAG_SAMPLES / bemf_rate_hz,
        bemf_dead_zone=STOCK_DEAD_ZONE,
        driven_share=1.0 - STOCK_COASTS,
    )


def raccoon_device(version: int, bemf_rate_hz: float = RACCOON_BEMF_RATE_HZ) -> Device:
    """The device of RaccoonOS 17 or 21.

    Only in 17 does the size of a tick depend on the rate: 21 multiplies by its own time step.
    """
    rate_hz = _rate(bemf_rate_hz)
    return Device(
        name=f"wombat-raccoon-{version}",
        bemf_volts=BEMF_VOLTS_PER_COUNT,
        position_counts_seconds=1.0 if version >= 21 else 1.0 / rate_hz,
        gyro_rad_s=math.radians(1.0),
        accel_m_s2=1.0,
        battery_volts=BATTERY_VOLTS_PER_COUNT,
        bemf_lag=RACCOON_LAG_SAMPLES / rate_hz,
        bemf_dead_zone=RACCOON_21_DEAD_ZONE if version >= 21 else 0.0,
        driven_share=1.0 - RACCOON_COASTS,
        bemf_range=RACCOON_RANGE,
    )


def _rate(bemf_rate_hz: float) -> float:
    if not 50.0 <= bemf_rate_hz <= 1000.0:
        raise ConfigError(f"bemf_rate_hz is {bemf_rate_hz}: allowed are 50 to 1000")
    return bemf_rate_hz


STOCK = stock_device()
RACCOON_17 = raccoon_device(17)
RACCOON_21 = raccoon_device(21)
