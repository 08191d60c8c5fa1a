"""INA219 and INA226 at register level, and the port that adds volts and amperes to a cycle."""

from __future__ import annotations

from pathlib import Path

import pytest

from i2c_fake import FakeI2c, Ina219Chip, Ina226Chip, MpuChip
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import STOP, Fault
from raccoon.hal.i2c import (
    BatteryMonitorPort,
    I2cBus,
    Ina219,
    Ina226,
    PowerSample,
    Sampler,
    find_monitor,
    open_battery_monitor,
)
from standing_port import StandingPort


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> FakeI2c:
    return FakeI2c({}).put_in(monkeypatch)


def standing() -> StandingPort:
    return StandingPort(extra={"imu.temperature": 30.0}, faults=(Fault.TORN,))


@pytest.mark.parametrize("amperes", [-3.0, 0.0, 1.25, 14.0])
def test_both_chips_measure_volts_and_amperes(bus: I2cBus, kernel: FakeI2c, amperes: float) -> None:
    small, large = Ina219Chip(), Ina226Chip()
    kernel.chips = {0x40: small, 0x41: large}
    for chip, shunt in ((small, 0.01), (large, 0.005)):
        chip.measure(6.644, amperes * shunt)
    for monitor in (find_monitor(bus, 0x40, shunt=0.01), find_monitor(bus, 0x41, shunt=0.005)):
        sample = monitor.read()
        assert sample.voltage == pytest.approx(6.644, abs=0.002)
        assert sample.current == pytest.approx(amperes, abs=0.001)


def test_the_chip_is_found_by_its_numbers(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.chips = {0x40: Ina219Chip(), 0x45: Ina226Chip()}
    for _ in range(2):  # the next program finds them as the one before has left them
        assert find_monitor(bus, shunt=0.01).name == "ina219"
        assert find_monitor(bus, 0x45, shunt=0.01).name == "ina226"


def test_configuration_is_that_of_the_data_sheet(bus: I2cBus, kernel: FakeI2c) -> None:
    small, large = Ina219Chip(), Ina226Chip()
    kernel.chips = {0x40: small, 0x41: large}
    find_monitor(bus, 0x40, shunt=0.01)
    find_monitor(bus, 0x41, shunt=0.01)
    # INA219: 16 V, gain /8, 8 samples on both converters, continuous.
    assert small.words[0] == 0b0_0_0_11_1011_1011_111
    # INA226: 4 samples, 1.1 ms, 1.1 ms, continuous.
    assert large.words[0] == 0b0_100_001_100_100_111


def test_a_current_beyond_the_shunt_is_left_out(bus: I2cBus, kernel: FakeI2c) -> None:
    chip = Ina226Chip()
    kernel.chips = {0x40: chip}
    monitor = Ina226(bus, shunt=0.1)
    monitor.set_up()
    assert monitor.limit == pytest.approx(0.819, abs=1e-3)
    chip.words[2], chip.words[1] = 5000, 0x7FFF
    assert monitor.read() == PowerSample(voltage=6.25, current=None)


def test_a_wrong_chip_is_refused(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.chips = {0x40: MpuChip()}
    with pytest.raises(HardwareError, match="the device at 0x40 is not an INA219: its configuration after"):
        find_monitor(bus, shunt=0.01)
    with pytest.raises(HardwareError, match="the device at 0x40 is not an INA226"):
        Ina226(bus, shunt=0.01).set_up()


def test_a_chip_that_keeps_nothing_is_refused(bus: I2cBus, kernel: FakeI2c) -> None:
    class Deaf(Ina226Chip):
        def write(self, register: int, data: bytes) -> None:
            pass

    kernel.chips = {0x40: Deaf()}
    with pytest.raises(HardwareError, match="configuration is 0x4127 after 0x4327 was written"):
        find_monitor(bus, shunt=0.01)


@pytest.mark.parametrize(
    ("address", "shunt", "message"),
    [
        (0x3F, 0.01, "allowed are 0x40 to 0x4f"),
        (0x48, 0.01, "the touch controller TSC2007 is there already"),
        (0x40, 0.0, r"shunt is 0.0 ohm"),
        (0x40, float("nan"), "shunt is nan ohm"),
        (0x40, 11.0, "above 0 up to 10"),
    ],
)
def test_impossible_wiring_is_refused(bus: I2cBus, address: int, shunt: float, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Ina219(bus, address, shunt=shunt)


def test_a_reset_chip_is_configured_again(bus: I2cBus, kernel: FakeI2c) -> None:
    chip = Ina219Chip()
    kernel.chips = {0x40: chip}
    sampler = Sampler(Ina219(bus, shunt=0.01), 0.01, SteppedClock())
    assert sampler.step()
    chip.words = {0: 0x399F}
    assert [sampler.step() for _ in range(3)] == [False, False, False]
    assert "lost its configuration" in sampler.error
    assert sampler.step()
    assert sampler.error == ""


def test_volts_and_amperes_join_the_cycle(bus: I2cBus, kernel: FakeI2c) -> None:
    chip = Ina226Chip()
    kernel.chips = {0x40: chip}
    chip.measure(6.5, 0.015)
    sampler = Sampler(Ina226(bus, shunt=0.005), 0.01, SteppedClock())
    port = BatteryMonitorPort(standing(), sampler)
    assert port.read().extra == {"imu.temperature": 30.0}
    sampler.step()
    inputs = port.read()
    assert inputs.extra == {
        "imu.temperature": 30.0,
        "battery.voltage": pytest.approx(6.5),
        "battery.current": pytest.approx(3.0),
    }
    assert inputs.faults == (Fault.TORN,)
    assert port.read().extra == {"imu.temperature": 30.0}


def test_a_lost_monitor_is_a_fault_and_comes_back(bus: I2cBus, kernel: FakeI2c) -> None:
    chip = Ina226Chip()
    kernel.chips = {0x40: chip}
    sampler = Sampler(Ina226(bus, shunt=0.005), 0.01, SteppedClock())
    port = BatteryMonitorPort(standing(), sampler)
    assert [port.read().faults for _ in range(22)][-1] == (Fault.TORN, Fault.SENSOR_LOST)  # never was there
    sampler.step()
    assert port.read().faults == (Fault.TORN,)
    chip.nacks = 1000
    for _ in range(22):
        sampler.step()
        inputs = port.read()
    assert inputs.faults == (Fault.TORN, Fault.SENSOR_LOST)
    chip.nacks = 0
    sampler.step()
    inputs = port.read()
    assert inputs.faults == (Fault.TORN,)
    assert inputs.extra is not None
    assert "battery.current" in inputs.extra


def test_a_clipped_current_is_left_out_of_the_cycle(bus: I2cBus, kernel: FakeI2c) -> None:
    chip = Ina219Chip()
    kernel.chips = {0x40: chip}
    sampler = Sampler(Ina219(bus, shunt=0.1), 0.01, SteppedClock())
    chip.measure(6.4, 0.32)
    sampler.step()
    inputs = BatteryMonitorPort(standing(), sampler).read()
    assert inputs.extra == {"imu.temperature": 30.0, "battery.voltage": pytest.approx(6.4)}


def test_opening_and_closing(kernel: FakeI2c, tmp_path: Path) -> None:
    (tmp_path / "i2c-1").touch()
    kernel.chips = {0x40: Ina219Chip()}
    robot = standing()
    port = open_battery_monitor(robot, str(tmp_path / "i2c-1"), shunt=0.01)
    port.write(STOP)
    port.close()
    assert robot.closed
    assert robot.written == [STOP]
    kernel.chips = {}
    with pytest.raises(HardwareError, match="address 0x40: no answer"):
        open_battery_monitor(robot, str(tmp_path / "i2c-1"), shunt=0.01)
