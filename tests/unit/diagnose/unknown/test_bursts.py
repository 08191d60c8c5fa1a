"""Errors that come where speeds change, and nowhere else, are no noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.fit.noise_model import CHANGING, STANDING, STEADY, Regimes
from raccoon.diagnose.result import Verdict
from raccoon.diagnose.unknown.bursts import DEPENDS_ON, Bursts, find_bursts
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import BLIND_CONTROLLER

Array = NDArray[np.float64]
ROLES = ("bemf_left", "gyro", "battery")
REGIMES = np.repeat([STEADY, CHANGING], 100)


def said_of(gyro: tuple[float, float], wheel: tuple[float, float] = (2.0, 10.0)) -> tuple[str, ...]:
    """Of errors in steady driving and where speeds change."""
    random = np.random.default_rng(1)
    sizes = np.repeat([[wheel[0], gyro[0], 0.1], [wheel[1], gyro[1], 9.0]], 100, axis=0)
    return told_of(ROLES, sizes * random.standard_normal((200, 3)), REGIMES)


def told_of(roles: tuple[str, ...], left: Array, regimes: Regimes, play: bool = False) -> tuple[str, ...]:
    """Of what is left of a drive whose bins come one a quarter of a second; nothing in it comes only once."""
    found = find_bursts(
        roles, np.full(left.shape, 1500.0), left, np.linspace(0.0, 0.25 * len(left), len(left)), regimes, play
    )
    assert not found.moments
    return found.told


def test_what_is_only_larger_where_speeds_change_is_noise() -> None:
    assert said_of(gyro=(0.004, 0.04)) == ()
    assert said_of(gyro=(0.02, 0.2)) == ()
    assert said_of(gyro=(0.0005, 0.02)) == ()


def test_bursts_are_told_with_their_size() -> None:
    (said,) = said_of(gyro=(0.003, 0.15))
    assert said.startswith("the remaining error of the gyro occurs where wheels speed up or brake")
    assert "the tyres spin or skid, or something is loose" in said
    assert said.endswith("log each when it is given")  # of a sound robot that was logged by another clock too
    (said,) = said_of(gyro=(0.003, 0.02), wheel=(3.0, 150.0))
    assert said.startswith("the remaining error of the left wheel occurs")


def beside_wheels(pushes: float, body: float, gyro: float = 0.008, play: bool = False) -> tuple[str, ...]:
    """Of a robot whose wheels are pushed by so many counts where speeds change, which its gyro sees a bin
    sooner than a filtered reading, whose body turns by as much more, and whose gyro has noise."""
    random = np.random.default_rng(1)
    regimes = np.repeat([STANDING, STEADY, CHANGING], 200)
    changes = (regimes == CHANGING)[:, None]
    pushed = changes * pushes * random.standard_normal((600, 2))
    turned = 6.6e-4 * (pushed[:, 1] - pushed[:, 0]) + changes[:, 0] * body * random.standard_normal(600)
    left = np.column_stack([np.roll(pushed, 1, axis=0), turned + gyro * random.standard_normal(600)])
    return told_of(("bemf_left", "bemf_right", "gyro"), left, regimes, play)


def test_a_body_that_turns_as_no_wheel_does_is_told() -> None:
    (said,) = beside_wheels(pushes=25.0, body=0.06)
    assert said.startswith("where wheels speed up or brake, the gyro reads 0.061 rad/s that no wheel's")
    assert beside_wheels(pushes=25.0, body=0.06, play=True) == ()
    assert beside_wheels(pushes=70.0, body=0.0) == ()
    assert beside_wheels(pushes=25.0, body=0.0, gyro=0.06) == ()


def test_the_unknown_age_of_samples_in_their_rows_is_no_burst() -> None:
    """A turn rate that swings by 1 rad/s at 3 Hz, read up to a row of 20 ms late: 0.077 rad/s (RMS) is the
    age times the acceleration. What is 0.1 rad/s beyond that is a burst."""
    random, ages = np.random.default_rng(4), np.tile((np.arange(50) + 0.5) / 50, 16) - 0.5
    time, regimes = np.linspace(0.0, 15.98, 800), np.repeat([STEADY, CHANGING], 400)
    turning = np.where(regimes == CHANGING, 1.0, 0.0)
    turn_rate = np.asarray(turning * np.sin(6.0 * np.pi * time), np.float64)
    for age_std, body, told in ((0.00577, 0.0, 0), (0.00577, 0.1, 1), (0.0003, 0.0, 1)):
        late = turn_rate - np.sin(6.0 * np.pi * (time - 0.02 * ages)) * turning
        noise = random.standard_normal((800, 3)) * [1.0, 1.0, 0.002]
        left: Array = noise + np.outer(body * turning * ages / np.std(ages) + late, [0.0, 0.0, 1.0])
        measured = np.column_stack([np.full((800, 2), 1500.0), turn_rate + left[:, 2]])
        found = find_bursts(
            ("bemf_left", "bemf_right", "gyro"), measured, left, time, regimes, age_std=age_std
        )
        assert len(found.told) == told, (age_std, body)


def test_too_little_of_a_drive_says_nothing() -> None:
    zeros = np.zeros((30, 3))
    regimes = np.repeat([STEADY, CHANGING], [20, 10])
    assert find_bursts(ROLES, zeros, zeros + 1.0, np.linspace(0.0, 29.0, 30), regimes) == Bursts()


def test_what_comes_in_two_moments_only_has_happened_and_is_no_fault() -> None:
    """A wheel that slips on a pipe for 0.4 s turns the robot by 0.6 rad/s that no wheel reads."""
    random = np.random.default_rng(2)
    time = np.linspace(0.0, 39.98, 2000)
    regimes = np.tile(np.repeat([STANDING, STEADY, CHANGING], [10, 20, 20]), 40)
    left = np.array([4.0, 4.0, 0.004]) * random.standard_normal((2000, 3))
    for start in (520, 1280):
        left[start : start + 20, 2] += 0.6
    found = find_bursts(("bemf_left", "bemf_right", "gyro"), np.full((2000, 3), 1500.0), left, time, regimes)
    assert found.told == ()
    short = time < 12.0
    once = find_bursts(
        ("bemf_left", "bemf_right", "gyro"), left[short], left[short], time[short], regimes[short]
    )
    assert once.moments == pytest.approx((10.6,), abs=0.25)
    assert found.moments == pytest.approx((10.6, 25.8), abs=0.25) or found.moments == pytest.approx(
        (25.8, 10.6), abs=0.25
    )


@pytest.mark.parametrize(("size", "seconds"), [(0.0, 8.0), (1.0, 14.0)])
def test_a_robot_that_jerks_at_random_where_it_speeds_up_is_not_adequate(size: float, seconds: float) -> None:
    """0.06 s of turning, either way, after each step of the commands: no cause and no curve has that."""
    random = np.random.default_rng(3)
    duty = exciting(random, seconds)
    time = np.arange(len(duty)) * 0.005
    commands = Commands.of_wheels(time, duty[:, 0], duty[:, 1], False)
    robot = Parameters.from_robot(RobotConfig()).with_chain(Chain.firmware())
    run = rollout(robot, commands, noise=Noise(), seed=3)
    columns = {name: np.array(run[name][0]) for name in run.channels if not name.startswith("truth.")}
    steps = np.flatnonzero(np.abs(np.diff(duty, axis=0)).max(axis=1) > 0.3)
    for step in steps:
        columns["imu.gyro.z"][step + 6 : step + 18] += size * random.choice([-1.0, 1.0])
    columns |= {"t": time, "motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}
    said = diagnose(columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    jerks = size > 0.0
    assert said.causes == ()
    assert (DEPENDS_ON in said.unexplained.depends_on) is jerks
    assert said.verdict is (Verdict.UNKNOWN if jerks else Verdict.ADEQUATE)
    assert any("the gyro occurs where wheels speed up" in note for note in said.notes) is jerks
