"""The MPU family at register level, and the port that puts its words into a cycle."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from i2c_fake import Chip, FakeI2c, Ina226Chip, MpuChip
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import CalibrationError, ConfigError, HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import SIMULATOR, STOP, Fault
from raccoon.hal.i2c import I2cBus, ImuPort, Ina226, Mpu, Sampler, measure_bias, open_imu
from raccoon.hal.i2c.ports import IMU_PERIOD, POWER_PERIOD
from standing_port import StandingPort


@pytest.fixture
def chip() -> MpuChip:
    return MpuChip()


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch, chip: MpuChip) -> FakeI2c:
    return FakeI2c({0x69: chip}).put_in(monkeypatch)


def standing() -> StandingPort:
    """Its own gyro says nothing else than 7."""
    return StandingPort(gyro=(7, 7, 7), accel=(7, 7, 7))


@pytest.mark.parametrize(
    ("identity", "name", "filtered", "celsius"),
    [
        (0x68, "mpu6050", 0, -1000 / 340.0 + 36.53),  # degrees by its register map
        (0x70, "mpu6500", 3, -1000 / 333.87 + 21.0),
        (0x71, "mpu9250", 3, -1000 / 333.87 + 21.0),
        (0x73, "mpu9255", 3, -1000 / 333.87 + 21.0),
    ],
)
def test_the_family_is_recognised_and_configured(
    bus: I2cBus, kernel: FakeI2c, identity: int, name: str, filtered: int, celsius: float
) -> None:
    chip = MpuChip(identity)
    kernel.chips[0x69] = chip
    sensor = Mpu(bus)
    sensor.set_up()
    assert sensor.name == name
    registers = chip.registers
    assert registers[0x6B] == 0x01  # awake
    assert registers[0x1A] == 3  # 41 Hz
    assert (registers[0x1B], registers[0x1C]) == (0x10, 0x08)  # 1000 deg/s, 4 g
    assert registers[0x1D] == filtered  # on the 6050 that register means something else
    assert sensor.read().temperature == pytest.approx(celsius)


def test_another_chip_is_refused_with_its_number(bus: I2cBus, chip: MpuChip) -> None:
    chip.registers[0x75] = 0xEA
    with pytest.raises(HardwareError, match=r"the device at 0x69 says it is 0xea: allowed are 0x68"):
        Mpu(bus).set_up()


def test_a_chip_that_keeps_nothing_is_refused(bus: I2cBus, kernel: FakeI2c) -> None:
    class Deaf(MpuChip):
        def write(self, register: int, data: bytes) -> None:
            pass

    kernel.chips[0x69] = Deaf()
    with pytest.raises(HardwareError, match=r"register 0x6b is 0x40 after 0x01 was written"):
        Mpu(bus).set_up()


def test_the_address_of_the_clock_is_refused(bus: I2cBus) -> None:
    with pytest.raises(ConfigError, match=r"an MPU at 0x68: the clock DS1340 is there already"):
        Mpu(bus, 0x68)


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (("x", "y"), "allowed are three of x, y, z"),
        (("x", "x", "z"), "each once"),
        (("x", "y", "w"), "allowed are three of"),
        (("-x", "y", "z"), "mirror image"),
        (("y", "x", "z"), "mirror image"),
    ],
)
def test_axes_must_be_a_rotation(bus: I2cBus, axes: tuple[str, ...], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Mpu(bus, axes=axes)


def test_an_unknown_range_is_refused(bus: I2cBus) -> None:
    with pytest.raises(ConfigError, match="gyro_range_deg_s is 300: allowed are 250, 500, 1000 and 2000"):
        Mpu(bus, gyro_range_deg_s=300)


@pytest.mark.parametrize("deg_s", [250, 500, 1000, 2000])
def test_full_scale_is_the_range(bus: I2cBus, deg_s: int) -> None:
    assert 32_768 * Mpu(bus, gyro_range_deg_s=deg_s).gyro_rad_s == pytest.approx(math.radians(deg_s))


def test_words_come_in_the_robots_axes(bus: I2cBus, chip: MpuChip) -> None:
    sensor = Mpu(bus, axes=("-y", "x", "z"))
    sensor.set_up()
    chip.motion, chip.force, chip.noise = (10, 20, -30), (100, 200, 8192), False
    sample = sensor.read()
    assert sample.gyro == (-20, 10, -30)
    assert sample.accel == (-200, 100, 8192)
    assert sample.accel[2] * sensor.accel_m_s2 == pytest.approx(9.80665)
    assert sample.temperature == pytest.approx(-1000 / 333.87 + 21.0)


def test_a_gyro_at_its_limit_gives_no_rate(bus: I2cBus, chip: MpuChip) -> None:
    sensor = Mpu(bus)
    sensor.set_up()
    chip.motion = (0, 0, 32_767)
    assert sensor.read().gyro is None


def test_a_sensor_that_lost_power_is_set_up_again(bus: I2cBus, chip: MpuChip) -> None:
    sampler = Sampler(Mpu(bus), 0.005, SteppedClock())
    assert sampler.step()
    chip.restart()
    assert not sampler.step()
    assert "lost power or fell asleep" in sampler.error
    assert [sampler.step() for _ in range(3)] == [False, False, True]


def test_a_sensor_that_wakes_up_by_itself_after_a_loss_of_power_is_not_believed(
    bus: I2cBus, chip: MpuChip
) -> None:
    """By its register map an MPU-9250 does, with ranges of 250 deg/s and 2 g."""
    chip.registers[0x75] = 0x71
    sampler = Sampler(Mpu(bus), 0.005, SteppedClock())
    assert sampler.step()
    chip.restart()
    chip.registers[0x6B] = 0x01
    assert [sampler.step() for _ in range(4)] == [False, False, False, True]
    assert sampler.newest is not None
    assert sampler.newest.number == 1


def test_a_frozen_sensor_is_noticed(bus: I2cBus, chip: MpuChip) -> None:
    sensor = Mpu(bus)
    sensor.set_up()
    chip.noise = False
    for _ in range(100):
        sensor.read()
    with pytest.raises(HardwareError, match="repeated one sample 100 times: it is frozen"):
        sensor.read()


def test_two_devices_share_the_bus(bus: I2cBus, kernel: FakeI2c) -> None:
    monitor_chip = Ina226Chip()
    kernel.chips[0x40] = monitor_chip
    sensor, monitor = Mpu(bus), Ina226(bus, shunt=0.005)
    sensor.set_up()
    monitor.set_up()
    monitor_chip.measure(6.5, 0.010)
    assert monitor.read().current == pytest.approx(2.0)
    assert sensor.read().gyro == (0, 0, 0)


def test_bias_is_the_mean_at_rest(bus: I2cBus, chip: MpuChip) -> None:
    sensor = Mpu(bus)
    sensor.set_up()
    chip.motion = (3, -4, 5)
    clock = SteppedClock()
    bias = measure_bias(sensor, samples=20, clock=clock)
    assert bias.rate == pytest.approx(tuple(each * sensor.gyro_rad_s for each in (3, -4, 5)))
    assert bias.std == (0.0, 0.0, 0.0)
    assert clock.now() == pytest.approx(19 * 0.005)


def test_bias_of_a_moving_robot_is_refused(bus: I2cBus, chip: MpuChip) -> None:
    sensor = Mpu(bus)
    sensor.set_up()

    def push(count: int) -> None:
        chip.motion = (0, 0, 500 * (count % 2))

    with pytest.raises(CalibrationError, match="keep the robot still"):
        measure_bias(sensor, samples=20, clock=SteppedClock(), progress=push)
    chip.motion = (0, 0, -32_768)
    with pytest.raises(CalibrationError, match="at its limit"):
        measure_bias(sensor, samples=20, clock=SteppedClock())


def test_words_and_their_scale_are_replaced_together(bus: I2cBus, chip: MpuChip) -> None:
    robot, sensor = standing(), Mpu(bus)
    sampler = Sampler(sensor, 0.004, SteppedClock())
    port = ImuPort(robot, sampler, sensor)
    assert isinstance(port, Port)
    chip.motion = (0, 0, 3277)
    sampler.step()
    inputs = port.read()
    assert inputs.device.name == "simulator+mpu6500"
    assert inputs.turn_rate == pytest.approx(math.radians(3277 / 32.768))
    assert inputs.accel is not None
    assert dict(inputs.extra or {}) == pytest.approx({"imu.temperature": 18.0048}, abs=1e-3)
    assert inputs.faults == ()
    assert port.read().device is inputs.device


def test_a_cycle_without_a_new_sample_has_no_words(bus: I2cBus) -> None:
    robot, sensor = standing(), Mpu(bus)
    sampler = Sampler(sensor, 0.004, SteppedClock())
    port = ImuPort(robot, sampler, sensor)
    sampler.step()
    port.read()
    inputs = port.read()
    assert inputs.gyro is None
    assert inputs.accel is None
    assert inputs.faults == ()


def test_a_lost_sensor_is_a_fault_and_not_the_controllers_gyro(bus: I2cBus, kernel: FakeI2c) -> None:
    robot, sensor = standing(), Mpu(bus)
    sampler = Sampler(sensor, 0.004, SteppedClock())
    port = ImuPort(robot, sampler, sensor)
    sampler.step()
    port.read()
    kernel.stuck = True
    for _ in range(21):
        sampler.step()
        inputs = port.read()
    assert inputs.faults == (Fault.SENSOR_LOST,)
    assert inputs.gyro is None
    kernel.stuck = False
    sampler.step()
    inputs = port.read()
    assert inputs.faults == ()
    assert inputs.gyro == (0, 0, 0)


def test_a_second_imu_leaves_the_controllers_words_alone(bus: I2cBus, chip: MpuChip) -> None:
    robot, sensor = standing(), Mpu(bus)
    sampler = Sampler(sensor, 0.004, SteppedClock())
    port = ImuPort(robot, sampler, sensor, replace_words=False)
    chip.motion, chip.noise = (0, 0, 100), False
    sampler.step()
    inputs = port.read()
    assert (inputs.gyro, inputs.device) == ((7, 7, 7), SIMULATOR)
    assert inputs.extra is not None
    assert set(inputs.extra) == {
        *(f"imu2.{kind}.{axis}" for kind in ("gyro", "accel") for axis in "xyz"),
        "imu2.temperature",
    }
    assert inputs.extra["imu2.gyro.z"] == pytest.approx(100 * sensor.gyro_rad_s)
    assert port.read().extra is None
    chip.motion = (0, 0, 32_767)
    sampler.step()
    limited = port.read().extra
    assert limited is not None
    assert "imu2.gyro.z" not in limited


def test_opening_reads_in_the_background_until_closed(kernel: FakeI2c, chip: MpuChip, tmp_path: Path) -> None:
    (tmp_path / "i2c-1").touch()
    robot = standing()
    port = open_imu(robot, str(tmp_path / "i2c-1"))
    port.write(STOP)
    port.close()
    port.close()
    assert robot.closed
    assert robot.written == [STOP]
    assert chip.registers[0x6B] == 0x01


@pytest.mark.parametrize("others", [0, 1])
def test_two_hundred_samples_a_second_on_the_slowest_bus(bus: I2cBus, kernel: FakeI2c, others: int) -> None:
    """At 100 kHz, the battery monitor on the same bus: each waits for the other's transfers."""
    kernel.chips[0x40] = Ina226Chip()
    clock = SteppedClock()
    imu, power = Sampler(Mpu(bus), IMU_PERIOD), Sampler(Ina226(bus, 0x40, shunt=0.005), POWER_PERIOD)
    assert imu.step()
    assert power.step()
    next_imu = next_power = clock.now()
    samples, end = 0, clock.now() + 2.0
    while clock.now() < end:
        kernel.bits = 0
        if others and clock.now() >= next_power:
            assert power.step()
            next_power += POWER_PERIOD
        elif clock.now() >= next_imu:
            assert imu.step()
            samples += 1
            next_imu = max(next_imu + IMU_PERIOD, clock.now())
        clock.advance(max(kernel.bits / 100_000, 1e-4))
    assert samples / 2.0 >= 200.0


def test_opening_a_missing_sensor_fails_at_once(kernel: FakeI2c, tmp_path: Path) -> None:
    (tmp_path / "i2c-1").touch()
    kernel.chips = {0x20: Chip()}
    with pytest.raises(HardwareError, match="address 0x69: no answer"):
        open_imu(standing(), str(tmp_path / "i2c-1"))
