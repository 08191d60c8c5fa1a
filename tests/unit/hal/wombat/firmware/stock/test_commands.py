"""What the stock firmware is told, byte for byte."""

import pytest

from raccoon.core.errors import ConfigError
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat.firmware.stock import commands, wire


def padded(start: str) -> bytes:
    return bytes.fromhex(start).ljust(88, b"\0") + b"\x53"


@pytest.mark.parametrize(
    ("pairs", "sequence", "expected"),
    [
        pytest.param([], 1, "4A 04 01 00", id="read all"),
        pytest.param(
            [
                *commands.speed_goal(0, 800),
                *commands.speed_goal(2, -750),
                *commands.modes((1, 0, 1, 0)),
            ],
            2,
            "4A 04 02 05 3E 03 3F 20 44 FD 45 12 3A 41",
            id="two speeds",
        ),
        pytest.param(
            [
                *commands.duty_register(1, 200),
                *commands.modes((1, 0, 1, 0)),
                *commands.directions((1, 2, 2, 0)),
            ],
            3,
            "4A 04 03 04 48 00 49 C8 3A 41 3B 89",
            id="motor 1 at half power backwards",
        ),
        pytest.param(
            commands.clear_position(3), 4, "4A 04 04 04 32 00 33 00 34 00 35 00", id="clear position"
        ),
        pytest.param(
            [
                *commands.position_goal(0, 3000),
                *commands.speed_goal(0, 900),
                *commands.modes((2, 0, 1, 0)),
            ],
            5,
            "4A 04 05 07 89 00 8A 0B 8B 71 8C B0 3E 03 3F 84 3A 42",
            id="move to position",
        ),
        pytest.param(
            commands.stop(),
            6,
            "4A 04 06 0B 3A 00 3B 00 46 00 47 00 48 00 49 00 4A 00 4B 00 4C 00 4D 00 3D F0",
            id="stop everything",
        ),
        pytest.param(commands.canary(), 7, "4A 04 07 01 17 40", id="canary"),
    ],
)
def test_worked_commands(pairs: list[tuple[int, int]], sequence: int, expected: str) -> None:
    assert commands.frame(pairs, sequence) == padded(expected)


def registers_written(frame: bytes) -> dict[int, int]:
    body = frame[4 : 4 + 2 * frame[3]]
    return dict(zip(body[::2], body[1::2], strict=True))


def test_outputs_become_the_complete_image() -> None:
    outputs = Outputs(
        duty=(0.5, -1.0, 0.0, 0.25), brake=(False, False, True, False), servo_us=(None, 600, None, 2400)
    )
    frame = commands.encode(outputs, 258)
    assert frame[:3] == bytes((0x4A, 4, 2))
    assert frame[88] == 0x53
    written = registers_written(frame)
    assert set(written) == set(commands.IMAGE)
    pwm = [written[70 + 2 * channel] << 8 | written[71 + 2 * channel] for channel in range(4)]
    assert pwm == [200, 400, 100, 400]  # motor port 2 is channel 3
    assert written[59] == 0b11_01_10_01
    assert written[58] == 0
    assert written[61] == 0b0101_0000
    assert [written[78 + 2 * n] << 8 | written[79 + 2 * n] for n in range(4)] == [1500, 600, 1500, 2400]
    assert written[23] == 0x42  # the canary counts the frames


def test_stop_coasts_and_switches_the_servos_off() -> None:
    written = registers_written(commands.encode(STOP))
    assert written[59] == 0
    assert all(written[address] == 0 for address in range(70, 78))
    assert written[61] == 0xF0


def test_a_duty_too_small_for_one_step_is_zero() -> None:
    tiny = Outputs(duty=(0.001, 0.0, 0.0, 0.0), brake=(True, False, False, False))
    assert registers_written(commands.encode(tiny))[59] == 0b11


def test_holds_compares_with_the_registers_of_the_next_reply() -> None:
    sent = commands.encode(Outputs(duty=(0.3, 0.0, 0.0, -0.7)))
    reply = bytearray(89)
    for address, value in registers_written(sent).items():
        reply[address] = value
    assert commands.shows_command(bytes(reply), sent)
    reply[wire.PWM + 1] ^= 1
    assert not commands.shows_command(bytes(reply), sent)


@pytest.mark.parametrize(
    ("pairs", "complaint"),
    [
        ([(2, 0)], "register 2"),
        ([(153, 0)], "register 153"),
        ([(60, 256)], "value 256"),
        ([(60, 0)] * 43, "43 pairs"),
    ],
)
def test_dangerous_frames_are_refused(pairs: list[tuple[int, int]], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        commands.frame(pairs)


def test_goals_beyond_their_range_are_refused() -> None:
    with pytest.raises(ConfigError, match="speed of motor 1 is 1501"):
        commands.speed_goal(1, 1501)
    with pytest.raises(ConfigError, match="PWM of motor 0 is 401"):
        commands.duty_register(0, 401)
    with pytest.raises(ConfigError, match="does not fit"):
        commands.position_goal(0, 1 << 30)
