"""What the stock firmware says, byte for byte."""

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.firmware.stock import wire

# The worked reply of the protocol's description.
REPLY = bytes.fromhex(
    "4A 00 08 20 01 00 00 00 00 00 00 0B AD 00 B5 0F"
    "FF 00 00 04 D2 02 80 00 FF 88 00 FA FE 66 00 40"
    "FF A0 E0 00 00 10 FF DF 02 E2 00 05 B8 D8 FF FD"
    "23 94 00 00 00 00 00 00 0B B8 41 81 00 F0 03 20"
    "00 00 00 00 FD 12 00 E7 00 00 00 00 00 D6 05 DC"
    "05 DC 05 DC 05 DC 02 EC 00"
)


def test_every_register_of_the_worked_reply() -> None:
    registers = wire.decode(REPLY)
    assert registers.version == 8
    assert registers.digital_bits == 0x2001
    assert registers.digital_output_bits == 0
    assert registers.digital_pull_down_bits == 0
    assert registers.digital_output_enable_bits == 0
    assert registers.analog == (2989, 181, 4095, 0, 1234, 640)
    assert registers.canary == 0
    assert registers.mag == (-120, 250, -410)
    assert registers.chip_accel == (64, -96, -8192)
    assert registers.chip_gyro == (16, -33, 738)
    assert registers.position == (1500 * 250, -750 * 250, 12 * 250, 0)
    assert registers.modes == (1, 0, 1, 0)
    assert registers.directions == (1, 0, 2, 0)
    assert registers.done == (False, False, False, False)
    assert registers.allstop == 0xF0
    assert registers.speed_goals == (800, 0, -750, 0)
    assert registers.pwm == (231, 0, 214, 0)
    assert registers.servo_us == (1500, 1500, 1500, 1500)
    assert registers.battery == 748
    assert registers.buttons == 0


def test_inputs_of_the_worked_reply() -> None:
    readings = wire.inputs(wire.decode(REPLY), 1.5)
    assert readings.time == 1.5
    assert list(readings.position) == [1500, -750, 12, 0]
    assert list(readings.bemf) == [None, None, None, None]
    assert list(readings.analog) == [2989, 181, 4095, 0, 1234, 640]
    assert readings.digital == (True, *(False,) * 9)
    assert readings.battery_voltage == pytest.approx(6.629, abs=0.001)
    # Chip z points down: 45 deg/s about it is clockwise from above, and its -1 g is +1 g up.
    assert readings.turn_rate == pytest.approx(-0.7854, abs=0.001)
    assert readings.accel is not None
    assert readings.gyro is not None
    assert list(readings.gyro) == [-33, 16, -738]
    assert list(readings.accel) == [-96, 64, 8192]
    assert readings.accel[2] * readings.device.accel_m_s2 == pytest.approx(9.80665)
    assert readings.extra == {"button": 0.0}


def test_the_button_is_pressed_when_its_bit_is_clear() -> None:
    pressed = bytearray(REPLY)
    pressed[3] = 0
    assert wire.inputs(wire.decode(bytes(pressed)), 0.0).extra == {"button": 1.0}


def test_words_without_news_are_none() -> None:
    assert wire.inputs(wire.decode(REPLY), 0.0, imu=False).gyro is None


def test_other_frames_are_refused() -> None:
    with pytest.raises(HardwareError, match="88 bytes"):
        wire.decode(REPLY[:88])
    with pytest.raises(HardwareError, match="byte 0 of the frame is 0x00"):
        wire.decode(b"\0" + REPLY[1:])


@pytest.mark.parametrize("index", [0, 1, 44, 87, 88])
def test_a_shift_is_found(index: int) -> None:
    rotated = REPLY[89 - index :] + REPLY[: 89 - index]
    assert wire.find_shift(rotated) == index


def test_no_shift_in_silence() -> None:
    assert wire.find_shift(bytes(89)) is None
