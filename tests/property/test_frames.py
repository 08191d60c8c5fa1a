"""Frames of the Wombat over the whole ranges of their fields, and a port that is fed damaged ones."""

import contextlib
import math
import struct
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.core.clock import SteppedClock
from raccoon.core.errors import HardwareError
from raccoon.core.readings import Outputs
from raccoon.hal.wombat.firmware.dialect import LARGEST_WORD, Dialect
from raccoon.hal.wombat.firmware.raccoon import commands as raccoon_commands
from raccoon.hal.wombat.firmware.raccoon import wire as raccoon
from raccoon.hal.wombat.firmware.raccoon.commands import (
    Command,
    Kinematics,
    Mode,
    MotorPid,
    ServoMode,
    Update,
)
from raccoon.hal.wombat.firmware.raccoon.dialect import RaccoonDialect
from raccoon.hal.wombat.firmware.stock import commands as stock_commands
from raccoon.hal.wombat.firmware.stock import wire as stock
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect
from raccoon.hal.wombat.port import WombatPort

U8 = st.integers(0, 255)
U16 = st.integers(0, 0xFFFF)
I8 = st.integers(-128, 127)
I16 = st.integers(-0x8000, 0x7FFF)
U32 = st.integers(0, 0xFFFF_FFFF)
I32 = st.integers(-0x8000_0000, 0x7FFF_FFFF)
F32 = st.floats(width=32, allow_nan=False)
VECTOR = st.tuples(F32, F32, F32, I8)


def flat(*groups: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(each for group in groups for each in group)


REGISTERS = st.tuples(
    st.tuples(*[U16] * 5),
    st.tuples(*[U16] * 6, U8),
    st.tuples(*[I16] * 9),
    st.tuples(*[I32] * 4),
    st.tuples(*[U8] * 4),
    st.tuples(*[I16] * 4),
    st.tuples(*[U16] * 9, U8),
)


@given(REGISTERS)
def test_every_register_comes_back(groups: tuple[tuple[int, ...], ...]) -> None:
    words = (stock.START, *(each for group in groups for each in group))
    registers = stock.decode(struct.pack(">B5H6HB9h4i4B4h4H4HHB", *words))
    assert registers.words == words
    position, flags = groups[3], groups[4]
    assert registers.position == (position[0], position[1], position[3], position[2])
    assert [registers.modes[port] for port in (0, 1, 3, 2)] == [flags[0] >> 2 * n & 3 for n in range(4)]
    readings = stock.inputs(registers, 0.0)
    assert readings.battery == words[42]
    assert readings.gyro == (words[20], words[19], -words[21])


DUTY = st.floats(-1.0, 1.0)
PULSE = st.none() | st.integers(600, 2400)
OUTPUTS = st.builds(
    Outputs,
    duty=st.tuples(*[DUTY] * 4),
    brake=st.tuples(*[st.booleans()] * 4),
    servo_us=st.tuples(*[PULSE] * 4),
)


@given(OUTPUTS, st.integers(0, 1000))
def test_a_stock_command_says_what_was_asked(outputs: Outputs, sequence: int) -> None:
    frame = stock_commands.encode(outputs, sequence)
    assert len(frame) == 89
    registers = bytearray(stock.REGISTERS)
    body = frame[4 : 4 + 2 * frame[3]]
    for address, value in zip(body[::2], body[1::2], strict=True):
        registers[address] = value
    for port, duty in enumerate(outputs.duty):
        channel = stock.CHANNEL[port]
        direction = registers[stock.MOT_DIRS] >> 2 * channel & 3
        pwm = int.from_bytes(registers[stock.PWM + 2 * channel : stock.PWM + 2 * channel + 2], "big")
        if direction == 3:
            assert outputs.brake[port]
            assert abs(duty) <= 0.5 / 400
            continue
        assert (pwm == 0) == (direction == 0)
        assert abs((-pwm if direction == 2 else pwm) / 400 - duty) <= 0.5 / 400 + 1e-12
    for port, pulse in enumerate(outputs.servo_us):
        assert bool(registers[stock.ALLSTOP] >> 4 + port & 1) == (pulse is None)
    assert stock_commands.shows_command(bytes(registers), frame)


TELEMETRY = st.tuples(
    st.tuples(U32),
    st.tuples(*[I32] * 8, U8),
    st.tuples(*[I16] * 7, U16),
    st.tuples(*[VECTOR] * 5).map(lambda vectors: flat(*vectors)),
    st.tuples(F32, F32, F32, F32, I8, F32, F32),
    st.tuples(*[F32] * 6),
)


@given(TELEMETRY, st.sampled_from([17, 21]))
def test_every_field_of_telemetry_comes_back(groups: tuple[tuple[float, ...], ...], version: int) -> None:
    motors = groups[1]
    words = (version, *flat(*groups))
    frame = struct.pack("<BI4i4iB6hhH3fb3fb3fb3fb3fb4fbff6f", *words)
    telemetry = raccoon.decode(frame.ljust(raccoon.FRAME_LENGTH[version], b"\0"), version)
    assert telemetry.words == words
    assert list(telemetry.bemf) == [-each for each in motors[:4]]
    assert list(telemetry.position) == [-each for each in motors[4:8]]


NEGATABLE = st.integers(-0x7FFF_FFFF, 0x7FFF_FFFF)
FOUR = st.tuples(*[F32] * 4)
COMMANDS = st.builds(
    Command,
    updates=st.integers(0, 0x7F).map(Update),
    modes=st.tuples(*[st.sampled_from(list(Mode)[:5])] * 4),
    targets=st.tuples(*[NEGATABLE] * 4),
    goals=st.tuples(*[NEGATABLE] * 4),
    position_reset=U8,
    servo_modes=st.tuples(*[st.sampled_from(ServoMode)] * 4),
    servo_us=st.tuples(*[U16] * 4),
    pid=st.builds(MotorPid, limits=FOUR, tau=F32, gains=st.tuples(*[st.tuples(F32, F32, F32)] * 4)),
    gyro_orientation=st.tuples(*[I8] * 9),
    compass_orientation=st.tuples(*[I8] * 9),
    kinematics=st.builds(
        Kinematics, inverse=st.tuples(*[F32] * 12), ticks_to_rad=FOUR, forward=st.tuples(*[F32] * 12)
    ),
)


@given(COMMANDS)
def test_every_field_of_a_raccoon_command_comes_back(command: Command) -> None:
    frame = raccoon_commands.encode_command(command, 17)
    words = struct.unpack("<BIBH4i4iBB4H5f12f9b9b12f4f12f", frame)
    assert words[1:3] == (command.updates, command.shutdown)
    assert [words[3] >> 3 * port & 7 for port in range(4)] == list(command.modes)
    assert [-each for each in words[4:8]] == list(command.targets)
    assert [-each for each in words[8:12]] == list(command.goals)
    assert words[14:18] == command.servo_us
    assert words[18:23] == (*command.pid.limits, command.pid.tau)
    assert words[23:35] == flat(*command.pid.gains)
    assert words[35:44] == command.gyro_orientation
    assert words[53:65] == command.kinematics.inverse
    assert words[69:81] == command.kinematics.forward
    assert len(raccoon_commands.encode_command(command, 21)) == 277


class DamagedLink:
    """Frames of a moving robot, a third to three quarters of them damaged in some way."""

    def __init__(self, dialect: Dialect, seed: int, clock: SteppedClock) -> None:
        self.random = Random(seed)
        self.frames = 0
        self._length = dialect.length
        self._stock = dialect.name == "stock"
        self._version = 0 if self._stock else int(dialect.name.split()[1])
        self._clean = (0.25, 0.45, 0.65)[seed % 3]
        self._rate, self._step = {0: (235.0, 900), 17: (181.0, -900), 21: (900.0, -1)}[self._version]
        self._time = clock
        self._clock = 1_000_000
        self._start = [self.random.getrandbits(32) for _ in range(4)]
        self._sent = bytes(dialect.length)

    def transfer(self, frame: bytes) -> bytes:
        self.frames += 1
        reply = self._good()
        self._sent = frame
        return self._damaged(reply)[: len(frame)].ljust(len(frame), b"\0")

    def close(self) -> None:
        pass

    def _good(self) -> bytes:
        """A frame of a robot that drives: counters advance as its back-EMF says, sensors are noisy."""
        self._clock += 2500
        noise = [byte % 9 for byte in self.random.randbytes(16)]
        travelled = int(self._time.now() * self._rate) * self._step
        counters = [start + travelled & 0xFFFF_FFFF for start in self._start]
        if self._stock:
            reply = bytearray(stock.MAGIC.ljust(stock.LENGTH, b"\x02"))
            struct.pack_into(">3h", reply, stock.ACCEL, *noise[:2], -8192 + noise[2])
            struct.pack_into(">3h", reply, stock.GYRO, *noise[3:6])
            struct.pack_into(">4I", reply, stock.MOT_POS, *counters)
            struct.pack_into(">H", reply, stock.BATTERY, 750 + noise[6] // 2)
            if self._sent[:1] == b"J":
                for address, value in zip(self._sent[4:44:2], self._sent[5:45:2], strict=True):
                    reply[address] = value
            return bytes(reply)
        reply = bytearray(self._length)
        struct.pack_into("<BI", reply, 0, self._version, self._clock & 0xFFFF_FFFF)
        struct.pack_into("<4i", reply, 5, *(-900 + each for each in noise[:4]))
        struct.pack_into("<4I", reply, 21, *counters)
        struct.pack_into("<7h", reply, 38, *(1000 + each // 3 for each in noise[4:10]), 750 + noise[10] // 2)
        struct.pack_into("<3f", reply, 54, *(0.01 * each for each in noise[11:14]))
        struct.pack_into("<3f", reply, 67, 0.001 * noise[14], 0.0, 9.8)
        struct.pack_into("<f", reply, 119, 1.0)
        return bytes(reply)

    def _damaged(self, reply: bytes) -> bytes:
        kind = self.random.random()
        if kind < self._clean:
            return reply
        if kind < 0.85:
            damaged = bytearray(reply)
            for _ in range(self.random.randrange(1, 8)):
                damaged[int(self.random.random() * len(damaged))] = self.random.getrandbits(8)
            return bytes(damaged)
        if kind < 0.90:
            return reply[:3] + self.random.randbytes(len(reply) - 3)
        if kind < 0.93:
            return self.random.randbytes(len(reply))
        if kind < 0.96:
            return bytes((self.random.randrange(256),)) * len(reply)
        cut = self.random.randrange(len(reply))
        return reply[cut:] + reply[:cut]


def dialect_of(firmware: str) -> Dialect:
    return StockDialect() if firmware == "stock" else RaccoonDialect(int(firmware))


@pytest.mark.parametrize("firmware", ["stock", "17", "21"])
def test_damaged_frames_never_pass_a_jump_for_good(firmware: str) -> None:
    """34,000 frames for each firmware. Whatever they say, nothing but HardwareError is raised, a position
    that moved further than motors can is never handed over without a fault, and never a word that no sensor
    gives."""
    frames, seed, judged = 0, 0, 0
    while frames < 34_000:
        dialect = dialect_of(firmware)
        clock = SteppedClock()
        link = DamagedLink(dialect, seed, clock)
        seed += 1
        port = WombatPort(link, clock=clock, dialect=dialect, reset_line=None)
        fastest = 2.0 * 2000.0 / dialect.device.position_counts_seconds
        last: tuple[float, tuple[float | None, ...]] | None = None
        try:
            while link.frames < 1_700:
                inputs = port.read()
                assert all(map(math.isfinite, (*(inputs.gyro or ()), *(inputs.accel or ()))))
                counts = (*inputs.bemf, *inputs.analog, inputs.battery)
                assert all(abs(word) <= LARGEST_WORD for word in counts if word is not None)
                if inputs.position[0] is None:
                    continue
                if last is not None and not inputs.faults:
                    limit = fastest * max(inputs.time - last[0], 0.012) + 2.0
                    for new, old in zip(inputs.position, last[1], strict=True):
                        assert new is not None
                        assert old is not None
                        assert abs(new - old) <= limit
                    judged += 1
                last = inputs.time, inputs.position
                port.write(Outputs(duty=(0.5, 0.5, 0.0, 0.0)))
        except HardwareError:
            pass  # documented; the next port begins afresh
        frames += link.frames
        with contextlib.suppress(HardwareError):  # a stop that is never confirmed is said so
            port.close()
    assert judged > 500  # the damage is not so bad that nothing passes
