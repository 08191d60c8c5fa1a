"""What wanders slowly: its columns against the simulator, and long recordings in pieces."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit import wander
from raccoon.diagnose.fit.linear_model import linearise
from raccoon.diagnose.fit.noise_model import NoiseModel
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.wander import (
    FLOOR_CORRELATION_S,
    KNOT_SPACING,
    Piece,
    covariance_of_sums,
    ornstein_uhlenbeck_basis,
    split_into_pieces,
    wandering_friction_columns,
)
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.plant.quantities import State
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

Array = NDArray[np.float64]
ROBOT = RobotConfig()
COULOMB = ROBOT.model.friction.coulomb.value
CHUNK = 20
"""Rows in which friction is held."""
RUNOUT = "drive.wheel_eccentricity@left"


def test_of_wheels_that_differ_each_has_its_own_friction_to_wander() -> None:
    """A model to start from may have more at one: the left one's was taken for both. What a share of its own
    changes is the same, however many N m that is."""
    log = planned_log(exciting(np.random.default_rng(1), 4.0))
    causes = [each for each in drive_causes() if each.id == "friction.coulomb"]
    plain = drive_problem(log, ROBOT, causes, Habits(Chain.firmware(), False), None)
    key = ("friction.coulomb", "right", "torque")
    other = replace(plain, neutral=dict(plain.neutral) | {key: 2.0 * plain.neutral[key]})
    linear = linearise(plain, plain.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    both, more = (wandering_friction_columns(each, linear) for each in (plain, other))
    np.testing.assert_allclose(more, both)


def wandering(drive: Array, course: Array, out_of_round: float) -> Array:
    """Readings (1, channels, rows) of a robot whose left wheel's friction follows a course (rows,), in parts
    of Coulomb friction."""
    time = np.arange(len(drive)) * 0.005
    commands = Commands.of_wheels(time, drive[:, 0], drive[:, 1], False)
    names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    plain = Parameters.from_robot(ROBOT).with_chain(Chain.firmware())
    plain = plain.with_effect("friction.presliding", compliance=0.001, damping=0.3)
    plain = plain.with_effect("drive.wheel_eccentricity", "left", amplitude=out_of_round, phase=0.0)
    parts: list[Array] = []
    state: dict[str, float] | None = None
    for begin in range(0, len(time) - 1, CHUNK):
        end = min(begin + CHUNK, len(time) - 1)
        torque = COULOMB * (1.0 + float(course[begin]))
        robot = plain.with_effect("friction.coulomb", "left", torque=torque)
        run = rollout(
            robot, commands, channels=names, begin=begin, end=end, initial=state, longest_step=0.001
        )
        state = dict(zip(State._fields, run.final[0], strict=True))
        rows = slice(0, None) if begin == 0 else slice(1, None)
        parts.append(np.stack([run[name][0][rows] for name in names]))
    return np.concatenate(parts, axis=1)[None]


def planned(drive: Array) -> Problem:
    log = planned_log(drive)
    return drive_problem(log, ROBOT, drive_causes(), Habits(Chain.firmware(), False), None)


@pytest.mark.parametrize("out_of_round", [0.0, 0.05])
def test_friction_that_wandered_leaves_a_wheel_that_is_not_round_turned(out_of_round: float) -> None:
    """Its torque is forgotten at once, the angle that it cost is not: seconds later a wheel that is not round
    still sways the robot at another moment."""
    drive = exciting(np.random.default_rng(4), 14.0)
    problem = planned(drive)
    features: Features = problem.features
    rows = np.arange(len(drive)) * 0.005
    corners = features.time[0] + KNOT_SPACING * FLOOR_CORRELATION_S * np.array([3.0, 4.0, 8.0, 9.0])
    shape = np.interp(rows, corners, [0.0, 0.1, 0.1, 0.0])
    still = np.zeros(len(drive))
    changed = wandering(drive, shape, out_of_round) - wandering(drive, still, out_of_round)
    truth = features.simulated(changed)[0]
    point = problem.nominal()
    if out_of_round:
        width = 2.0 * next(each.prior_width for each in problem.causes[RUNOUT].effect.parameters)
        point = Point(point.base, {RUNOUT: np.array([out_of_round / width, 0.0])})
    linear = linearise(problem, point, list(problem.causes))
    made = ornstein_uhlenbeck_basis(features.time, FLOOR_CORRELATION_S)
    slow = wandering_friction_columns(problem, linear)[: len(made)]  # of the left wheel
    wanted = np.interp(features.time, rows, shape)
    weights, *_ = np.linalg.lstsq(made.T, wanted, rcond=None)
    foretold = np.tensordot(weights, slow, axes=1)
    gyro, late = features.roles.index("gyro"), features.time > corners[-1] + 1.0
    early = (features.time > corners[0]) & (features.time < corners[-1])
    assert _unlike(foretold[early, gyro], truth[early, gyro]) < 0.15
    if out_of_round:
        assert np.abs(truth[late, gyro]).max() > 0.003
        assert _unlike(foretold[late, gyro], truth[late, gyro]) < 0.1
    else:
        assert np.abs(foretold[late, gyro]).max() < 1e-4


def test_a_recording_is_followed_in_pieces_of_whole_half_seconds() -> None:
    """So the directions of what wanders, and their time and memory, do not grow in each."""
    features = planned(exciting(np.random.default_rng(4), 20.0)).features
    assert split_into_pieces(features) == [slice(0, len(features.time))]
    for seconds in (59.0, 61.0, 100.0, 233.3):
        long = replace(features, time=np.arange(0.0, seconds, features.width))
        found = split_into_pieces(long)
        assert found[0].start == 0
        assert found[-1].stop == len(long.time)
        for one, other in pairwise(found):
            assert one.stop == other.start
            assert one.stop % long.event == 0
        assert all(25.0 < (each.stop - each.start) * long.width < 60.0 for each in found)


def test_a_piece_is_white_in_the_noise_that_remembers_what_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = planned(exciting(np.random.default_rng(4), 10.0))
    monkeypatch.setattr(wander, "PIECE_S", 4.0)
    first, second = split_into_pieces(problem.features)
    linear = linearise(problem, problem.nominal(), ["friction.coulomb@left"])
    bins, channels = linear.residual.shape
    rng = np.random.default_rng(2)
    regimes = np.asarray(rng.integers(0, 4, bins), np.intp)
    noise = NoiseModel(
        0.1 * rng.normal(size=(6, channels, channels)),
        np.stack([np.eye(channels) * each for each in (1.0, 2.0, 3.0, 4.0)]),
        regimes,
        np.asarray(rng.uniform(0.5, 1.0, bins), float),
    )
    for bins_of in (first, second):
        piece = Piece.of(problem, linear, bins_of, 12)
        whole = rng.normal(size=(2, bins, channels))
        np.testing.assert_allclose(
            piece.whitened(noise, whole[:, piece.span]), noise.whiten(whole)[:, bins_of], atol=1e-12
        )
        assert piece.inside(piece.friction).shape[1] == bins_of.stop - bins_of.start
        assert np.abs(piece.creep).max() > 0.0


def test_in_pieces_much_the_same_wanders_as_in_one() -> None:
    """The variance of each reading, which for a wheel that is not round holds all angles lost before."""
    problem = planned(exciting(np.random.default_rng(4), 24.0))
    width = 2.0 * next(each.prior_width for each in problem.causes[RUNOUT].effect.parameters)
    round_, odd = problem.nominal(), problem.nominal().with_cause(RUNOUT, np.array([0.05 / width, 0.0]))
    for point in (round_, odd):
        linear = linearise(problem, point, ["friction.coulomb@left"])
        late = slice(600, None)
        whole = (wandering_friction_columns(problem, linear)[:, late] ** 2).sum(axis=0)
        piece = (wandering_friction_columns(problem, linear, bins=late) ** 2).sum(axis=0)
        np.testing.assert_allclose(piece.mean(axis=0), whole.mean(axis=0), rtol=0.1)


def test_a_course_is_that_of_a_process_which_forgets_itself() -> None:
    """At its knots, and beside a gap, in which it forgets and takes no room: an hour of it took more memory
    than there is."""
    seconds, step = 2.0, KNOT_SPACING * 2.0
    time = step * np.arange(40.0)
    for gap in (0.0, 3.0 * step, 9000.0 * step):
        late = time + gap * (np.arange(40) >= 25)
        made = ornstein_uhlenbeck_basis(late, seconds)
        assert len(made) <= len(time) + 3
        exact = np.exp(-np.abs(late[:, None] - late) / seconds)
        np.testing.assert_allclose(made.T @ made, exact, atol=1e-9)
    between = ornstein_uhlenbeck_basis(0.25 * time, seconds)  # on straight lines from knot to knot
    knots = np.exp(-step / seconds)
    assert (between[:, 2] ** 2).sum() == pytest.approx(0.5 + 0.5 * knots)


@pytest.mark.parametrize("seconds", [4.0, 0.05])
def test_sums_over_a_course_have_the_covariance_of_its_correlation(seconds: float) -> None:
    """Also of a long one, over which the exponential function is beyond any number, and with a gap."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.01, 0.2, 700))
    time[300:] += 30.0
    weights = rng.normal(size=(2, len(time)))
    exact = weights @ np.exp(-np.abs(time[:, None] - time) / seconds) @ weights.T
    np.testing.assert_allclose(covariance_of_sums(weights, time, seconds), exact, rtol=1e-9)
    np.testing.assert_allclose(
        covariance_of_sums(weights[:, :1], time[:1], seconds), weights[:, :1] @ weights[:, :1].T
    )


def _unlike(one: Array, other: Array) -> float:
    """Size of what one is off by, as a part of the other."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))
