"""The RaccoonOS frame, byte for byte."""

import math
import struct

import pytest

from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat import raccoon, raccoon_command
from raccoon.hal.wombat.raccoon_command import (
    Command,
    Kinematics,
    Mode,
    MotorPid,
    ServoMode,
    Shutdown,
    Update,
)

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
    telemetry = raccoon.decode(REPLY, 17)
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
    readings = raccoon.inputs(raccoon.decode(REPLY, 17), 2.0)
    assert readings.time == 2.0
    assert list(readings.bemf) == [-598, 602, 0, -3]
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
    words = list(raccoon.decode(REPLY, 17).words)
    words[39:43] = (math.cos(half), 0.0, math.sin(half), 0.0)
    words[23:26] = (0.0, 0.0, 9.81)
    vectors = raccoon.body_vectors(tuple(words))
    assert vectors is not None
    assert vectors[1] == pytest.approx((-9.81, 0.0, 0.0), abs=1e-9)


def test_a_void_quaternion_means_no_imu() -> None:
    silent = REPLY[:119] + bytes(16) + REPLY[135:]
    readings = raccoon.inputs(raccoon.decode(silent, 17), 0.0)
    assert readings.gyro is None
    assert readings.accel is None


def test_the_button() -> None:
    pressed = bytearray(REPLY)
    pressed[53] = 0x04
    assert raccoon.inputs(raccoon.decode(bytes(pressed), 17), 0.0).extra == {"button": 1.0}


def test_version_21_shares_the_reply() -> None:
    newer = bytes((21,)) + REPLY[1:].ljust(276, b"\0")
    readings = raccoon.inputs(raccoon.decode(newer, 21), 0.0)
    assert list(readings.bemf) == [-598, 602, 0, -3]
    assert readings.device.position_counts_seconds == 1.0


def test_worked_speed_command() -> None:
    # On the wire motor 0 runs at +600: the shared direction is the opposite one.
    command = Command(
        modes=(Mode.SPEED, Mode.SPEED, Mode.OFF, Mode.OFF),
        targets=(-600, 600, 0, 0),
        servo_modes=(ServoMode.ENABLED, ServoMode.OFF, ServoMode.OFF, ServoMode.OFF),
        servo_us=(1500, 0, 0, 0),
    )
    start = bytes.fromhex("11 00 00 00 00 00 1B 00 58 02 00 00 A8 FD FF FF") + bytes(25)
    expected = (start + bytes.fromhex("02 DC 05")).ljust(248, b"\0")
    assert raccoon_command.encode_command(command, 17) == expected


def test_worked_position_reset() -> None:
    frame = bytearray(248)
    frame[0], frame[1], frame[40] = 0x11, 0x40, 0x03
    command = Command(updates=Update.POSITION_RESET, position_reset=0b0011)
    assert raccoon_command.encode_command(command, 17) == bytes(frame)


def test_worked_shutdown() -> None:
    frame = bytearray(248)
    frame[0], frame[5] = 0x11, 0x03
    assert raccoon_command.stop(17) == bytes(frame)


def test_worked_chassis_command() -> None:
    command = Command(modes=(Mode.CHASSIS,) * 4, chassis_velocity=(0.25, 0.0, 0.5))
    start = bytes.fromhex("15 00 00 00 00 00 6D 0B") + bytes(16)
    expected = (start + bytes.fromhex("00 00 80 3E 00 00 00 00 00 00 00 3F")).ljust(277, b"\0")
    assert raccoon_command.encode_command(command, 21) == expected


FULL = Command(
    updates=Update.VELOCITY_PID | Update.KINEMATICS,
    shutdown=Shutdown.SERVOS,
    modes=(Mode.OFF, Mode.BRAKE, Mode.PWM, Mode.POSITION),
    targets=(1, 2, 3, 4),
    goals=(-5, 6, 7, 8),
    position_reset=9,
    servo_modes=(ServoMode.DISABLED, ServoMode.OFF, ServoMode.ENABLED, ServoMode.OFF),
    servo_us=(600, 700, 800, 2400),
    pid=MotorPid((-1.0, 1.0, -2.0, 2.0), 0.5, tuple((n + 0.1, n + 0.2, n + 0.3) for n in range(4))),  # type: ignore[arg-type]
    gyro_orientation=(0, 1, 0, -1, 0, 0, 0, 0, -1),
    compass_orientation=(1, 0, 0, 0, -1, 0, 0, 0, 1),
    kinematics=Kinematics(
        tuple(range(12)), (0.1, 0.2, 0.3, 0.4), forward=tuple(float(n) for n in range(20, 32))
    ),
)


@pytest.mark.parametrize(
    ("offset_17", "offset_21", "form", "values"),
    [
        (1, 1, "I", (0x11,)),
        (5, 5, "B", (1,)),
        (6, 6, "H", (1 << 3 | 2 << 6 | 4 << 9,)),
        (8, 8, "4i", (-1, -2, -3, -4)),
        (24, 36, "4i", (5, -6, -7, -8)),
        (40, 52, "B", (9,)),
        (41, 53, "B", (1 | 2 << 4,)),
        (42, 54, "4H", (600, 700, 800, 2400)),
        (50, 62, "5f", (-1.0, 1.0, -2.0, 2.0, 0.5)),
        (70, 82, "3f", (0.1, 0.2, 0.3)),
        (106, 118, "3f", (3.1, 3.2, 3.3)),
        (118, 130, "9b", (0, 1, 0, -1, 0, 0, 0, 0, -1)),
        (127, 139, "9b", (1, 0, 0, 0, -1, 0, 0, 0, 1)),
        (136, 148, "12f", tuple(range(12))),
        (184, 196, "4f", (0.1, 0.2, 0.3, 0.4)),
        (200, 228, "12f", tuple(range(20, 32))),
    ],
)
def test_every_field_of_a_command_lies_where_it_must(
    offset_17: int, offset_21: int, form: str, values: tuple[float, ...]
) -> None:
    for version, offset in ((17, offset_17), (21, offset_21)):
        frame = raccoon_command.encode_command(FULL, version)
        assert struct.unpack_from("<" + form, frame, offset) == pytest.approx(values)


def test_fields_of_version_21_alone() -> None:
    command = Command(kinematics=Kinematics(bemf_offset=(7.5, -20.0, 0.0, 1.0)), disable_bemf=True)
    frame = raccoon_command.encode_command(command, 21)
    assert struct.unpack_from("<4f", frame, 212) == (7.5, -20.0, 0.0, 1.0)
    assert frame[276] == 1
    for each in (command, Command(disable_bemf=True), Command(modes=(Mode.CHASSIS,) * 4)):
        with pytest.raises(ConfigError, match="version 17 has no such fields"):
            raccoon_command.encode_command(each, 17)


@pytest.mark.parametrize("version", [17, 21])
def test_outputs_are_the_same_frame_as_the_full_command(version: int) -> None:
    outputs = Outputs(
        duty=(0.5, -1.0, 0.0, 0.0), brake=(True, False, True, False), servo_us=(None, 600, None, None)
    )
    command = Command(
        modes=(Mode.PWM, Mode.PWM, Mode.BRAKE, Mode.OFF),
        targets=(200, -400, 0, 0),
        servo_modes=(ServoMode.OFF, ServoMode.ENABLED, ServoMode.OFF, ServoMode.OFF),
        servo_us=(0, 600, 0, 0),
    )
    assert raccoon_command.encode(outputs, version) == raccoon_command.encode_command(command, version)
    assert raccoon_command.encode(STOP, version) == raccoon_command.encode_command(Command(), version)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="does not fit"):
        raccoon_command.encode_command(Command(servo_us=(70000, 0, 0, 0)), 17)
    with pytest.raises(ConfigError, match="version 18"):
        raccoon_command.encode_command(Command(), 18)


def test_other_frames_are_refused() -> None:
    with pytest.raises(HardwareError, match="version 18: allowed are"):
        raccoon.decode(REPLY, 18)
    with pytest.raises(HardwareError, match="247 bytes"):
        raccoon.decode(REPLY[:247], 17)
    with pytest.raises(HardwareError, match="byte 0 of the frame is 0"):
        raccoon.decode(bytes(248), 17)


@pytest.mark.parametrize("index", [0, 1, 100, 200, 247])
def test_a_shift_is_found(index: int) -> None:
    stream = REPLY * 4
    assert raccoon.shift(stream[248 - index : 248 - index + 3 * 248], 17) == index


def test_no_shift_in_silence() -> None:
    assert raccoon.shift(bytes(600), 17) is None
