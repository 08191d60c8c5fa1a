"""Sensors added on an I2C bus: another gyro, an ammeter for the battery."""

from raccoon.hal.i2c.bus import I2cBus
from raccoon.hal.i2c.ina import Ina219, Ina226, PowerSample, find_monitor
from raccoon.hal.i2c.mpu import ImuSample, Mpu, measure_bias
from raccoon.hal.i2c.ports import BatteryMonitorPort, ImuPort, open_battery_monitor, open_imu
from raccoon.hal.i2c.sampler import Sampler

__all__ = [
    "BatteryMonitorPort",
    "I2cBus",
    "ImuPort",
    "ImuSample",
    "Ina219",
    "Ina226",
    "Mpu",
    "PowerSample",
    "Sampler",
    "find_monitor",
    "measure_bias",
    "open_battery_monitor",
    "open_imu",
]
