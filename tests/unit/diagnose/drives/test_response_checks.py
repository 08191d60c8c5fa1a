"""Whether wheels and gyro answer the commands of their rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from blind.drives import exciting
from blind.generator import make
from blind.hidden import draw
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.directions import check_wheel_directions
from raccoon.diagnose.drives.excitation import is_driven
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.response_checks import (
    EARLIEST_GYRO_RESPONSE_S,
    EARLIEST_RESPONSE_S,
    MAX_UNEXPLAINED,
    MAX_UNEXPLAINED_GYRO,
    check_responses,
    check_signs,
)
from raccoon.diagnose.drives.response_models import estimate_response
from raccoon.diagnose.drives.row_order import check_row_order
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain

ROBOT = RobotConfig()
DUTIES, READINGS = ("motor.0.duty", "motor.1.duty"), ("motor.0.bemf", "motor.1.bemf")
GYRO = "imu.gyro.z"
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=12.0).columns)


def late(columns: Columns, names: tuple[str, ...], seconds: float) -> Columns:
    """The same with some columns as they were so long before; after, where it is negative."""
    rows = np.searchsorted(columns["t"], columns["t"] - seconds)
    moved = {name: columns[name][np.clip(rows, 0, len(rows) - 1)] for name in names}
    return {**columns, **moved}


def changed(columns: Columns, name: str, values: np.ndarray) -> Log:
    return log_from_columns({**columns, name: values}, ROBOT)


@pytest.mark.parametrize(
    "cause",
    [
        "actuation.latency",
        "imu.latency",
        "drive.wheel_slip",
        "actuation.deadband",
        "drive.backlash",
        "motor.current_limit",
        "drive.inertia",
    ],
)
@pytest.mark.parametrize("drive", ["contest", "legs"])
def test_no_cause_is_an_answer_that_is_early_or_lost(cause: str, drive: str) -> None:
    hidden = draw(cause, np.random.default_rng(3), 2.0)
    log = log_from_columns(make(8, [hidden], drive=drive, seconds=12.0).columns, ROBOT)
    check_signs(log)
    check_responses(log)


def test_commands_of_the_row_before_are_not_early(good: Columns) -> None:
    """Loggers write them so, and the diagnosis finds that out."""
    check_responses(log_from_columns(late(good, DUTIES, 0.005), ROBOT))


@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.2])
def test_commands_that_are_logged_late_are_said(good: Columns, seconds: float) -> None:
    """50 ms were a slip of 51 ms, a battery and a filter, each with a probability of 1."""
    log = log_from_columns(late(good, DUTIES, seconds), ROBOT)
    check_row_order(log)  # late is not the opposite order
    with pytest.raises(TraceError, match=r"motor\.0\.bemf responds \d+ ms before motor\.0\.duty changes"):
        check_responses(log)


def test_commands_that_are_logged_behind_a_ramp_are_said(good: Columns) -> None:
    ramped = dict(good)
    for name in DUTIES:
        duty = good[name].copy()
        for row in range(1, len(duty)):
            most = 4.0 * (good["t"][row] - good["t"][row - 1])
            duty[row] = duty[row - 1] + np.clip(good[name][row] - duty[row - 1], -most, most)
        ramped[name] = duty
    with pytest.raises(TraceError, match="behind a ramp or a filter"):
        check_responses(log_from_columns(ramped, ROBOT))


@pytest.mark.parametrize("rate", [3.0, 4.0])
def test_commands_before_a_ramp_are_said(rate: float) -> None:
    """They were a limit of the current, an inertia and a latency, each with a probability of 1."""
    asked = exciting(np.random.default_rng(3), 12.0)
    given = asked.copy()
    for row in range(1, len(given)):
        given[row] = given[row - 1] + np.clip(asked[row] - given[row - 1], -0.005 * rate, 0.005 * rate)
    columns = dict(make(21, drive=given, seconds=12.0).columns)
    check_responses(log_from_columns(columns, ROBOT))
    rows = np.clip(np.rint(columns["t"] / 0.005).astype(int), 0, len(asked) - 1)
    columns |= {name: asked[rows, index] for index, name in enumerate(DUTIES)}
    with pytest.raises(TraceError, match=r"as if a ramp of about \d a second were between them"):
        check_responses(log_from_columns(columns, ROBOT))


@pytest.mark.parametrize("limit", [0.7, 0.9])
def test_a_limit_of_the_current_is_no_ramp(limit: float) -> None:
    """A heavy robot speeds up by a ramp then, and brakes by a steeper one."""
    model = ROBOT.model
    inertias = {"inertia_straight": Measured(0.045), "inertia_turn": Measured(0.04)}
    heavy = replace(ROBOT, model=replace(model, drive=replace(model.drive, **inertias)))
    log = planned_log(exciting(np.random.default_rng(3), 12.0))
    limited = {("motor.current_limit", side, "limit"): limit for side in ("left", "right")}
    rollout = PlantRollout(log, heavy, Habits(Chain.firmware(), brake=False), plain=True)
    readings = rollout.samples([neutral_settings(heavy) | limited])[0]
    channels = [replace(each, values=values) for each, values in zip(log.channels, readings, strict=True)]
    check_responses(replace(log, channels=tuple(channels)))


@dataclass(frozen=True)
class Wheel:
    """A wheel of its own equations. settle: s; friction: duty that it takes; coasts: whether its motor lets
    go at duty 0; read: s of the reading's filter."""

    settle: float
    friction: float
    coasts: bool
    read: float = 0.0225

    def speeds(self, duty: np.ndarray, step: float = 0.001) -> tuple[np.ndarray, np.ndarray]:
        """The wheel's speed, and as it is read, of the largest."""
        speed = reading = 0.0
        found = []
        for asked in duty.tolist():
            pull = 0.0 if asked == 0.0 and self.coasts else asked - speed
            if speed == 0.0:
                pull = np.sign(pull) * max(abs(pull) - self.friction, 0.0)
            else:
                pull -= np.sign(speed) * self.friction
            after = speed + step / self.settle * pull
            speed = 0.0 if speed * after < 0.0 else after
            reading += step / self.read * (speed - reading)
            found.append((speed, reading))
        true, read = np.array(found).T
        return true, read


def legs(rng: np.random.Generator, seconds: float) -> np.ndarray:
    """Straight legs, turns on the spot and arcs, and standing between them, every ms."""
    kinds = [(1.0, 1.0)] * 4 + [(-1.0, -1.0)] * 2 + [(-1.0, 1.0), (1.0, -1.0)] * 2 + [(1.0, 0.5)]
    parts = [np.zeros((500, 2))]
    while sum(map(len, parts)) < 1000 * seconds:
        parts.append(np.tile(rng.uniform(0.4, 1.0) * np.array(kinds[rng.integers(len(kinds))]), (1000, 1)))
        parts.append(np.zeros((int(rng.uniform(150, 500)), 2)))
    return np.concatenate(parts)


def ramps(rng: np.random.Generator, seconds: float) -> np.ndarray:
    """Ramps from one speed to another, as a loop or a profile commands them, every ms."""
    parts, now = [np.zeros((500, 2))], np.zeros(2)
    while sum(map(len, parts)) < 1000 * seconds:
        goal, share = rng.uniform(-0.9, 0.9, 2), np.linspace(0.0, 1.0, int(rng.uniform(300, 1200)))[:, None]
        parts += [now + share * (goal - now), np.tile(goal, (int(rng.uniform(200, 1000)), 1))]
        now = goal
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("wheel", "program"),
    [
        (Wheel(0.05, 0.06, coasts=True), legs),  # its gyro was said to be 40 ms early
        (Wheel(0.08, 0.09, coasts=True), legs),
        (Wheel(0.018, 0.024, coasts=False), ramps),  # its wheels 20 ms
        (Wheel(0.018, 0.0, coasts=True), ramps),
        (Wheel(0.3, 0.02, coasts=False), ramps),
    ],
)
def test_a_robot_of_any_weight_that_coasts_or_drives_smoothly_answers(
    wheel: Wheel, program: Callable[[np.random.Generator, float], np.ndarray]
) -> None:
    duty = program(np.random.default_rng(0), 24.0)
    turns = [wheel.speeds(each) for each in duty.T]
    sampled = slice(None, None, 5)
    columns: Columns = {
        "t": 0.001 * np.arange(len(duty))[sampled],
        **{name: each[sampled] for name, each in zip(DUTIES, duty.T, strict=True)},
        **{name: 1100.0 * each[1][sampled] for name, each in zip(READINGS, turns, strict=True)},
        GYRO: 4.0 * (turns[1][0] - turns[0][0])[sampled],
    }
    check_responses(log_from_columns(columns, ROBOT))


def test_a_gyro_of_another_time_is_said(good: Columns) -> None:
    """It was a slip of 31 ms with a probability of 1."""
    with pytest.raises(TraceError, match=r"imu\.gyro\.z turns \d+ ms before the wheels do"):
        check_responses(log_from_columns(late(good, (GYRO,), -0.06), ROBOT))
    check_responses(log_from_columns(late(good, (GYRO,), 0.1), ROBOT))  # which is a latency


def test_a_gyro_that_is_no_turn_rate_of_this_drive_is_said(good: Columns) -> None:
    noise = np.random.default_rng(1).standard_normal(len(good["t"]))
    angle = np.degrees(np.cumsum(np.nan_to_num(good[GYRO])) * 0.02)
    for values in (noise, angle):
        with pytest.raises(TraceError, match="does not turn as the commands and the wheels do"):
            check_responses(changed(good, GYRO, values))


def test_a_wheel_that_does_not_follow_its_command_is_said(good: Columns) -> None:
    half = good["motor.0.duty"].copy()
    half[len(half) // 2 :] = 0.0
    with pytest.raises(TraceError, match=r"motor\.0\.bemf does not follow motor\.0\.duty, which explains"):
        check_responses(changed(good, "motor.0.duty", half))


def test_a_command_that_ends_in_the_last_row_has_never_changed(good: Columns) -> None:
    """A drive at one power whose stop is the last row was said not to follow its command."""
    ends = np.full(len(good["t"]), 0.4)
    ends[-1] = 0.0
    log = log_from_columns({**good, "motor.0.duty": ends, "motor.1.duty": ends}, ROBOT)
    check_responses(log)
    assert not is_driven(log)
    pulse = np.where(np.arange(len(ends)) < 40, 0.0, ends)
    assert is_driven(log_from_columns({**good, "motor.0.duty": pulse}, ROBOT))


def test_a_wheel_that_moves_without_a_command_is_said(good: Columns) -> None:
    with pytest.raises(TraceError, match=r"motor\.1\.duty is 0 all the time, but motor\.1\.bemf changes"):
        check_responses(changed(good, "motor.1.duty", 0.0 * good["t"]))
    still = {**good, "motor.1.duty": 0.0 * good["t"], "motor.1.bemf": 0.0 * good["t"]}
    del still[GYRO]
    check_responses(log_from_columns(still, ROBOT))  # a robot that drives with one wheel


@pytest.mark.parametrize("name", DUTIES)
def test_commands_without_their_sign_are_said(good: Columns, name: str) -> None:
    """One was adequate."""
    with pytest.raises(TraceError, match=f"{name} never goes below 0, but .* turns both ways"):
        check_signs(changed(good, name, np.abs(good[name])))


@pytest.mark.parametrize("name", [*READINGS, GYRO])
def test_readings_without_their_sign_are_said(good: Columns, name: str) -> None:
    said = "but .* both ways: it holds how fast"
    with pytest.raises(TraceError, match=f"{name} never goes below 0, {said}"):
        check_signs(changed(good, name, np.abs(good[name])))
    with pytest.raises(TraceError, match=f"{name} never goes above 0, {said}"):
        check_signs(changed(good, name, -np.abs(good[name])))


@pytest.mark.parametrize(("name", "zero"), [(READINGS[0], 2048.0), (READINGS[1], 2048.0), (GYRO, -12.0)])
def test_a_zero_that_is_off_by_more_than_all_turns_is_said(good: Columns, name: str, zero: float) -> None:
    with pytest.raises(TraceError, match=f"{name} never goes .* both ways: its zero is off"):
        check_signs(changed(good, name, good[name] + zero))


@pytest.mark.parametrize("name", [*READINGS, GYRO])
def test_angles_in_the_place_of_speeds_are_said(good: Columns, name: str) -> None:
    """A heading was said to hold how fast the robot turned."""
    angle = np.cumsum(np.nan_to_num(good[name])) * 0.005
    angle -= angle.min()
    with pytest.raises(TraceError, match=f"{name} never goes below 0, .* how far .* had turned, and not how"):
        check_signs(changed(good, name, angle))


@pytest.mark.parametrize("commands", [False, True])
def test_a_reading_that_was_written_twice_is_said(good: Columns, commands: bool) -> None:
    """It was a motor without a plug, beside a robot that was lifted most of the time, or another K_E."""
    twice = {**good, "motor.1.bemf": good["motor.0.bemf"]}
    if commands:
        twice["motor.1.duty"] = good["motor.0.duty"]
    with pytest.raises(TraceError, match=r"motor\.0\.bemf and motor\.1\.bemf hold the same numbers"):
        check_signs(log_from_columns(twice, ROBOT))


def test_wheels_that_do_the_same_on_a_straight_line_are_two(good: Columns) -> None:
    straight = {**good, "motor.1.bemf": good["motor.0.bemf"], "motor.1.duty": good["motor.0.duty"]}
    straight["imu.gyro.z"] = np.full_like(good["imu.gyro.z"], 0.003)
    check_signs(log_from_columns(straight, ROBOT))


def test_a_reading_that_stays_as_it_is_has_lost_no_sign(good: Columns) -> None:
    """What repeats itself holds no size either."""
    fast = int(np.argmax(good["motor.0.bemf"]))
    columns = {name: each[fast:] for name, each in good.items()}
    check_signs(changed(columns, "motor.0.bemf", np.full(len(columns["t"]), columns["motor.0.bemf"][0])))


def test_a_drive_one_way_only_has_lost_no_sign(good: Columns) -> None:
    log = log_from_columns(good, ROBOT)
    forwards = log.duty.min(axis=1) >= 0.0
    channels = tuple(replace(each, values=np.where(forwards, each.values, np.nan)) for each in log.channels)
    check_signs(replace(log, duty=np.maximum(log.duty, 0.0), channels=channels))


def test_too_little_says_nothing(good: Columns) -> None:
    log = log_from_columns({name: each[:450] for name, each in good.items()}, ROBOT)
    gyro = log.channel("gyro")
    assert gyro is not None
    assert (
        estimate_response(log.time, [0.0 * log.time], gyro, EARLIEST_GYRO_RESPONSE_S, MAX_UNEXPLAINED_GYRO)
        is None
    )
    few = replace(gyro, values=np.where(np.arange(len(log.time)) % 9 == 0, gyro.values, np.nan))
    assert estimate_response(log.time, [log.duty[:, 0]], few, EARLIEST_RESPONSE_S, MAX_UNEXPLAINED) is None


@pytest.mark.parametrize("drive", ["exciting", "contest"])
def test_commands_and_readings_that_both_lost_their_signs_are_told_by_the_gyro(drive: str) -> None:
    """They agree, and half of the drive was a robot in a hand."""
    columns = dict(make(4, drive=drive, seconds=10.0).columns)
    sizes = {name: np.abs(columns[name]) for name in (*DUTIES, *READINGS)}
    check_wheel_directions(log_from_columns(columns, ROBOT), ROBOT)
    with pytest.raises(TraceError, match=r"never go below 0, but imu\.gyro\.z says .* with their signs"):
        check_wheel_directions(log_from_columns({**columns, **sizes}, ROBOT), ROBOT)


def test_a_robot_that_only_goes_forward_has_its_signs() -> None:
    """Along arcs and around one wheel."""
    arcs = np.tile(np.repeat([[0.9, 0.4], [0.3, 0.8], [0.0, 0.6], [0.5, 0.5]], 160, axis=0), (3, 1))
    check_wheel_directions(log_from_columns(dict(make(4, drive=arcs).columns), ROBOT), ROBOT)


def test_one_motor_that_turns_the_other_way_has_its_signs() -> None:
    """Of a robot that is only driven forward, and so spins."""
    ahead = np.tile(np.repeat([[0.9, -0.7], [0.3, -0.4], [0.6, -0.6]], 160, axis=0), (4, 1))
    columns = dict(make(4, drive=ahead).columns)
    other = {name: -columns[name] for name in (DUTIES[1], READINGS[1])}
    check_wheel_directions(log_from_columns({**columns, **other}, ROBOT), ROBOT)
