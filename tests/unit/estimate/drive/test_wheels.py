import math
from dataclasses import replace
from typing import Any

import pytest

from raccoon.core.config import Measured, MotorConfig, RobotConfig, parse_robot
from raccoon.core.readings import SIMULATOR, Fault, Inputs
from raccoon.estimate.drive.wheel_track import HOLD_S, WheelTrack
from raccoon.estimate.drive.wheels import WheelDecoder, lag_seconds
from raccoon.model.bemf import counter_lag

PER_COUNT = SIMULATOR.bemf_volts / 1.08


def inputs(time: float, bemf: tuple[Any, ...] = (), position: tuple[Any, ...] = (), **more: Any) -> Inputs:
    def padded(words: tuple[Any, ...]) -> tuple[Any, ...]:
        return (*words, *(None,) * (4 - len(words)))

    return Inputs(time, SIMULATOR, bemf=padded(bemf), position=padded(position), **more)


def test_uncalibrated_motor_is_scaled_by_its_back_emf_constant() -> None:
    robot = parse_robot({"model": {"motor": {"right": {"back_emf_constant": 1.0}}}})
    reading = WheelDecoder(robot).decode(inputs(0.0, (100.0, 100.0)))
    assert reading.left_speed == pytest.approx(100 * PER_COUNT)
    assert reading.right_speed == pytest.approx(100 * SIMULATOR.bemf_volts)


def test_calibrated_motor_is_scaled_by_its_ticks_whatever_a_tick_is() -> None:
    robot = RobotConfig(motors={0: MotorConfig(radians_per_tick=Measured(0.8))})
    decoder = WheelDecoder(robot)
    device = replace(SIMULATOR, position_counts_seconds=250.0)
    decoder.decode(replace(inputs(0.0, (100.0,), (10.0,)), device=device))
    reading = decoder.decode(replace(inputs(0.1, (100.0,), (12.0,)), device=device))
    assert reading.left_angle == pytest.approx(1.6)
    assert reading.left_speed == pytest.approx(100 * 0.8 / 250)


def test_offset_is_taken_from_speed_and_from_counter() -> None:
    robot = RobotConfig(motors={0: MotorConfig(bemf_offset=Measured(30.0))})
    decoder = WheelDecoder(robot)
    decoder.decode(inputs(0.0, (30.0,), (0.0,)))
    reading = decoder.decode(inputs(0.1, (30.0,), (3.0,)))
    assert reading.left_speed == pytest.approx(0.0)
    assert reading.left_angle == pytest.approx(0.0)


def test_wiring_sign_turns_speed_and_angle_but_the_offset_belongs_to_the_board() -> None:
    robot = RobotConfig(motors={1: MotorConfig(inverted=True, bemf_offset=Measured(20.0))})
    decoder = WheelDecoder(robot)
    decoder.decode(inputs(0.0, (0.0, 0.0), (0.0, 0.0)))
    reading = decoder.decode(inputs(0.1, (0.0, -80.0), (0.0, -8.0)))
    assert reading.right_speed == pytest.approx(100 * PER_COUNT)
    assert reading.right_angle == pytest.approx(10 * PER_COUNT)


def test_ports_are_those_of_the_drive() -> None:
    robot = parse_robot({"drive": {"left": 3, "right": 2}})
    reading = WheelDecoder(robot).decode(inputs(0.0, (1.0, 2.0, 3.0, 4.0)))
    assert reading.left_speed == pytest.approx(4 * PER_COUNT)
    assert reading.right_speed == pytest.approx(3 * PER_COUNT)


def test_absent_words_stay_absent_and_the_counter_catches_up() -> None:
    decoder = WheelDecoder(RobotConfig())
    decoder.decode(inputs(0.0, (), (0.0, 0.0)))
    assert decoder.decode(inputs(0.1)).left_angle is None
    reading = decoder.decode(inputs(0.2, (), (40.0, 40.0)))
    assert reading.left_angle == pytest.approx(40 * PER_COUNT)
    assert reading.dt == pytest.approx(0.1)


@pytest.mark.parametrize("time", [0.1, 0.05, -3.0, math.nan])
def test_time_that_stands_still_or_runs_back_gives_nothing(time: float) -> None:
    decoder = WheelDecoder(RobotConfig())
    decoder.decode(inputs(0.1, (), (0.0, 0.0)))
    reading = decoder.decode(inputs(time, (500.0, 500.0), (50.0, 50.0)))
    assert (reading.dt, reading.left_speed, reading.left_angle) == (0.0, None, None)


def test_counter_that_moves_further_than_a_wheel_can_is_left_out_once() -> None:
    decoder = WheelDecoder(RobotConfig())
    decoder.decode(inputs(0.0, (), (0.0, 0.0)))
    jumped = decoder.decode(inputs(0.005, (), (1e6, 5.0)))
    assert (jumped.left_angle, jumped.left_jumped, jumped.right_jumped) == (None, True, False)
    after = decoder.decode(inputs(0.010, (), (1e6 + 5, 10.0)))
    assert after.left_angle == pytest.approx(5 * PER_COUNT)
    assert not after.left_jumped


@pytest.mark.parametrize("fault", [Fault.RESET, Fault.POSITION_JUMP])
def test_counter_of_a_cycle_with_an_announced_jump_is_left_out(fault: Fault) -> None:
    decoder = WheelDecoder(RobotConfig())
    decoder.decode(inputs(0.0, (), (7.0, 7.0)))
    assert decoder.decode(inputs(0.005, (), (0.0, 0.0), faults=(fault,))).left_angle is None


@pytest.mark.parametrize("word", [math.nan, math.inf, -math.inf])
def test_word_that_is_not_a_number_is_left_out_and_told(word: float) -> None:
    for bemf, position in ((word, word), (word, 1.0), (1.0, word)):
        decoder = WheelDecoder(RobotConfig())
        decoder.decode(inputs(0.0, (0.0, 0.0), (0.0, 0.0)))
        reading = decoder.decode(inputs(0.005, (bemf, 1.0), (position, 1.0)))
        assert reading.not_a_number
        assert (reading.left_speed is None) is (bemf is word)
        assert (reading.left_angle is None) is (position is word)
        assert reading.right_speed is not None


def test_the_device_knows_its_lag_unless_robot_toml_does() -> None:
    board = replace(SIMULATOR, bemf_lag=0.0128)
    assert lag_seconds(RobotConfig(), board) == 0.0128
    assert lag_seconds(RobotConfig(), SIMULATOR) == pytest.approx(counter_lag(0.0225, 0.005))
    own = parse_robot({"model": {"bemf": {"filter_time_constant": {"value": 0.03, "std": 0.001}}}})
    assert lag_seconds(own, board) == pytest.approx(0.03 - 0.005, abs=1e-4)


def test_a_zero_of_a_device_with_a_dead_zone_is_not_standing_still() -> None:
    board = replace(SIMULATOR, bemf_dead_zone=40.0)
    decoder = WheelDecoder(RobotConfig())
    decoder.decode(replace(inputs(0.0, (0, 0), (0, 0)), device=board))
    reading = decoder.decode(replace(inputs(0.005, (0, 12), (0, 0)), device=board))
    assert (reading.left_blind, reading.right_blind) == (True, False)
    assert not decoder.decode(inputs(0.010, (0, 0), (0, 0))).left_blind


def turning(lag: float = 0.02) -> WheelTrack:
    """A wheel that has turned at 3 rad/s for a second."""
    track = WheelTrack(lag)
    for _ in range(200):
        track.update(0.005, 3.0, 0.015)
    return track


def silent(track: WheelTrack, seconds: float) -> float:
    """rad that it is taken to turn while nothing is read."""
    guessed = 0.0
    for _ in range(round(seconds / 0.005)):
        track.update(0.005, None, None)
        guessed += track.increment
    return guessed


def test_a_silent_wheel_turns_on_for_a_while_and_its_counter_makes_up_for_the_rest() -> None:
    track = turning()
    guessed = silent(track, 0.2)
    assert guessed == pytest.approx(3.0 * HOLD_S)
    assert (track.increment, track.speed, track.settled_speed) == (0.0, 0.0, 0.0)
    track.update(0.005, 2.0, 0.5)  # what it turned, and the filter that is behind by less than before
    assert guessed + track.increment == pytest.approx(0.5 + 0.02 * (2.0 - 3.0))
    assert (track.speed, track.guessed_angle) == (2.0, 0.0)


def test_a_silent_wheel_without_a_counter_may_have_turned_on_all_the_while() -> None:
    track = turning()
    silent(track, 0.2)
    track.update(0.005, 3.0, None)
    assert track.increment == 0.0
    assert track.guessed_angle == pytest.approx(3.0 * 0.205)


def test_a_board_that_restarts_has_a_filter_that_begins_anew() -> None:
    """What it reads then is no sudden stop, of which the filter would be behind."""
    track = turning()
    track.take_counter_jump(0.005)
    assert track.guessed_angle == pytest.approx(3.0 * 0.005)
    track.update(0.005, 0.0, 0.0)
    assert track.increment == 0.0
