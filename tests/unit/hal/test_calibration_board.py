"""The calibration board: frames byte for byte, the pose they add up to, and every interruption."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.core.clock import SteppedClock
from raccoon.core.errors import ConfigError
from raccoon.core.port import Port
from raccoon.core.readings import STOP, Fault, Status, Truth
from raccoon.hal.calibration_board import BAUD, CalibrationBoard, FlowTracker, Mounting, ReferencePort
from raccoon.hal.calibration_board.frames import (
    Accumulator,
    BoardStatus,
    Flow,
    FlowCalibration,
    FrameDecoder,
    ImuSample,
    Orientation,
    crc8,
)
from raccoon.hal.calibration_board.tracker import CENTRED
from raccoon.hal.serial_line import SerialLine
from serial_peer import SerialPeer
from standing_port import StandingPort

IMU_EXAMPLE = bytes.fromhex("A5 01 0E 40 E2 01 00 52 00 D7 FF 00 20 10 00 F8 FF 66 06 5D 03 EF")
FLOW_EXAMPLE = bytes.fromhex("A5 02 0A 41 E2 01 00 11 00 FD FF 58 12 34 80 00 00 BE")


def encode(kind: int, time_ms: int, payload: bytes) -> bytes:
    """What the board sends: one whole frame."""
    body = bytes((kind, len(payload))) + struct.pack("<I", time_ms) + payload
    return bytes((0xA5,)) + body + bytes((crc8(body),))


def calibration(time_ms: int, counts_per_cm: float = 100.0, valid: bool = True) -> bytes:
    return encode(4, time_ms, struct.pack("<3fB", counts_per_cm, counts_per_cm, 20.0, valid))


def orientation(time_ms: int, yaw: float, rate_deg_s: float = 0.0) -> bytes:
    half = yaw / 2.0
    numbers = (math.cos(half), 0.0, 0.0, math.sin(half), 0.0, 0.0, rate_deg_s, 0.0, 0.0)
    return encode(5, time_ms, struct.pack("<9fB", *numbers, 0))


def flow(time_ms: int, dx: int, dy: int, squal: int = 90) -> bytes:
    return encode(2, time_ms, struct.pack("<2h4B2x", dx, dy, squal, 0, 0, 0))


def sums(time_ms: int, x: int, y: int) -> bytes:
    return encode(6, time_ms, struct.pack("<2i", x, y))


def imu(time_ms: int) -> bytes:
    return encode(1, time_ms, bytes(14))


def tracked(*frames: bytes, mounting: Mounting = CENTRED) -> FlowTracker:
    tracker = FlowTracker(mounting)
    for each in FrameDecoder().feed(calibration(0) + orientation(0, 0.0) + flow(0, 0, 0) + b"".join(frames)):
        tracker.take(each)
    return tracker


def at(pose: Truth | None) -> tuple[float, float, float]:
    assert pose is not None
    return pose.x, pose.y, pose.heading


def drive(steps: int, dx: int, dy: int, turn: float) -> list[bytes]:
    """`steps` frames 10 ms apart, the robot turning evenly by `turn` in all."""
    frames = []
    for step in range(1, steps + 1):
        frames += [orientation(10 * step, turn * step / steps), flow(10 * step, dx, dy)]
    return frames


def test_crc_check_value() -> None:
    assert crc8(b"123456789") == 0xF4


def test_worked_imu_sample() -> None:
    (sample,) = FrameDecoder().feed(IMU_EXAMPLE)
    assert sample == ImuSample(123_456, (82, -41, 8192), (16, -8, 1638), 861)
    assert sample.celsius == pytest.approx(31.499, abs=1e-3)
    assert encode(1, 123_456, struct.pack("<7h", 82, -41, 8192, 16, -8, 1638, 861)) == IMU_EXAMPLE


def test_worked_flow_sample() -> None:
    (sample,) = FrameDecoder().feed(FLOW_EXAMPLE)
    assert sample == Flow(123_457, 17, -3, squal=88, shutter=0x1234, motion=0x80)


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (
            encode(3, 7, struct.pack("<2bBx3I2H", 0, -3, 1, 100_000, 5, 2, 1, 4)),
            BoardStatus(7, 0, -3, True, 100_000, 5, 2, 1, 4),
        ),
        (calibration(8, 50.0), FlowCalibration(8, (50.0, 50.0), 20.0, None, True)),
        (
            encode(4, 9, struct.pack("<5fB", 50.0, 51.0, 20.0, 1.5, -2.5, 0)),
            FlowCalibration(9, (50.0, 51.0), 20.0, (1.5, -2.5), False),
        ),
        (
            encode(5, 10, struct.pack("<9fB", 1, 0, 0, 0, 1, 2, 3, 0.5, 0.25, 1)),
            Orientation(10, (1, 0, 0, 0), (1, 2, 3), (0.5, 0.25), True, False),
        ),
        (
            encode(5, 11, struct.pack("<10fB", 1, 0, 0, 0, 1, 2, 3, 0.5, 0.25, 0.125, 2)),
            Orientation(11, (1, 0, 0, 0), (1, 2, 3), (0.5, 0.25, 0.125), False, True),
        ),
        (sums(12, -5, 7), Accumulator(12, -5, 7)),
    ],
)
def test_every_frame_in_both_lengths(frame: bytes, expected: object) -> None:
    assert FrameDecoder().feed(frame) == [expected]


@given(garbage=st.binary(max_size=80), cut=st.integers(0, 40))
def test_garbage_and_cuts_do_not_hide_what_follows(garbage: bytes, cut: int) -> None:
    decoder = FrameDecoder()
    stream = garbage + IMU_EXAMPLE + FLOW_EXAMPLE + bytes(64)
    found = decoder.feed(stream[:cut]) + decoder.feed(stream[cut:])
    assert ImuSample(123_456, (82, -41, 8192), (16, -8, 1638), 861) in found


@given(at=st.integers(0, len(IMU_EXAMPLE) - 1), flip=st.integers(1, 255))
def test_a_changed_byte_never_gives_a_sample(at: int, flip: int) -> None:
    damaged = bytearray(IMU_EXAMPLE)
    damaged[at] ^= flip
    assert FrameDecoder().feed(bytes(damaged) + bytes(64)) == []


def test_a_straight_metre() -> None:
    pose = tracked(*drive(100, 100, 0, 0.0)).truth()
    assert pose is not None
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)


def test_a_quarter_circle_to_the_left() -> None:
    pose = tracked(*drive(200, 10, 0, math.pi / 2)).truth()
    assert pose is not None
    radius = 200 * 10 / 10_000 / (math.pi / 2)
    assert (pose.x, pose.y) == pytest.approx((radius, radius), abs=1e-5)
    assert pose.heading == pytest.approx(math.pi / 2, abs=1e-6)


def test_turning_on_the_spot_moves_the_sensor_but_not_the_robot() -> None:
    steps, turn, ahead = 400, 2 * math.pi * 3, 0.1
    # The sensor is ahead of the axis: it moves to its own left, ahead * turn in all.
    sideways = round(ahead * turn / steps * 10_000)
    exact = sideways * steps / 10_000 / turn
    tracker = tracked(*drive(steps, 0, sideways, turn), mounting=Mounting(forward=exact))
    pose = tracker.truth()
    assert pose is not None
    # Chords instead of arcs: the sum is short by (turn / steps)^2 / 24 of the circle's radius.
    assert (pose.x, pose.y) == pytest.approx((0.0, 0.0), abs=exact * (turn / steps) ** 2)
    assert pose.heading == pytest.approx(turn, abs=1e-5)


def test_mounting_turns_and_mirrors_what_the_board_counts() -> None:
    mounting = Mounting(rotation=math.pi / 2, x_sign=-1, yaw_sign=-1)
    tracker = tracked(orientation(10, -0.3), flow(10, 0, 50), flow(20, 40, 0), mounting=mounting)
    pose = tracker.truth()
    assert pose is not None
    assert pose.heading == pytest.approx(0.3, abs=1e-6)
    # y of the board is the robot's backward, its negated x the robot's right.
    expected_x = -0.005 * math.cos(0.15) + 0.004 * math.sin(0.3)
    expected_y = -0.005 * math.sin(0.15) - 0.004 * math.cos(0.3)
    assert (pose.x, pose.y) == pytest.approx((expected_x, expected_y), abs=1e-7)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"x_sign": 0}, "x_sign is 0: allowed are 1 and -1"), ({"left": math.nan}, "left is nan")],
)
def test_an_impossible_mounting_is_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Mounting(**wrong)  # type: ignore[arg-type]


def test_sums_of_the_board_take_over_from_single_steps() -> None:
    tracker = tracked(
        sums(0, 2**31 - 50, 0),
        flow(10, 100, 0),
        sums(10, -(2**31) + 50, 0),
        flow(20, 7, 0),
        sums(20, -(2**31) + 57, 0),
    )
    pose = tracker.truth()
    assert pose is not None
    assert pose.x == pytest.approx(107 / 10_000)  # neither counted twice nor thrown by the wrap of the int32


def test_lost_steps_make_the_pose_invalid_for_good() -> None:
    tracker = tracked(flow(10, 5, 0), flow(120, 5, 0), flow(130, 5, 0))
    assert tracker.status is Status.INVALID
    assert tracker.truth() is None
    assert tracker.problem == "0.11 s without flow from the board"


def test_sums_bridge_a_gap_that_single_steps_cannot() -> None:
    tracker = tracked(sums(0, 0, 0), flow(10, 5, 0), sums(10, 5, 0), flow(120, 9, 0), sums(120, 105, 0))
    pose = tracker.truth()
    assert pose is not None
    assert pose.x == pytest.approx(0.0105)


def test_a_board_that_started_again_is_noticed() -> None:
    tracker = tracked(flow(10_000_000, 0, 0))
    assert tracker.lost
    restarted = tracked(flow(10, 0, 0), flow(2, 0, 0))
    assert restarted.problem == "the board started again"


def test_a_dip_of_quality_withholds_the_pose_and_a_long_one_ends_it() -> None:
    dip = tracked(flow(10, 5, 0, squal=20))
    assert (dip.status, dip.truth()) == (Status.UNCERTAIN, None)
    over = tracked(flow(10, 5, 0, squal=20), flow(20, 5, 0))
    assert at(over.truth()) == pytest.approx((0.001, 0.0, 0.0))
    lifted = tracked(*(flow(10 * step, 0, 0, squal=5) for step in range(1, 8)), flow(80, 0, 0))
    assert lifted.status is Status.INVALID
    assert "could not be followed" in lifted.problem


def test_a_turn_rate_that_is_no_number_is_left_out() -> None:
    tracker = tracked(orientation(10, 0.0, rate_deg_s=math.nan), flow(10, 5, 0))
    assert tracker.turn_rate is None
    assert tracker.status is Status.OK


def test_restart_sets_the_pose_and_trusts_it_again() -> None:
    tracker = tracked(orientation(10, 1.0), flow(10, 5, 0), flow(200, 5, 0))
    assert tracker.truth() is None
    tracker.restart(x=0.5, y=-0.25, heading=math.pi)
    for each in FrameDecoder().feed(flow(210, 100, 0)):
        tracker.take(each)
    pose = tracker.truth()
    assert pose is not None
    assert (pose.x, pose.y, pose.heading) == pytest.approx((0.49, -0.25, math.pi))


@pytest.mark.parametrize(
    ("frames", "problem"),
    [
        ([], "the board's flow sensor is not calibrated"),
        ([calibration(0, valid=False), orientation(0, 0.0), flow(0, 0, 0)], "the board's flow sensor is not"),
        ([calibration(0, 0.0), orientation(0, 0.0), flow(0, 0, 0)], "the board's flow sensor is not"),
        ([calibration(0)], "the board has not reported its attitude"),
        ([calibration(0), orientation(0, 0.0)], "the board has not reported any flow"),
        ([encode(5, 0, bytes(37))], "the board's attitude is not a rotation"),
        ([calibration(0), calibration(1, valid=False)], "the board lost its flow calibration"),
    ],
)
def test_no_pose_until_everything_is_there(frames: list[bytes], problem: str) -> None:
    tracker = FlowTracker()
    for each in FrameDecoder().feed(b"".join(frames)):
        tracker.take(each)
    assert tracker.truth() is None
    assert tracker.problem.startswith(problem)


class Bench:
    def __init__(self, peer: SerialPeer) -> None:
        self.peer = peer
        self.clock = SteppedClock()
        self.robot = StandingPort(self.clock, extra={"battery.voltage": 6.5})
        self.line = SerialLine(str(peer.path), BAUD, self.clock)
        self.board = CalibrationBoard(self.line, self.clock)
        self.port = ReferencePort(self.robot, self.board)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    peer = SerialPeer(tmp_path / "ttyACM0")
    ready = Bench(peer)
    yield ready
    ready.port.close()
    peer.unplug()


BEGIN = calibration(0) + orientation(0, 0.0, rate_deg_s=90.0) + flow(0, 0, 0)


def test_the_reference_fills_truth(bench: Bench) -> None:
    assert isinstance(bench.port, Port)
    bench.peer.say(BEGIN + flow(10, 100, 0))
    inputs = bench.port.read()
    assert at(inputs.truth) == pytest.approx((0.01, 0.0, 0.0))
    assert inputs.extra == {
        "battery.voltage": 6.5,
        "reference.turn_rate": pytest.approx(math.pi / 2),
        "reference.quality": 90.0,
    }
    assert inputs.faults == ()


def test_a_silent_board_is_a_lost_sensor_and_no_delay(bench: Bench) -> None:
    bench.peer.say(BEGIN)
    bench.port.read()
    bench.clock.advance(0.2)
    inputs = bench.port.read()
    assert inputs.truth is None
    assert inputs.faults == (Fault.SENSOR_LOST,)
    assert bench.board.status is Status.INVALID
    assert "silent" in bench.board.problem


def test_unplugging_and_plugging_in_again_ends_the_pose_but_not_the_board(bench: Bench) -> None:
    bench.peer.say(BEGIN)
    bench.port.read()
    bench.peer.unplug()
    bench.port.read()
    bench.clock.advance(1.0)
    assert bench.port.read().faults == (Fault.SENSOR_LOST,)
    bench.peer.plug()
    bench.clock.advance(1.0)
    bench.port.read()
    bench.peer.say(BEGIN + flow(10, 100, 0))
    inputs = bench.port.read()
    assert inputs.faults == ()
    assert inputs.truth is None
    assert bench.board.problem == "the board was unplugged"
    bench.board.tracker.restart()
    bench.peer.say(flow(20, 100, 0))
    assert at(bench.port.read().truth) == pytest.approx((0.01, 0.0, 0.0))


def test_a_board_without_imu_samples_is_opened_again(bench: Bench) -> None:
    bench.peer.say(imu(0))
    bench.port.read()
    for _ in range(60):
        bench.clock.advance(0.05)
        bench.port.read()
    assert bench.line.openings == 2
    bench.peer.say(imu(10))
    bench.clock.advance(1.0)
    bench.port.read()
    assert not bench.board.silent


def test_half_a_frame_waits_for_its_other_half(bench: Bench) -> None:
    bench.peer.say(BEGIN + flow(10, 100, 0)[:9])
    assert bench.port.read().truth == Truth(0.0, 0.0, 0.0)
    bench.peer.say(flow(10, 100, 0)[9:])
    assert at(bench.port.read().truth) == pytest.approx((0.01, 0.0, 0.0))


def test_commands_pass_and_the_robot_closes_first(bench: Bench) -> None:
    bench.port.write(STOP)
    assert bench.robot.written == [STOP]
    bench.port.close()
    assert bench.robot.closed == 1
    assert not bench.line.connected


def test_a_board_error_is_kept_for_people(bench: Bench) -> None:
    bench.peer.say(encode(3, 7, struct.pack("<2bBx3I2H", -1, 0, 1, 0, 0, 0, 0, 0)))
    bench.port.read()
    assert bench.board.sensors is not None
    assert bench.board.sensors.imu == -1
