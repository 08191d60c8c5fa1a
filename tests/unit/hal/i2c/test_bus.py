"""The bus: errors with a remedy, the board's own addresses, two devices at once, the waiting thread."""

from __future__ import annotations

import contextlib
import errno
import threading
from pathlib import Path

import pytest

from i2c_fake import Chip, FakeI2c
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.hal.i2c import I2cBus, Sampler


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> FakeI2c:
    return FakeI2c({0x40: Chip(), 0x69: Chip()}).put_in(monkeypatch)


def test_registers_are_read_and_written(bus: I2cBus, kernel: FakeI2c) -> None:
    bus.write(0x69, 0x10, b"\x01\x02\x03")
    assert bus.read(0x69, 0x11, 2) == b"\x02\x03"
    assert kernel.chips[0x40].registers[0x10] == 0
    bus.close()
    bus.close()


@pytest.mark.parametrize("count", [0, 33])
def test_a_block_has_a_limit(bus: I2cBus, count: int) -> None:
    with pytest.raises(ValueError, match="allowed are 1 to 32 bytes"):
        bus.read(0x69, 0, count)
    bus.close()


def test_an_absent_device_is_named_with_what_to_check(bus: I2cBus) -> None:
    with pytest.raises(HardwareError, match=r"i2c-1, address 0x41: no answer; check power, SDA/SCL"):
        bus.read(0x41, 0, 1)
    with pytest.raises(HardwareError, match="no answer"):
        bus.write(0x41, 0, b"\x00")
    bus.close()


def test_one_refusal_is_an_error_and_the_next_transfer_works(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.chips[0x69].nacks = 1
    with pytest.raises(HardwareError, match="no answer"):
        bus.read(0x69, 0, 1)
    assert bus.read(0x69, 0, 1) == b"\x00"
    bus.close()


def test_an_answer_that_is_too_short_is_an_error(tmp_path: Path) -> None:
    class Short:
        def read_i2c_block_data(self, _address: int, _register: int, count: int) -> list[int]:
            return [0] * (count - 1)

    bus = I2cBus(str(tmp_path), opener=lambda _: Short())  # type: ignore[arg-type, return-value]
    with pytest.raises(HardwareError, match="address 0x69: 13 bytes of 14 came back"):
        bus.read(0x69, 0, 14)


def test_a_stuck_bus_is_told_from_an_absent_device(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.stuck = True
    with pytest.raises(HardwareError, match="the bus is stuck or disturbed; check for a short"):
        bus.read(0x69, 0, 1)
    with pytest.raises(HardwareError, match="stuck"):
        bus.scan()
    bus.close()


def test_a_device_of_the_kernel_is_left_alone(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.drivers.add(0x69)
    with pytest.raises(HardwareError, match="belongs to a driver of the operating system"):
        bus.read(0x69, 0, 1)
    assert kernel.transfers == 0
    bus.close()


def test_scan_tells_devices_drivers_and_the_board_apart(bus: I2cBus, kernel: FakeI2c) -> None:
    kernel.chips[0x50] = Chip()
    kernel.drivers |= {0x68, 0x20}
    assert bus.scan() == {
        0x20: "kernel driver",
        0x40: "device",
        0x50: "the EEPROM AT24CS01",
        0x68: "the clock DS1340",
        0x69: "device",
    }
    bus.close()


@pytest.mark.parametrize(
    ("address", "message"),
    [
        (0x68, r"a gyro at 0x68: the clock DS1340 is there already; strap the device"),
        (0x48, "the touch controller TSC2007"),
        (0x50, "the EEPROM"),
        (0x58, "the serial number"),
        (0x07, "allowed are the addresses 0x08 to 0x77"),
        (0x78, "allowed are the addresses 0x08 to 0x77"),
    ],
)
def test_addresses_of_the_board_are_refused(bus: I2cBus, address: int, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        bus.claim(address, "a gyro")
    bus.close()


def test_another_computer_has_other_reservations(kernel: FakeI2c, tmp_path: Path) -> None:
    (tmp_path / "i2c-3").touch()
    free = I2cBus(str(tmp_path / "i2c-3"), reserved={})
    free.claim(0x68, "a gyro")
    free.close()


def test_a_missing_bus_says_how_to_switch_it_on(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"i2c-9: there is no such bus; switch it on"):
        I2cBus(str(tmp_path / "i2c-9"))


def test_a_forbidden_bus_names_the_group() -> None:
    def forbidden(path: str) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", path)

    with pytest.raises(HardwareError, match=r"I2C bus /dev/i2c-1: permission denied; add the user to the"):
        I2cBus(1, opener=forbidden)  # type: ignore[arg-type]


def test_a_closed_bus_says_so(bus: I2cBus) -> None:
    bus.close()
    with pytest.raises(HardwareError, match="is closed"):
        bus.read(0x69, 0, 1)


def test_two_threads_never_exchange_their_chips(bus: I2cBus, kernel: FakeI2c) -> None:
    # smbus2 chooses a chip in one call and talks to it in the next. Both threads meet between the two, if
    # they can.
    meeting = threading.Barrier(2)

    def meet() -> None:
        with contextlib.suppress(threading.BrokenBarrierError):
            meeting.wait(0.05)

    kernel.chips[0x40].registers[0] = 0x40
    kernel.chips[0x69].registers[0] = 0x69
    kernel.on_select = meet
    found: dict[int, bytes] = {}

    def ask(address: int) -> None:
        found[address] = bus.read(address, 0, 1)

    threads = [threading.Thread(target=ask, args=(address,)) for address in (0x40, 0x69)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {0x40: b"\x40", 0x69: b"\x69"}
    bus.close()


class Counter:
    """A sensor that counts its readings and fails when told to."""

    def __init__(self) -> None:
        self.setups = 0
        self.reads = 0
        self.broken = False
        self.read_twice = threading.Event()

    def set_up(self) -> None:
        self.setups += 1
        if self.broken:
            raise HardwareError("no answer")

    def read(self) -> int:
        if self.broken:
            raise HardwareError("no answer")
        self.reads += 1
        if self.reads >= 2:
            self.read_twice.set()
        return self.reads


def test_samples_are_numbered_and_the_newest_is_kept() -> None:
    sampler = Sampler(Counter(), 0.005, SteppedClock())
    before = sampler.newest
    assert [sampler.step(), sampler.step()] == [True, True]
    after = sampler.newest
    assert before is None
    assert after is not None
    assert (after.number, after.value) == (1, 2)
    sampler.close()


def test_a_sensor_is_set_up_again_after_three_failures_and_recovers() -> None:
    sensor = Counter()
    sampler = Sampler(sensor, 0.005, SteppedClock())
    sampler.step()
    sensor.broken = True
    assert [sampler.step() for _ in range(4)] == [False] * 4
    assert sensor.setups == 2  # the fourth failure is that of the second set-up
    assert sampler.error == "no answer"
    sensor.broken = False
    assert sampler.step()
    assert sampler.error == ""
    assert sampler.newest is not None
    assert sampler.newest.number == 1


def test_the_thread_reads_by_itself_and_ends_when_closed() -> None:
    sensor = Counter()
    closed = []
    sampler = Sampler(sensor, 0.001, on_close=lambda: closed.append(True))
    sampler.start()
    assert sensor.read_twice.wait(5.0)
    sampler.close()
    sampler.close()
    assert closed == [True]
    assert not any(thread.name == "raccoon-i2c" for thread in threading.enumerate())


def test_closing_does_not_wait_for_a_stuck_transfer() -> None:
    release = threading.Event()
    entered = threading.Event()

    class Stuck(Counter):
        def read(self) -> int:
            entered.set()
            release.wait(10.0)
            raise HardwareError("timed out")

    sampler = Sampler(Stuck(), 0.001)
    sampler.start()
    assert entered.wait(5.0)
    assert sampler.newest is None  # handed over at once, whatever the bus does
    sampler.close()
    release.set()
