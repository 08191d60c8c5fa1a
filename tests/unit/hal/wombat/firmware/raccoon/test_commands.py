"""What RaccoonOS is told, byte for byte."""

import struct

import pytest

from raccoon.core.errors import ConfigError
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat.firmware.raccoon import commands
from raccoon.hal.wombat.firmware.raccoon.commands import (
    Command,
    Kinematics,
    Mode,
    MotorPid,
    ServoMode,
    Shutdown,
    Update,
)


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
    assert commands.encode_command(command, 17) == expected


def test_worked_position_reset() -> None:
    frame = bytearray(248)
    frame[0], frame[1], frame[40] = 0x11, 0x40, 0x03
    command = Command(updates=Update.POSITION_RESET, position_reset=0b0011)
    assert commands.encode_command(command, 17) == bytes(frame)


def test_worked_shutdown() -> None:
    frame = bytearray(248)
    frame[0], frame[5] = 0x11, 0x03
    assert commands.stop(17) == bytes(frame)


def test_worked_chassis_command() -> None:
    command = Command(modes=(Mode.CHASSIS,) * 4, chassis_velocity=(0.25, 0.0, 0.5))
    start = bytes.fromhex("15 00 00 00 00 00 6D 0B") + bytes(16)
    expected = (start + bytes.fromhex("00 00 80 3E 00 00 00 00 00 00 00 3F")).ljust(277, b"\0")
    assert commands.encode_command(command, 21) == expected


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
        frame = commands.encode_command(FULL, version)
        assert struct.unpack_from("<" + form, frame, offset) == pytest.approx(values)


def test_fields_of_version_21_alone() -> None:
    command = Command(kinematics=Kinematics(bemf_offset=(7.5, -20.0, 0.0, 1.0)), disable_bemf=True)
    frame = commands.encode_command(command, 21)
    assert struct.unpack_from("<4f", frame, 212) == (7.5, -20.0, 0.0, 1.0)
    assert frame[276] == 1
    moving = Command(chassis_velocity=(0.0, 0.0, 0.5))
    for each in (command, moving, Command(disable_bemf=True), Command(modes=(Mode.CHASSIS,) * 4)):
        with pytest.raises(ConfigError, match="version 17 has no such fields"):
            commands.encode_command(each, 17)


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
    assert commands.encode(outputs, version) == commands.encode_command(command, version)
    assert commands.encode(STOP, version) == commands.encode_command(Command(), version)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="does not fit"):
        commands.encode_command(Command(servo_us=(70000, 0, 0, 0)), 17)
    with pytest.raises(ConfigError, match="version 18"):
        commands.encode_command(Command(), 18)


@pytest.mark.parametrize("version", [17, 21])
@pytest.mark.parametrize("port", range(4))
def test_a_brake_is_that_of_its_own_motor(port: int, version: int) -> None:
    brake = tuple(each == port for each in range(4))
    modes = struct.unpack_from("<H", commands.encode(Outputs(brake=brake), version), 6)[0]
    assert modes == Mode.BRAKE << 3 * port
    driven = Outputs(duty=tuple(0.5 * each for each in brake), brake=(True,) * 4)
    modes = struct.unpack_from("<H", commands.encode(driven, version), 6)[0]
    assert [modes >> 3 * each & 7 for each in range(4)] == [
        Mode.PWM if each == port else Mode.BRAKE for each in range(4)
    ]
