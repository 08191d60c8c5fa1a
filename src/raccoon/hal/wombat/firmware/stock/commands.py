"""Commands to the Wombat's stock firmware: (register, value) pairs in an 89-byte frame.

All pairs of a frame take effect together, in their order. A mode is written last: otherwise the firmware
would run towards the previous goal.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from operator import itemgetter

from raccoon.core.errors import ConfigError
from raccoon.core.readings import MOTOR_PORTS, SERVO_PORTS, STOP, Outputs
from raccoon.hal.wombat.firmware.stock import wire
from raccoon.hal.wombat.firmware.stock.wire import CHANNEL, LENGTH

PROTOCOL_VERSION = 4
END = 0x53
MAX_PAIRS = 42
FULL_PWM = 400
MAX_SPEED = 1500
"""Limit of a speed goal, counts."""
CANARY = 0x40
"""Mark in a register without electrical effect; if it is gone, the controller has restarted. The six bits
below it count the frames, which shows that each of them has arrived."""
SERVOS_OFF = 0xF0
LATCHED_STOP = 0xFF
SERVO_BOOT_US = 1500

READ = bytes(LENGTH)
"""A frame of zeros, which reads everything and changes nothing."""

Pair = tuple[int, int]


class Mode(IntEnum):
    """Mode of a motor; two bits a channel."""

    PWM = 0
    SPEED = 1
    POSITION = 2
    POSITION_RELATIVE = 3


class Direction(IntEnum):
    """State of the two inputs of a motor driver; two bits a channel."""

    COAST = 0
    FORWARD = 1
    REVERSE = 2
    BRAKE = 3


def frame(pairs: Iterable[Pair], sequence: int = 0) -> bytes:
    """A frame that writes these registers, in this order.

    Raises ConfigError for more than 42 pairs, for a register that must not be written (the firmware does not
    check: writing 0 to 2 would break the link, and 153 and above are outside its registers) and for a value
    that is no byte.
    """
    body = bytearray()
    for register, value in pairs:
        if not 3 <= register < wire.REGISTERS:
            raise ConfigError(f"register {register}: allowed are 3 to {wire.REGISTERS - 1}")
        if not 0 <= value <= 255:
            raise ConfigError(f"value {value} for register {register}: allowed are 0 to 255")
        body += bytes((register, value))
    if len(body) > 2 * MAX_PAIRS:
        raise ConfigError(f"{len(body) // 2} pairs in one frame: {MAX_PAIRS} fit")
    return _close(bytes((wire.START, PROTOCOL_VERSION, sequence & 255, len(body) // 2)) + body)


def _close(start: bytes) -> bytes:
    return start.ljust(LENGTH - 1, b"\0") + bytes((END,))


def wide(register: int, value: int, size: int = 2) -> list[Pair]:
    """Pairs that write a big-endian number of `size` bytes; negative ones in two's complement.

    Raises ConfigError if the number does not fit.
    """
    if not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
        raise ConfigError(f"{value} does not fit the {size} bytes of register {register}")
    data = (value & (1 << 8 * size) - 1).to_bytes(size, "big")
    return [(register + offset, byte) for offset, byte in enumerate(data)]


def speed_goal(port: int, counts: int) -> list[Pair]:
    """Pairs that set the goal of a motor's speed control, counts; the mode is written separately, after it.
    Raises ConfigError beyond `MAX_SPEED`."""
    if not -MAX_SPEED <= counts <= MAX_SPEED:
        raise ConfigError(
            f"speed of motor {port} is {counts} counts: allowed are {-MAX_SPEED} to {MAX_SPEED}"
        )
    return wide(wire.SPEED_GOAL + 2 * CHANNEL[port], counts)


def position_goal(port: int, ticks: int) -> list[Pair]:
    """Pairs that set the goal of a motor's position control, in ticks of 250 counts."""
    return wide(wire.POS_GOAL + 4 * CHANNEL[port], ticks * 250, 4)


def duty_register(port: int, pwm: int) -> list[Pair]:
    """Pairs that set a motor's PWM, 0 to 400 (full voltage). Raises ConfigError outside."""
    if not 0 <= pwm <= FULL_PWM:
        raise ConfigError(f"PWM of motor {port} is {pwm}: allowed are 0 to {FULL_PWM}")
    return wide(wire.PWM + 2 * CHANNEL[port], pwm)


def clear_position(port: int) -> list[Pair]:
    """Pairs that set a motor's counter to 0. The port never relies on it: the firmware may lose the write."""
    return wide(wire.MOT_POS + 4 * CHANNEL[port], 0, 4)


def two_bits(of_port: Iterable[int]) -> int:
    """Modes or directions of the four motor ports in one byte."""
    return sum(value << 2 * CHANNEL[port] for port, value in enumerate(of_port))


def modes(of_port: Iterable[int]) -> list[Pair]:
    """The pair that sets the mode of every motor port."""
    return [(wire.MOT_MODES, two_bits(of_port))]


def directions(of_port: Iterable[int]) -> list[Pair]:
    """The pair that sets the direction of every motor port."""
    return [(wire.MOT_DIRS, two_bits(of_port))]


def canary() -> list[Pair]:
    """The pair that sets the mark `CANARY`, which a restart clears."""
    return [(wire.ADC_PE, CANARY)]


def motors_off() -> list[Pair]:
    """Pairs that switch off every motor; servos are not changed."""
    pairs = [(wire.MOT_MODES, 0), (wire.MOT_DIRS, 0)]
    return [*pairs, *((wire.PWM + offset, 0) for offset in range(2 * MOTOR_PORTS))]


def stop(allstop: int = SERVOS_OFF) -> list[Pair]:
    """Pairs that switch everything off; `LATCHED_STOP` keeps the motors stopped until the register is written
    again."""
    return [*motors_off(), (wire.ALLSTOP, allstop)]


# The command image: these registers, in this order, in every frame.
IMAGE = (
    wire.ADC_PE,
    *range(wire.PWM, wire.PWM + 2 * MOTOR_PORTS),
    *range(wire.SERVO, wire.SERVO + 2 * SERVO_PORTS),
    wire.MOT_DIRS,
    wire.MOT_MODES,
    wire.ALLSTOP,
)
_HEADS = tuple(
    bytes((wire.START, PROTOCOL_VERSION, n, len(IMAGE), wire.ADC_PE, CANARY | n & 0x3F)) for n in range(256)
)
_TAIL = bytes(LENGTH - 4 - 2 * len(IMAGE) - 1) + bytes((END,))


def _pwm_bytes(port: int, level: int) -> bytes:
    register = wire.PWM + 2 * CHANNEL[port]
    return bytes((register, level >> 8, register + 1, level & 255))


def _drives(port: int, brake: bool) -> tuple[tuple[bytes, int], ...]:
    """PWM pairs and direction bits for every level; negative indices find those of -400..-1."""
    shift = 2 * CHANNEL[port]
    pairs = [_pwm_bytes(port, level) for level in range(FULL_PWM + 1)]
    rest = (pairs[-1], Direction.BRAKE << shift) if brake else (pairs[0], Direction.COAST << shift)
    up = [(pair, Direction.FORWARD << shift) for pair in pairs[1:]]
    down = [(pair, Direction.REVERSE << shift) for pair in pairs[:0:-1]]
    return rest, *up, *down


# Indexed by brake and level, one per port.
_D0, _D1, _D2, _D3 = (tuple(_drives(port, brake) for brake in (False, True)) for port in range(MOTOR_PORTS))
_SERVO_BOOT = bytes(sum((sum(wide(wire.SERVO + 2 * n, SERVO_BOOT_US), ()) for n in range(SERVO_PORTS)), ()))
_registers = itemgetter(*IMAGE)
_VALUES = slice(5, 4 + 2 * len(IMAGE), 2)


def _end(directions: int, servos_off: int) -> bytes:
    return bytes((wire.MOT_DIRS, directions, wire.MOT_MODES, 0, wire.ALLSTOP, servos_off)) + _TAIL


_ENDS = tuple(_SERVO_BOOT + _end(directions, SERVOS_OFF) for directions in range(256))
"""The end of a frame, from the servos on, for each value of the directions, with the servos off."""


def encode(outputs: Outputs, sequence: int = 0) -> bytes:
    """The complete command as one frame, so that it does not matter which frames before it were lost.

    Duty 0 coasts, or shorts the motor if `outputs.brake` says so.
    """
    duty0, duty1, duty2, duty3 = outputs.duty
    brake0, brake1, brake2, brake3 = outputs.brake
    p0, d0 = _D0[brake0][round(duty0 * FULL_PWM)]
    p1, d1 = _D1[brake1][round(duty1 * FULL_PWM)]
    p2, d2 = _D2[brake2][round(duty2 * FULL_PWM)]
    p3, d3 = _D3[brake3][round(duty3 * FULL_PWM)]
    directions, pulses = d0 | d1 | d2 | d3, outputs.servo_us
    end = _ENDS[directions] if pulses == STOP.servo_us else _servos(pulses, directions)
    return b"".join((_HEADS[sequence & 255], p0, p1, p3, p2, end))


def _servos(pulses: tuple[int | None, ...], directions: int) -> bytes:
    data, off = bytearray(), 0
    for port, pulse in enumerate(pulses):
        if pulse is None:
            off |= 0x10 << port
        for pair in wide(wire.SERVO + 2 * port, SERVO_BOOT_US if pulse is None else pulse):
            data += bytes(pair)
    return bytes(data) + _end(directions, off)


def shows_command(reply: bytes, sent: bytes) -> bool:
    """Whether the registers of `reply` equal the command image `sent` in the frame before it."""
    return bytes(_registers(reply)) == sent[_VALUES]
