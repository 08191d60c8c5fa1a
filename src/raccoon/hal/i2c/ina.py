"""The battery monitors INA219 and INA226: voltage of the battery and current out of it.

Texas Instruments, INA219 (SBOS448) and INA226 (SBOS547). The current is the voltage across the shunt over its
resistance; this needs none of the chips' calibration registers, so nothing is lost when a chip restarts. The
battery is on IN+ and the robot on IN-, so that the current which the robot draws is positive.
"""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.core.errors import ConfigError, HardwareError
from raccoon.hal.i2c.bus import I2cBus

DEFAULT_ADDRESS = 0x40
_LAST_ADDRESS = 0x4F
_CONFIG, _SHUNT, _BUS, _MANUFACTURER, _DIE = 0x00, 0x01, 0x02, 0xFE, 0xFF
_TEXAS_INSTRUMENTS = 0x5449


@dataclass(frozen=True, slots=True)
class PowerSample:
    """voltage in V; current in A, positive out of the battery, None beyond the shunt's range."""

    voltage: float
    current: float | None


@dataclass(frozen=True, slots=True)
class _Chip:
    name: str
    config: int
    shunt_volts: float
    shunt_limit: int
    bus_volts: float
    bus_shift: int


# 16 V range, shunt +-320 mV, mean of 8 conversions each (4.26 ms), continuous.
_INA219 = _Chip("ina219", 0x1DDF, 10e-6, 31_990, 4e-3, 3)
# Mean of 4 conversions of 1.1 ms each, continuous; shunt +-81.9 mV.
_INA226 = _Chip("ina226", 0x4327, 2.5e-6, 32_760, 1.25e-3, 0)
_INA219_AFTER_RESET = 0x399F
_RESET = 0x8000


class _Monitor:
    """Common part of both chips. shunt: its resistance, ohm."""

    _chip: _Chip

    def __init__(self, bus: I2cBus, address: int = DEFAULT_ADDRESS, *, shunt: float) -> None:
        _check(bus, address, self._chip.name, shunt)
        self._bus = bus
        self._address = address
        self._shunt = shunt

    @property
    def name(self) -> str:
        return self._chip.name

    @property
    def limit(self) -> float:
        """Largest current that can be measured, A."""
        return self._chip.shunt_limit * self._chip.shunt_volts / self._shunt

    def set_up(self) -> None:
        """Identify and configure the chip. Raises HardwareError for another chip."""
        self._identify()
        _write_word(self._bus, self._address, _CONFIG, self._chip.config)
        kept = _word(self._bus, self._address, _CONFIG)
        if kept != self._chip.config:
            raise HardwareError(
                f"{self.name} at {self._address:#04x}: configuration is {kept:#06x} "
                f"after {self._chip.config:#06x} was written; another chip, or a bad connection"
            )

    def read(self) -> PowerSample:
        """The newest sample. Raises HardwareError if the chip does not answer or was reset."""
        if _word(self._bus, self._address, _CONFIG) != self._chip.config:
            raise HardwareError(f"{self.name} at {self._address:#04x} lost its configuration: it was reset")
        shunt = _signed(_word(self._bus, self._address, _SHUNT))
        volts = (_word(self._bus, self._address, _BUS) >> self._chip.bus_shift) * self._chip.bus_volts
        clipped = abs(shunt) >= self._chip.shunt_limit
        return PowerSample(volts, None if clipped else shunt * self._chip.shunt_volts / self._shunt)

    def _identify(self) -> None:
        raise NotImplementedError


class Ina219(_Monitor):
    """INA219; breakout boards carry 0.1 ohm (3.2 A), too much for a robot: 0.01 ohm gives 32 A."""

    _chip = _INA219

    def _identify(self) -> None:
        # The chip has no identification register; its configuration after a reset is the best substitute.
        _write_word(self._bus, self._address, _CONFIG, _RESET)
        found = _word(self._bus, self._address, _CONFIG)
        if found != _INA219_AFTER_RESET:
            raise HardwareError(
                f"the device at {self._address:#04x} is not an INA219: its configuration after a reset is "
                f"{found:#06x}, not {_INA219_AFTER_RESET:#06x}"
            )


class Ina226(_Monitor):
    """INA226; breakout boards carry 0.1 ohm (0.8 A), too much for a robot: 0.005 ohm gives 16 A."""

    _chip = _INA226

    def _identify(self) -> None:
        if not _is_ina226(self._bus, self._address):
            raise HardwareError(
                f"the device at {self._address:#04x} is not an INA226: its identification differs"
            )


def find_monitor(bus: I2cBus, address: int = DEFAULT_ADDRESS, *, shunt: float) -> Ina219 | Ina226:
    """The monitor at `address`, set up. Raises HardwareError if there is neither of the two chips,
    ConfigError for an address or a shunt (ohm) that is not allowed."""
    _check(bus, address, "a battery monitor", shunt)
    monitor: Ina219 | Ina226
    if _is_ina226(bus, address):
        monitor = Ina226(bus, address, shunt=shunt)
    else:
        monitor = Ina219(bus, address, shunt=shunt)
    monitor.set_up()
    return monitor


def _is_ina226(bus: I2cBus, address: int) -> bool:
    # The last four bits of the die number are its revision.
    return (
        _word(bus, address, _MANUFACTURER) == _TEXAS_INSTRUMENTS
        and _word(bus, address, _DIE) & 0xFFF0 == 0x2260
    )


def _check(bus: I2cBus, address: int, device: str, shunt: float) -> None:
    if not DEFAULT_ADDRESS <= address <= _LAST_ADDRESS:
        raise ConfigError(f"{device} at {address:#04x}: allowed are 0x40 to 0x4f")
    bus.claim(address, device)
    if not 0.0 < shunt <= 10.0:
        raise ConfigError(f"shunt is {shunt} ohm: allowed are numbers above 0 up to 10")


def _word(bus: I2cBus, address: int, register: int) -> int:
    return int.from_bytes(bus.read(address, register, 2), "big")


def _write_word(bus: I2cBus, address: int, register: int, value: int) -> None:
    bus.write(address, register, value.to_bytes(2, "big"))


def _signed(word: int) -> int:
    return word - 0x1_0000 if word & 0x8000 else word
