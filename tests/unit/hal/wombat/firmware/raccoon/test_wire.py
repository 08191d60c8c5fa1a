"""What RaccoonOS says, byte for byte."""

import math

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.wombat.firmware.raccoon import wire

# The worked reply of the protocol's description, version 17.
REPLY = bytes.fromhex(
    "11 33 22 11 00 56 02 00 00 A6 FD FF FF 00 00 00"
    "00 03 00 00 00 A8 D8 01 00 34 2D FE FF 00 00 00"
    "00 0C 00 00 00 00 AD 0B B5 00 FF 0F 00 00 D2 04"
    "80 02 43 03 01 00 00 00 00 3F 00 00 80 BE 00 00"
    "34 42 03 00 00 00 00 00 00 00 3E 00 00 1D 41 03"
    "00 00 40 41 00 00 F4 C1 00 00 20 42 01 00 00 00"
    "00 00 00 00 00 00 00 00 00 03 00 00 00 00 00 00"
    "00 00 00 00 00 00 03 00 00 00 3F 00 00 00 00 00"
    "00 00 00 D7 B3 5D 3F 03 00 00 96 43 00 00 FC 41"
    "00 00 80 3E 00 00 00 BE 92 0A 86 3F 00 00 00 3F"
    "00 00 00 00 DB 0F 49 3F"
).ljust(248, b"\0")


def test_every_field_of_the_worked_reply() -> None:
    telemetry = wire.decode(REPLY, 17)
    assert telemetry.version == 17
    assert telemetry.update_time_us == 0x00112233
    # RaccoonOS's positive direction is the stock firmware's negative one.
    assert list(telemetry.bemf) == [-598, 602, 0, -3]
    assert list(telemetry.position) == [-121000, 119500, 0, -12]
    assert telemetry.done == (False, False, False, False)
    assert list(telemetry.analog) == [2989, 181, 4095, 0, 1234, 640]
    assert telemetry.battery == 835
    assert telemetry.digital_bits == 1
    assert telemetry.world_gyro_deg == (0.5, -0.25, 45.0)
    assert telemetry.world_accel == (0.0, 0.125, 9.8125)
    assert telemetry.compass == (12.0, -30.5, 40.0)
    assert telemetry.world_linear_accel == (0.0, 0.0, 0.0)
    assert telemetry.accel_velocity == (0.0, 0.0, 0.0)
    assert list(telemetry.accuracy) == [3, 3, 1, 3, 3, 3]
    assert telemetry.quaternion == pytest.approx((0.5, 0, 0, 0.8660254))
    assert telemetry.heading == pytest.approx(math.radians(60))
    assert telemetry.temperature == 31.5
    assert telemetry.odometry == pytest.approx((0.25, -0.125, 1.0471976, 0.5, 0.0, 0.7853982))


def test_inputs_of_the_worked_reply() -> None:
    readings = wire.inputs(wire.decode(REPLY, 17), 2.0)
    assert readings.time == 2.0
    assert list(readings.bemf) == [-598, 602, 0, -3]
    assert list(readings.position) == [-121000, 119500, 0, -12]
    assert readings.battery_voltage == pytest.approx(7.400, abs=0.001)
    assert readings.digital == (True, *(False,) * 9)
    assert readings.turn_rate == pytest.approx(math.radians(45))
    assert readings.extra == {"button": 0.0}
    # The quaternion is a turn to the left by 120 degrees: seen from the robot the world turns right.
    cos, sin = math.cos(math.radians(-120)), math.sin(math.radians(-120))
    assert readings.gyro == pytest.approx((0.5 * cos + 0.25 * sin, 0.5 * sin - 0.25 * cos, 45.0), abs=1e-6)
    assert readings.accel == pytest.approx((-0.125 * sin, 0.125 * cos, 9.8125), abs=1e-6)


def test_world_vectors_of_a_tilted_robot() -> None:
    # Nose down by 90 degrees: what points up in the world points to the tail of the robot.
    half = math.radians(90) / 2
    words = list(wire.decode(REPLY, 17).words)
    words[39:43] = (math.cos(half), 0.0, math.sin(half), 0.0)
    words[23:26] = (0.0, 0.0, 9.81)
    vectors = wire.body_vectors(tuple(words))
    assert vectors is not None
    assert vectors[1] == pytest.approx((-9.81, 0.0, 0.0), abs=1e-9)
    # A third of a turn about the diagonal, by a quaternion that is not quite a unit: its axes lie along the
    # world's next ones, forward along y, left along z, up along x.
    words[39:43] = (0.6, 0.6, 0.6, 0.6)
    words[19:22] = (1.0, 2.0, 3.0)
    vectors = wire.body_vectors(tuple(words))
    assert vectors is not None
    assert vectors[0] == pytest.approx((2.0, 3.0, 1.0))
    assert vectors[1] == pytest.approx((0.0, 9.81, 0.0), abs=1e-9)


def test_a_void_quaternion_means_no_imu() -> None:
    silent = REPLY[:119] + bytes(16) + REPLY[135:]
    readings = wire.inputs(wire.decode(silent, 17), 0.0)
    assert readings.gyro is None
    assert readings.accel is None


def test_the_button() -> None:
    pressed = bytearray(REPLY)
    pressed[53] = 0x04
    assert wire.inputs(wire.decode(bytes(pressed), 17), 0.0).extra == {"button": 1.0}


def test_version_21_shares_the_reply() -> None:
    newer = bytes((21,)) + REPLY[1:].ljust(276, b"\0")
    readings = wire.inputs(wire.decode(newer, 21), 0.0)
    assert list(readings.bemf) == [-598, 602, 0, -3]
    assert readings.device.position_counts_seconds == 1.0


def test_other_frames_are_refused() -> None:
    with pytest.raises(HardwareError, match="version 18: allowed are"):
        wire.decode(REPLY, 18)
    with pytest.raises(HardwareError, match="247 bytes"):
        wire.decode(REPLY[:247], 17)
    with pytest.raises(HardwareError, match="byte 0 of the frame is 0"):
        wire.decode(bytes(248), 17)


@pytest.mark.parametrize("index", [0, 1, 100, 200, 247])
def test_a_shift_is_found(index: int) -> None:
    stream = REPLY * 4
    assert wire.find_shift(stream[248 - index : 248 - index + 3 * 248], 17) == index


def test_no_shift_in_silence() -> None:
    assert wire.find_shift(bytes(600), 17) is None
