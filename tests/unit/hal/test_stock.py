"""The stock frame, byte for byte."""

import pytest

from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat import stock, stock_command

# The worked reply of the protocol's description.
REPLY = bytes.fromhex(
    "4A 00 08 20 01 00 00 00 00 00 00 0B AD 00 B5 0F"
    "FF 00 00 04 D2 02 80 00 FF 88 00 FA FE 66 00 40"
    "FF A0 E0 00 00 10 FF DF 02 E2 00 05 B8 D8 FF FD"
    "23 94 00 00 00 00 00 00 0B B8 41 81 00 F0 03 20"
    "00 00 00 00 FD 12 00 E7 00 00 00 00 00 D6 05 DC"
    "05 DC 05 DC 05 DC 02 EC 00"
)


def padded(start: str) -> bytes:
    return bytes.fromhex(start).ljust(88, b"\0") + b"\x53"


def test_every_register_of_the_worked_reply() -> None:
    registers = stock.decode(REPLY)
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
    readings = stock.inputs(stock.decode(REPLY), 1.5)
    assert readings.time == 1.5
    assert list(readings.position) == [1500, -750, 12, 0]
    assert list(readings.bemf) == [None, None, None, None]
    assert list(readings.analog) == [2989, 181, 4095, 0, 1234, 640]
    assert readings.digital == (True, *(False,) * 9)
    assert readings.battery_voltage == pytest.approx(6.629, abs=0.001)
    # Chip z points down: 45 deg/s about it is clockwise from above, and its -1 g is +1 g up.
    assert readings.turn_rate == pytest.approx(-0.7854, abs=0.001)
    assert readings.accel is not None
    assert list(readings.accel) == [-96, 64, 8192]
    assert readings.accel[2] * readings.device.accel_m_s2 == pytest.approx(9.80665)
    assert readings.extra == {"button": 0.0}


def test_the_button_is_pressed_when_its_bit_is_clear() -> None:
    pressed = bytearray(REPLY)
    pressed[3] = 0
    assert stock.inputs(stock.decode(bytes(pressed)), 0.0).extra == {"button": 1.0}


def test_words_without_news_are_none() -> None:
    assert stock.inputs(stock.decode(REPLY), 0.0, imu=False).gyro is None


@pytest.mark.parametrize(
    ("pairs", "sequence", "expected"),
    [
        pytest.param([], 1, "4A 04 01 00", id="read all"),
        pytest.param(
            [
                *stock_command.speed_goal(0, 800),
                *stock_command.speed_goal(2, -750),
                *stock_command.modes((1, 0, 1, 0)),
            ],
            2,
            "4A 04 02 05 3E 03 3F 20 44 FD 45 12 3A 41",
            id="two speeds",
        ),
        pytest.param(
            [
                *stock_command.duty_register(1, 200),
                *stock_command.modes((1, 0, 1, 0)),
                *stock_command.directions((1, 2, 2, 0)),
            ],
            3,
            "4A 04 03 04 48 00 49 C8 3A 41 3B 89",
            id="motor 1 at half power backwards",
        ),
        pytest.param(
            stock_command.clear_position(3), 4, "4A 04 04 04 32 00 33 00 34 00 35 00", id="clear position"
        ),
        pytest.param(
            [
                *stock_command.position_goal(0, 3000),
                *stock_command.speed_goal(0, 900),
                *stock_command.modes((2, 0, 1, 0)),
            ],
            5,
            "4A 04 05 07 89 00 8A 0B 8B 71 8C B0 3E 03 3F 84 3A 42",
            id="move to position",
        ),
        pytest.param(
            stock_command.stop(),
            6,
            "4A 04 06 0B 3A 00 3B 00 46 00 47 00 48 00 49 00 4A 00 4B 00 4C 00 4D 00 3D F0",
            id="stop everything",
        ),
        pytest.param(stock_command.canary(), 7, "4A 04 07 01 17 40", id="canary"),
    ],
)
def test_worked_commands(pairs: list[tuple[int, int]], sequence: int, expected: str) -> None:
    assert stock_command.frame(pairs, sequence) == padded(expected)


def registers_written(frame: bytes) -> dict[int, int]:
    body = frame[4 : 4 + 2 * frame[3]]
    return dict(zip(body[::2], body[1::2], strict=True))


def test_outputs_become_the_complete_image() -> None:
    outputs = Outputs(
        duty=(0.5, -1.0, 0.0, 0.25), brake=(False, False, True, False), servo_us=(None, 600, None, 2400)
    )
    frame = stock_command.encode(outputs, 258)
    assert frame[:3] == bytes((0x4A, 4, 2))
    assert frame[88] == 0x53
    written = registers_written(frame)
    assert set(written) == set(stock_command.IMAGE)
    pwm = [written[70 + 2 * channel] << 8 | written[71 + 2 * channel] for channel in range(4)]
    assert pwm == [200, 400, 100, 400]  # motor port 2 is channel 3
    assert written[59] == 0b11_01_10_01
    assert written[58] == 0
    assert written[61] == 0b0101_0000
    assert [written[78 + 2 * n] << 8 | written[79 + 2 * n] for n in range(4)] == [1500, 600, 1500, 2400]
    assert written[23] == 0x42  # the canary counts the frames


def test_stop_coasts_and_switches_the_servos_off() -> None:
    written = registers_written(stock_command.encode(STOP))
    assert written[59] == 0
    assert all(written[address] == 0 for address in range(70, 78))
    assert written[61] == 0xF0


def test_a_duty_too_small_for_one_step_is_zero() -> None:
    tiny = Outputs(duty=(0.001, 0.0, 0.0, 0.0), brake=(True, False, False, False))
    assert registers_written(stock_command.encode(tiny))[59] == 0b11


def test_holds_compares_with_the_registers_of_the_next_reply() -> None:
    sent = stock_command.encode(Outputs(duty=(0.3, 0.0, 0.0, -0.7)))
    reply = bytearray(89)
    for address, value in registers_written(sent).items():
        reply[address] = value
    assert stock_command.holds(bytes(reply), sent)
    reply[stock.PWM + 1] ^= 1
    assert not stock_command.holds(bytes(reply), sent)


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
        stock_command.frame(pairs)


def test_goals_beyond_their_range_are_refused() -> None:
    with pytest.raises(ConfigError, match="speed of motor 1 is 1501"):
        stock_command.speed_goal(1, 1501)
    with pytest.raises(ConfigError, match="PWM of motor 0 is 401"):
        stock_command.duty_register(0, 401)
    with pytest.raises(ConfigError, match="does not fit"):
        stock_command.position_goal(0, 1 << 30)


def test_other_frames_are_refused() -> None:
    with pytest.raises(HardwareError, match="88 bytes"):
        stock.decode(REPLY[:88])
    with pytest.raises(HardwareError, match="byte 0 of the frame is 0x00"):
        stock.decode(b"\0" + REPLY[1:])


@pytest.mark.parametrize("index", [0, 1, 44, 87, 88])
def test_a_shift_is_found(index: int) -> None:
    rotated = REPLY[89 - index :] + REPLY[: 89 - index]
    assert stock.shift(rotated) == index


def test_no_shift_in_silence() -> None:
    assert stock.shift(bytes(89)) is None
