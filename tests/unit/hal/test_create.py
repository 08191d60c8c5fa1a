"""The Create 2 behind a pseudo-terminal: its words, and what silence, garbage and an unplugged cable do."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.core.clock import SteppedClock
from raccoon.core.config import MotorModel
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, STOP, Fault, Inputs, Outputs
from raccoon.hal.create import RADIANS_PER_TICK, CreatePort, open_create, protocol
from raccoon.hal.create.counters import WheelCounter
from raccoon.hal.create.protocol import BAUD, PACKETS, Mode, Sensors, StreamDecoder
from raccoon.hal.serial_line import CHUNK_LIMIT, SerialLine
from raccoon.hal.supervise import supervisor
from serial_peer import SerialPeer

REST = Sensors(
    bumps_and_wheel_drops=0b0001,
    cliff_left=0,
    cliff_front_left=1,
    cliff_front_right=0,
    cliff_right=0,
    buttons=0b10,
    voltage_mv=15_800,
    current_ma=-250,
    cliff_left_signal=2900,
    cliff_front_left_signal=95,
    cliff_front_right_signal=2800,
    cliff_right_signal=4095,
    mode=Mode.FULL,
    left_encoder=100,
    right_encoder=65_500,
    left_motor_ma=120,
    right_motor_ma=-80,
)


def frame(sensors: Sensors) -> bytes:
    """What the base sends: written from the description of the stream, without the decoder's help."""
    body = b""
    for packet, code, name in PACKETS:
        value = getattr(sensors, name)
        body += bytes((packet,)) + (
            value.to_bytes(1, "big") if code == "B" else value.to_bytes(2, "big", signed=code == "h")
        )
    whole = bytes((19, len(body))) + body
    return whole + bytes((-sum(whole) & 0xFF,))


class Base:
    """A port on a stepped clock and the base at the other end of its cable."""

    def __init__(self, peer: SerialPeer, *, mode: Mode = Mode.FULL, speed: bool = False) -> None:
        self.peer = peer
        self.clock = SteppedClock(100.0)
        self.line = SerialLine(str(peer.path), BAUD, self.clock)
        self.port = CreatePort(self.line, self.clock, mode=mode, speed=speed)

    def cycle(self, sensors: Sensors, seconds: float = 0.015) -> Inputs:
        self.clock.advance(seconds)
        self.peer.say(frame(sensors))
        return self.port.read()

    def silence(self, timeout: float) -> bytes:
        """In place of the line's `read`: it waits in vain."""
        self.clock.advance(timeout)
        return b""


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[SerialPeer]:
    device = SerialPeer(tmp_path / "ttyUSB0")
    yield device
    device.unplug()


@pytest.fixture
def base(peer: SerialPeer) -> Iterator[Base]:
    ready = Base(peer)
    peer.heard(0.2)
    yield ready
    ready.port.close()


def test_worked_example_of_drive_direct() -> None:
    assert protocol.drive_direct(left_mm_s=200, right_mm_s=150) == bytes.fromhex("91 00 96 00 C8")


def test_worked_stream_of_the_specification_sums_to_zero() -> None:
    # OI specification, opcode 148: packets 29 (549) and 13 (0).
    assert sum(bytes((19, 5, 29, 2, 25, 13, 0, 163))) & 0xFF == 0
    assert protocol.stream((29, 13)) == bytes((148, 2, 29, 13))


@given(left=st.integers(-255, 255), right=st.integers(-255, 255))
def test_drive_pwm_names_the_right_wheel_first_and_big_endian(left: int, right: int) -> None:
    command = protocol.drive_pwm(left, right)
    assert command[0] == 146
    assert int.from_bytes(command[1:3], "big", signed=True) == right
    assert int.from_bytes(command[3:5], "big", signed=True) == left


@pytest.mark.parametrize(("left", "right"), [(256, 0), (0, -256)])
def test_a_pwm_out_of_range_is_refused(left: int, right: int) -> None:
    with pytest.raises(ValueError, match="allowed are -255 to 255"):
        protocol.drive_pwm(left, right)


def test_only_modes_that_drive_can_be_entered() -> None:
    with pytest.raises(ValueError, match="allowed are SAFE and FULL"):
        protocol.enter(Mode.PASSIVE)


_WORDS = {"B": st.integers(0, 255), "H": st.integers(0, 65_535), "h": st.integers(-32_768, 32_767)}
any_sensors = st.builds(Sensors, **{name: _WORDS[code] for _, code, name in PACKETS})


@given(st.lists(any_sensors, min_size=1, max_size=3), st.data())
def test_frames_survive_any_cut(frames: list[Sensors], data: st.DataObject) -> None:
    stream = b"".join(map(frame, frames))
    cut = data.draw(st.integers(0, len(stream)))
    decoder = StreamDecoder()
    assert decoder.feed(stream[:cut]) + decoder.feed(stream[cut:]) == frames


@given(garbage=st.binary(max_size=120), sensors=any_sensors)
def test_garbage_before_a_frame_does_not_hide_it(garbage: bytes, sensors: Sensors) -> None:
    decoder = StreamDecoder()
    found = decoder.feed(garbage + frame(sensors) + bytes(protocol.FRAME_LENGTH))
    assert sensors in found


@given(sensors=any_sensors, data=st.data())
def test_a_changed_byte_never_gives_a_reading(sensors: Sensors, data: st.DataObject) -> None:
    whole = bytearray(frame(sensors))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= data.draw(st.integers(1, 255))
    assert StreamDecoder().feed(bytes(whole)) == []


def test_control_is_taken_with_the_wheels_stopped(peer: SerialPeer) -> None:
    base = Base(peer)
    assert isinstance(base.port, Port)
    packets = bytes(packet for packet, _, _ in PACKETS)
    assert peer.heard(0.2) == bytes((128, 132, 145, 0, 0, 0, 0, 148, len(packets))) + packets
    base.port.close()


def test_safe_mode_can_be_asked_for(peer: SerialPeer) -> None:
    base = Base(peer, mode=Mode.SAFE)
    assert peer.heard(0.2)[:2] == bytes((128, 131))
    base.port.close()


def test_words_of_one_cycle(base: Base) -> None:
    inputs = base.cycle(REST)
    assert inputs.time == base.clock.now()
    assert list(inputs.position) == [0, 0, None, None]
    assert list(inputs.analog) == [1195, 4000, 1295, 0, None, None]
    assert inputs.digital == (False, True, False, False, False, True, False, False, False, True)
    assert inputs.battery_voltage == pytest.approx(15.8)
    assert inputs.extra == {"battery.current": 0.25, "motor.0.current": 0.12, "motor.1.current": -0.08}
    assert inputs.bemf == (None,) * 4
    assert inputs.gyro is None
    assert inputs.faults == ()
    clear = replace(REST, bumps_and_wheel_drops=0, buttons=0, cliff_front_left=0)
    for port, bits in ((0, 0b0010), (1, 0b0001), (2, 0b1000), (3, 0b0100)):
        digital = base.cycle(replace(clear, bumps_and_wheel_drops=bits)).digital
        assert digital == tuple(each == port for each in range(10))
    for port, bits in ((8, 0b01), (9, 0b10)):
        assert base.cycle(replace(clear, buttons=bits)).digital == tuple(each == port for each in range(10))


def test_the_default_model_turns_ticks_into_wheel_angle(base: Base) -> None:
    device = base.cycle(REST).device
    volts_per_radian = MotorModel().back_emf_constant.value
    angle = device.position_counts_seconds * BEMF_VOLTS_PER_COUNT / volts_per_radian
    assert angle == pytest.approx(RADIANS_PER_TICK)
    assert 508.8 * angle * 0.036 == pytest.approx(3.141592653589793 * 0.072)


def test_positions_run_on_over_the_edge_of_the_counter(base: Base) -> None:
    base.cycle(REST)
    inputs = base.cycle(replace(REST, left_encoder=90, right_encoder=4))
    assert inputs.position[:2] == (-10, 40)
    assert inputs.faults == ()


def test_the_newest_of_several_frames_counts(base: Base) -> None:
    base.cycle(REST)
    base.peer.say(frame(replace(REST, left_encoder=110)))
    inputs = base.cycle(replace(REST, left_encoder=120))
    assert inputs.position[0] == 20
    assert inputs.faults == (Fault.OVERRUN,)


def test_a_jump_of_the_encoder_is_left_out_and_named(base: Base) -> None:
    base.cycle(replace(REST, left_encoder=20_000))
    inputs = base.cycle(replace(REST, left_encoder=24_000))
    assert inputs.position[0] == 0
    assert inputs.faults == (Fault.POSITION_JUMP,)
    assert base.cycle(replace(REST, left_encoder=24_010)).position[0] == 10


def test_a_base_that_was_switched_off_and_on_is_a_reset(base: Base) -> None:
    base.cycle(replace(REST, left_encoder=3000, right_encoder=3000))
    inputs = base.cycle(replace(REST, left_encoder=0, right_encoder=0), seconds=4.0)
    assert inputs.position[:2] == (0, 0)
    assert inputs.faults == (Fault.RESET,)


@pytest.mark.parametrize(
    ("duty", "brake", "expected"),
    [
        ((1.0, -1.0, 0.0, 0.0), (False,) * 4, protocol.drive_pwm(255, -255)),
        ((0.5, 0.25, 0.0, 0.0), (False,) * 4, protocol.drive_pwm(128, 64)),
        ((0.0, 0.0, 0.0, 0.0), (False,) * 4, protocol.drive_pwm(0, 0)),
        ((0.0, 0.0, 0.0, 0.0), (True,) * 4, protocol.drive_direct(0, 0)),
    ],
)
def test_duty_becomes_pwm(
    base: Base, duty: tuple[float, ...], brake: tuple[bool, ...], expected: bytes
) -> None:
    base.port.write(Outputs(duty=duty, brake=brake))
    assert base.peer.heard(0.2) == expected


def test_duty_becomes_speed_where_asked_for(peer: SerialPeer) -> None:
    base = Base(peer, speed=True)
    peer.heard(0.2)
    base.port.write(Outputs(duty=(0.4, 0.3, 0.0, 0.0)))
    assert peer.heard(0.2) == protocol.drive_direct(200, 150)
    base.port.close()


def test_a_motor_the_base_does_not_have_is_refused(base: Base) -> None:
    with pytest.raises(ConfigError, match=r"duty of motor 2 is 0.5: a Create has the motors 0 and 1"):
        base.port.write(Outputs(duty=(0.0, 0.0, 0.5, 0.0)))


def test_closing_stops_the_wheels_and_gives_the_base_back(base: Base) -> None:
    base.port.close()
    base.port.close()
    assert base.peer.heard(0.2) == bytes.fromhex("92 00000000 91 00000000 96 00 80 AD")


def test_garbage_and_half_frames_cost_their_own_cycle_at_most(base: Base) -> None:
    base.cycle(REST)
    base.peer.say(b"\x13\x2c\x07" + frame(REST)[:20] + b"\xff\x00")
    inputs = base.cycle(replace(REST, left_encoder=107))
    assert inputs.position[0] == 7
    base.peer.say(frame(replace(REST, left_encoder=109))[:30])
    assert base.port.read().faults == (Fault.LINK_DEAD,)
    base.peer.say(frame(replace(REST, left_encoder=109))[30:])
    assert base.port.read().position[0] == 9


def test_silence_gives_empty_cycles_then_starts_again_then_gives_up(
    base: Base, monkeypatch: pytest.MonkeyPatch
) -> None:
    base.cycle(REST)
    inputs = base.port.read()
    assert inputs.faults == (Fault.LINK_DEAD,)
    assert list(inputs.position) == [None] * 4
    base.clock.advance(0.6)
    base.port.read()
    assert base.peer.heard(0.2).startswith(bytes((128, 132, 145)))
    base.port.read()
    assert base.peer.heard() == b""  # it has half a second to answer
    monkeypatch.setattr(base.line, "read", base.silence)
    for _ in range(95):
        assert base.port.read().faults == (Fault.LINK_DEAD,)

    def wait() -> None:
        for _ in range(10):
            base.port.read()

    with pytest.raises(HardwareError, match=r"no sensor frame for 5\.\d s.*wake the base"):
        wait()


def test_a_pause_in_which_nobody_listened_is_no_silence(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    base.cycle(REST)
    base.clock.advance(30.0)  # the program waits for somebody, who takes the cable out and puts it back
    with monkeypatch.context() as unplugged:
        unplugged.setattr(base.line, "read", base.silence)
        assert base.port.read().faults == (Fault.LINK_DEAD,)
    assert base.cycle(REST).faults == ()


def test_unplugged_and_plugged_in_again(base: Base) -> None:
    base.cycle(REST)
    base.peer.unplug()
    assert base.port.read().faults == (Fault.LINK_DEAD,)
    before = base.clock.now()
    assert base.port.read().faults == (Fault.LINK_DEAD,)
    assert base.clock.now() - before == pytest.approx(0.05)  # it waits as for a frame, and keeps no core busy
    base.port.write(Outputs(duty=(0.5, 0.5, 0.0, 0.0)))  # nobody there: neither an error nor a wait
    base.clock.advance(1.0)
    assert base.port.read().faults == (Fault.LINK_DEAD,)
    base.peer.plug()
    base.port.read()
    assert not base.line.connected  # it is looked for twice a second, not in every cycle
    base.clock.advance(1.0)
    base.port.read()
    # The base kept its last command while it was alone: the first thing it hears is to stop.
    assert base.peer.heard(0.2).startswith(bytes((128, 132, 145, 0, 0, 0, 0)))
    inputs = base.cycle(replace(REST, left_encoder=150))
    assert inputs.position[0] == 50
    assert inputs.faults == ()


def test_a_plug_that_bounces_is_not_there_yet(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise termios.error(errno.EIO, "Input/output error")

    base.cycle(REST)
    base.peer.unplug()
    assert base.port.read().faults == (Fault.LINK_DEAD,)
    base.peer.plug()
    base.clock.advance(1.0)
    with monkeypatch.context() as bouncing:
        bouncing.setattr(termios, "tcflush", gone)
        assert base.port.read().faults == (Fault.LINK_DEAD,)
    base.clock.advance(1.0)
    base.port.read()
    assert base.cycle(REST).faults == ()


def test_a_base_that_left_its_mode_loses_commands_and_is_asked_back(base: Base) -> None:
    base.cycle(REST)
    dropped = replace(REST, mode=Mode.PASSIVE, bumps_and_wheel_drops=0b1000)
    for seconds in (0.015, 1.0):  # at once, as it has obeyed before
        assert base.cycle(dropped, seconds).faults == (Fault.COMMAND_LOST,)
    assert base.peer.heard() == b""  # a robot in somebody's hands does not start to drive
    for asked in (bytes((128, 132, 145)), b""):  # at most every half second
        inputs = base.cycle(replace(REST, mode=Mode.PASSIVE))
        assert inputs.faults == (Fault.COMMAND_LOST,)
        assert base.peer.heard(0.1)[:3] == asked
    assert base.cycle(REST).faults == ()


def test_frames_that_are_older_than_a_restart_are_no_lost_commands(base: Base) -> None:
    base.cycle(REST)
    base.clock.advance(0.6)
    base.port.read()  # silent: it is started again, and PASSIVE until it has heard that
    passive = replace(REST, mode=Mode.PASSIVE)
    assert [base.cycle(passive, seconds).faults for seconds in (0.015, 0.6)] == [(), (Fault.COMMAND_LOST,)]


def test_a_cycle_waits_for_its_frame(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []

    def read(_: SerialLine, timeout: float) -> bytes:
        waits.append(timeout)
        base.clock.advance(0.02)
        return frame(REST)[30 * len(waits) - 30 : 30 * len(waits)]

    monkeypatch.setattr(SerialLine, "read", read)
    assert base.port.read().faults == ()
    assert waits == pytest.approx([0.05, 0.03])


def test_the_newest_frame_counts_of_what_came_in_a_pause(base: Base, monkeypatch: pytest.MonkeyPatch) -> None:
    base.cycle(REST)
    kept = b"".join(frame(replace(REST, left_encoder=100 + tick)) for tick in range(500))

    def read(*_: object) -> bytes:
        nonlocal kept
        data, kept = kept[:CHUNK_LIMIT], kept[CHUNK_LIMIT:]
        return data

    monkeypatch.setattr(SerialLine, "read", read)
    base.clock.advance(7.5)
    assert base.port.read().position[0] == 499


def test_a_base_that_never_obeys_is_reported(peer: SerialPeer) -> None:
    base = Base(peer)
    charging = replace(REST, mode=Mode.PASSIVE)
    assert base.cycle(charging).faults == ()
    assert base.cycle(charging, seconds=0.6).faults == (Fault.COMMAND_LOST,)
    base.port.close()


def test_a_wheel_that_turns_back_past_0_is_no_base_that_started_again() -> None:
    wheel = WheelCounter()
    assert [wheel.update(word, 0.2) for word in (215, 195, 65_534)] == [None] * 3
    assert wheel.position == -2 - 215
    assert wheel.update(300, 0.45) is None
    assert wheel.update(5, 0.6) is Fault.RESET
    wheel.update(5000, 5.0)
    assert wheel.update(65_500, 0.6) is Fault.RESET  # it started again and rolled back


def test_what_the_base_drives_at_its_top_speed_is_no_jump_and_twice_that_is_one() -> None:
    """0.5 m/s on wheels of 72 mm, of 508.8 ticks a turn."""
    wheel, ticks = WheelCounter(), round(0.5 * 0.2 / (math.pi * 0.072) * 508.8)
    assert [wheel.update(word, 0.2) for word in (0, ticks, 0)] == [None] * 3
    assert wheel.update(2 * ticks, 0.2) is Fault.POSITION_JUMP


def test_the_port_is_ours_alone(base: Base) -> None:
    with pytest.raises(HardwareError, match=r"serial port .*ttyUSB0: another program has it open"):
        SerialLine(str(base.peer.path), BAUD, SteppedClock())


def test_a_missing_port_says_what_to_look_at(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"nothing: there is no such device; is it plugged in"):
        SerialLine(str(tmp_path / "nothing"), BAUD, SteppedClock())


KILLED = """
import os, signal, sys
from raccoon.core.readings import Outputs
from raccoon.core.config import parse_robot
from raccoon.robot.opening import open_port

port = open_port(parse_robot({"controller": {"port": "create", "device": sys.argv[1]}}))
port.read()
port.write(Outputs(duty=(0.5, 0.5, 0.0, 0.0)))
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_program_leaves_no_wheel_running(peer: SerialPeer) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(peer.path)], check=False, timeout=30)
    assert killed.returncode == -signal.SIGKILL
    heard = peer.heard(1.0)
    while not heard.endswith(protocol.stop() * 5):
        more = peer.heard(1.0)
        assert more, heard
        heard += more
    assert protocol.drive_pwm(128, 128) in heard


def test_a_program_that_hangs_leaves_no_wheel_running(peer: SerialPeer) -> None:
    """Its port tells the supervisor of no servos to hold: what stops at its end stops then as well. A process
    that it forked, and that ends before, stops nothing."""
    port = open_create(str(peer.path))
    try:
        port.write(Outputs(duty=(0.5, 0.5, 0.0, 0.0)))
        child = os.fork()
        if child == 0:  # pragma: no cover - in the child
            with contextlib.suppress(BaseException):
                port.close()
            os._exit(0)
        os.waitpid(child, 0)
        heard = peer.heard()
        assert heard.endswith(protocol.drive_pwm(128, 128))
        while not heard.endswith(protocol.stop() * 5):
            more = peer.heard(2.0)
            assert more, heard
            heard += more
    finally:
        port.close()


class Watched:
    def __init__(self) -> None:
        self.beats = 0
        self.closed: list[bool] = []

    def beat(self) -> None:
        self.beats += 1

    def close(self, *, stopped: bool = True) -> None:
        self.closed.append(stopped)


@pytest.mark.parametrize("plugged", [True, False])
def test_the_guard_hears_every_cycle_and_whether_the_wheels_were_stopped(
    peer: SerialPeer, plugged: bool
) -> None:
    guard, clock = Watched(), SteppedClock()
    port = CreatePort(SerialLine(str(peer.path), BAUD, clock), clock, guard=guard)
    peer.say(frame(REST))
    port.read()
    port.write(STOP)
    assert guard.beats == 2
    if not plugged:
        peer.unplug()
    port.close()
    port.close()
    assert guard.closed == [plugged]


def test_a_stop_that_is_interrupted_is_left_to_the_guard(
    peer: SerialPeer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: bytes) -> bool:
        raise KeyboardInterrupt

    guard, clock = Watched(), SteppedClock()
    line = SerialLine(str(peer.path), BAUD, clock)
    port = CreatePort(line, clock, guard=guard)
    monkeypatch.setattr(line, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        port.close()
    assert guard.closed == [False]
    assert not line.connected


def test_a_base_that_cannot_be_begun_with_leaves_neither_guard_nor_line(
    peer: SerialPeer, monkeypatch: pytest.MonkeyPatch
) -> None:
    guard = Watched()
    monkeypatch.setattr(supervisor, "Supervisor", lambda *_: guard)
    with pytest.raises(ValueError, match="allowed are SAFE and FULL"):
        open_create(str(peer.path), mode=Mode.PASSIVE)
    assert guard.closed == [False]
    SerialLine(str(peer.path), BAUD, SteppedClock()).close()  # it is free again


def test_nothing_is_written_after_closing(base: Base) -> None:
    base.port.close()
    base.peer.heard(0.2)
    base.port.write(STOP)
    base.clock.advance(1.0)
    base.port.read()  # which does not open the line again
    assert not base.line.connected
    assert base.peer.heard() == b""
