"""Ports that add the readings of I2C sensors to a port."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from raccoon.core.port import Port
from raccoon.core.readings import Device, Inputs
from raccoon.hal.added_sensor import AddedSensorPort, with_loss
from raccoon.hal.i2c.bus import I2cBus
from raccoon.hal.i2c.ina import DEFAULT_ADDRESS as INA_ADDRESS
from raccoon.hal.i2c.ina import PowerSample, find_monitor
from raccoon.hal.i2c.mpu import DEFAULT_ADDRESS as MPU_ADDRESS
from raccoon.hal.i2c.mpu import ImuSample, Mpu
from raccoon.hal.i2c.sampler import Sampler, Source

T = TypeVar("T")

STALE_S = 0.1
"""s without a new sample after which a sensor counts as lost."""
IMU_PERIOD = 0.004
"""Sampling period of the IMU, s: a little shorter than a 200 Hz cycle, so that every cycle finds a new
sample."""
POWER_PERIOD = 0.01
"""Sampling period of the battery monitor, s; the monitors average over 8.5 to 9 ms."""


class _FreshSamples(Generic[T]):
    """Distinguishes a new sample from one already used, and a lost sensor from a slow one."""

    def __init__(self, source: Source[T]) -> None:
        self._source = source
        self._number = -1
        self._seen: float | None = None

    def take(self, time: float) -> T | None:
        """The newest sample if it has not been taken yet, else None. time: that of the cycle, s."""
        if self._seen is None:
            self._seen = time
        newest = self._source.newest
        if newest is None or newest.number == self._number:
            return None
        self._number, self._seen = newest.number, time
        return newest.value

    def lost(self, time: float) -> bool:
        return self._seen is not None and time - self._seen > STALE_S


class _SampledPort(AddedSensorPort, Generic[T]):
    def __init__(self, port: Port, source: Source[T]) -> None:
        super().__init__(port, source)
        self._fresh = _FreshSamples(source)


class ImuPort(_SampledPort[ImuSample]):
    """Wraps `port`: the words gyro and accel become those of an added IMU, or `extra` gains them as imu2.*.

    With replace_words the Device changes with the words (name, gyro_rad_s, accel_m_s2), `extra` gains
    imu.temperature (Celsius), and the controller's own IMU is never a substitute: if the sensor is lost, the
    words are None and the fault SENSOR_LOST is added. Without replace_words, `extra` gains imu2.gyro.x|y|z
    (rad/s), imu2.accel.x|y|z (m/s2) and imu2.temperature (Celsius) in every cycle with a new sample.
    """

    def __init__(
        self, port: Port, source: Source[ImuSample], scale: Mpu, *, replace_words: bool = True
    ) -> None:
        super().__init__(port, source)
        self._scale = scale
        self._replace = replace_words
        self._device: tuple[Device, Device] | None = None

    def read(self) -> Inputs:
        """The wrapped port's next cycle, with the newest sample in it."""
        inputs = self._port.read()
        sample = self._fresh.take(inputs.time)
        faults = with_loss(inputs.faults, self._fresh.lost(inputs.time))
        if self._replace:
            return replace(
                inputs,
                device=self._scaled(inputs.device),
                gyro=None if sample is None else sample.gyro,
                accel=None if sample is None else sample.accel,
                extra=_with_extra(inputs, {} if sample is None else {"imu.temperature": sample.temperature}),
                faults=faults,
            )
        return replace(inputs, extra=_with_extra(inputs, self._second(sample)), faults=faults)

    def _scaled(self, device: Device) -> Device:
        if self._device is None or self._device[0] is not device:
            scale = self._scale
            name = f"{device.name}+{scale.name}"
            scaled = replace(device, name=name, gyro_rad_s=scale.gyro_rad_s, accel_m_s2=scale.accel_m_s2)
            self._device = (device, scaled)
        return self._device[1]

    def _second(self, sample: ImuSample | None) -> dict[str, float]:
        if sample is None:
            return {}
        words = _words_by_axis("imu2.accel", sample.accel, self._scale.accel_m_s2)
        if sample.gyro is not None:
            words |= _words_by_axis("imu2.gyro", sample.gyro, self._scale.gyro_rad_s)
        return words | {"imu2.temperature": sample.temperature}


class BatteryMonitorPort(_SampledPort[PowerSample]):
    """Wraps `port`: `extra` gains battery.voltage (V) and battery.current (A, positive out of the battery).

    Both exist only in cycles with a new sample; the current is left out beyond the shunt's range. A lost
    monitor adds the fault SENSOR_LOST.
    """

    def read(self) -> Inputs:
        """The wrapped port's next cycle, with the newest sample in it."""
        inputs = self._port.read()
        sample = self._fresh.take(inputs.time)
        faults = with_loss(inputs.faults, self._fresh.lost(inputs.time))
        if sample is None:
            return inputs if faults is inputs.faults else replace(inputs, faults=faults)
        words = {"battery.voltage": sample.voltage}
        if sample.current is not None:
            words["battery.current"] = sample.current
        return replace(inputs, extra=_with_extra(inputs, words), faults=faults)


def _words_by_axis(name: str, words: tuple[int, int, int], scale: float) -> dict[str, float]:
    return {f"{name}.{axis}": word * scale for axis, word in zip("xyz", words, strict=True)}


def _with_extra(inputs: Inputs, words: Mapping[str, float]) -> Mapping[str, float] | None:
    """`extra` of the cycle with `words` added."""
    return {**(inputs.extra or {}), **words} if words else inputs.extra


def open_imu(
    port: Port,
    bus: int | str = 1,
    address: int = MPU_ADDRESS,
    *,
    axes: Sequence[str] = ("x", "y", "z"),
    replace_words: bool = True,
) -> ImuPort:
    """Wrap `port` with an MPU-6050/6500/9250/9255.

    bus: its number or path. axes: the chip's axes along forward, left and up, such as "-y". replace_words:
    whether its readings replace the controller's gyro and accelerometer, or are recorded beside them
    (`imu2.gyro.x` in rad/s, `imu2.accel.x` in m/s2). Raises HardwareError if there is none at `address`,
    ConfigError for axes or an address that are not allowed.
    """
    wires = I2cBus(bus)
    try:
        sensor = Mpu(wires, address, axes=axes)
        sensor.set_up()
    except (OSError, ValueError):
        wires.close()
        raise
    sampler = Sampler(sensor, IMU_PERIOD, on_close=wires.close)
    sampler.start()
    return ImuPort(port, sampler, sensor, replace_words=replace_words)


def open_battery_monitor(
    port: Port, bus: int | str = 1, address: int = INA_ADDRESS, *, shunt: float
) -> BatteryMonitorPort:
    """Wrap `port` with an INA219 or INA226: the battery's voltage in V and current in A, positive out of it.

    bus: its number or path. shunt: its resistance, ohm. Raises HardwareError if there is neither chip at
    `address`, ConfigError for a shunt or an address that is not allowed.
    """
    wires = I2cBus(bus)
    try:
        monitor = find_monitor(wires, address, shunt=shunt)
    except (OSError, ValueError):
        wires.close()
        raise
    sampler: Sampler[PowerSample] = Sampler(monitor, POWER_PERIOD, on_close=wires.close)
    sampler.start()
    return BatteryMonitorPort(port, sampler)
