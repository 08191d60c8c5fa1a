"""What the drive filter does by itself, held to closed forms: gaps, doubt, priors, and what is published."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.estimate_builder import build_estimate
from raccoon.estimate.drive.fusion import Fusion
from raccoon.estimate.drive.noise import UNCOUNTED_CORRELATION, WheelNoise
from raccoon.estimate.drive.observations import WheelTravel
from raccoon.estimate.drive.prior import process_noise, scale_covariance, scale_std
from raccoon.estimate.drive.readings import DriveReadings
from raccoon.estimate.drive.standstill import CreepDetector, StandstillDetector
from raccoon.estimate.drive.wheel_track import WheelTrack
from raccoon.estimate.ekf.bridge import bridge_gap
from raccoon.estimate.ekf.filter import DriveFilter, ProcessNoise, covariance_of, flatten, mean_of
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, OdometrySettings, State, wheel_scales
from raccoon.model.bemf import counts_scale
from raccoon.model.drive import DriveGeometry

GEOMETRY = DriveGeometry(0.0345, 0.16)
STILL = ProcessNoise(0.0, 0.0, 0.0, 0.0, 0.0)
MEAN = np.array([0.3, -0.2, 0.7, 0.15, 0.4, 0.002, 0.01, -0.02, 1.05, 0.03, 0.97, 1.01, 0.012])
POSE = slice(State.X, State.VELOCITY)


def slopes(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Derivative by central differences, (values, inputs)."""
    columns = [(function(at + h) - function(at - h)) / (2.0 * step) for h in step * np.eye(len(at))]
    return np.array(columns).T


def certain(mean: Array = MEAN, noise: ProcessNoise = STILL) -> DriveFilter:
    return DriveFilter(mean, np.zeros((SIZE, SIZE)), GEOMETRY, noise)


def test_a_gap_carries_all_that_is_not_known_along_its_slopes() -> None:
    """A way without a turn: where it turned would be in doubt besides. What the wheels, which are ahead of
    the gyro, had told before the gap of a turn that ended is what they turn less in it."""
    early = 0.012 * (0.4 - 0.1)
    left = 0.0345 / 0.97 * (4.0 - 0.01 * 3.0)
    angles = 4.0, (left - early * 0.97 * 0.16) * 1.03 / 0.0345 - 0.02 * 3.0
    random = np.random.default_rng(0)
    A = 1e-3 * random.normal(size=(SIZE, SIZE))
    A[State.TURN_RATE] = 0.0  # taken as it is
    P, noise = A @ A.T, np.array([[2e-6, 5e-7], [5e-7, 1e-6]])

    def moved(both: Array) -> Array:
        state, turned = both[:SIZE], (both[SIZE], both[SIZE + 1])
        return bridge_gap(state, 0.0 * P, 3.0, turned, 0.0 * noise, GEOMETRY, 0.1)[0][POSE]

    F = slopes(moved, np.concatenate([MEAN, angles]))
    mean, found, travel = bridge_gap(MEAN, P, 3.0, angles, noise, GEOMETRY, 0.1)
    expected = F[:, :SIZE] @ P @ F[:, :SIZE].T + F[:, SIZE:] @ noise @ F[:, SIZE:].T
    np.testing.assert_allclose(found[POSE, POSE], expected, rtol=1e-5, atol=1e-15)
    assert travel == pytest.approx(1.05 * (left - 0.5 * early * 0.97 * 0.16))
    np.testing.assert_allclose(mean[POSE], [0.3 + travel * math.cos(0.7), -0.2 + travel * math.sin(0.7), 0.7])


def test_when_it_turned_in_a_gap_nobody_knows() -> None:
    angles = (0.0, 0.6 * 0.97 * 0.16 * 1.03 / 0.0345)
    mean = MEAN.copy()
    mean[[State.LEFT_OFFSET, State.RIGHT_OFFSET, State.GYRO_DELAY]] = 0.0
    nothing = np.zeros((SIZE, SIZE))
    _, P, travel = bridge_gap(mean, nothing, 3.0, angles, nothing[:2, :2], GEOMETRY, 0.0)
    aside = travel * 0.3 / math.sqrt(3.0)
    np.testing.assert_allclose(P[POSE, POSE], np.diag([aside**2, aside**2, 0.0]), rtol=1e-9, atol=1e-18)


def test_the_slow_numbers_wander_in_a_gap_as_they_do_in_steps() -> None:
    noise = ProcessNoise(0.1, 0.2, 1e-6, 2e-6, 3e-6)
    stepped, gap = certain(noise=noise), certain(noise=noise)
    stepped.predict(2.0)
    gap.bridge(2.0, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0))
    slow = slice(State.GYRO_BIAS, SIZE)
    expected, found = (covariance_of(each.flat)[slow, slow] for each in (stepped, gap))
    np.testing.assert_allclose(found, expected)
    assert expected[3, 5] == pytest.approx(-6e-6)  # of way and wheel turn


def test_what_both_wheels_turned_alike_and_uncounted_is_way_and_no_turn() -> None:
    drive = certain(np.array([0.0] * 8 + [1.0, 0.0, 1.0, 1.0, 0.0]))
    drive.bridge(1.0, (2.0, 2.0), (0.04, 0.04), 0.0, 0.036, (0.0, 0.0))
    P = covariance_of(drive.flat)
    assert P[State.X, State.X] == pytest.approx((0.0345 / 2.0) ** 2 * 2.0 * (0.04 + 0.036))
    assert P[State.HEADING, State.HEADING] == pytest.approx((0.0345 / 0.16) ** 2 * 2.0 * (0.04 - 0.036))
    lost = WheelTrack(0.0), WheelTrack(0.0)
    lost[0].guessed_angle, lost[1].guessed_angle = 0.1, 0.2
    noise = WheelNoise(RobotConfig(), OdometrySettings(), SIMULATOR)
    assert noise.angle_covariance(*lost) == pytest.approx(UNCOUNTED_CORRELATION * 0.02)


def test_a_doubt_ahead_is_none_across_and_one_aside_is_none_along() -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    ahead, aside = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
    for doubts in ((0.04, 0.0), (0.0, 0.02), (0.04, 0.02)):
        drive = certain()
        drive.widen_along(*doubts)
        expected = doubts[0] * np.outer(ahead, ahead) + doubts[1] * np.outer(aside, aside)
        np.testing.assert_allclose(covariance_of(drive.flat)[POSE, POSE], expected, atol=1e-15)


def test_a_bias_that_is_doubted_has_turned_the_heading_the_other_way_all_the_while() -> None:
    drive = certain()
    drive.widen_bias(0.02, 3.0)
    J = np.zeros(SIZE)
    J[State.GYRO_BIAS], J[State.HEADING] = 0.02, -0.02 * 3.0
    np.testing.assert_allclose(covariance_of(drive.flat), np.outer(J, J), atol=1e-15)


def some_covariance() -> Array:
    A: Array = 1e-2 * np.random.default_rng(0).normal(size=(SIZE, SIZE))
    return A @ A.T


def test_a_doubt_of_the_way_leaves_what_is_known_of_the_rest_for_each_way() -> None:
    def given_the_way(P: Array) -> Array:
        rest: Array = P - np.outer(P[State.WAY], P[State.WAY]) / P[State.WAY, State.WAY]
        return rest

    P = some_covariance()
    drive = DriveFilter(MEAN, P, GEOMETRY, STILL)
    drive.widen_way(0.05, 0.0)
    found = covariance_of(drive.flat)
    assert found[State.WAY, State.WAY] == pytest.approx(P[State.WAY, State.WAY] + 0.05**2)
    np.testing.assert_allclose(given_the_way(found), given_the_way(P), atol=1e-12)
    drive.flat = flatten(MEAN, P)
    drive.widen_way(0.0, 0.05)
    more = covariance_of(drive.flat) - P
    assert more[State.WAY, State.WAY] == pytest.approx(0.05**2)
    assert not more[[State.WHEEL_TURN, State.GYRO_SCALE, State.GYRO_DELAY]].any()
    drive = certain()
    drive.widen_way(0.05, 0.05)  # of a way that is known nothing hangs together
    assert drive.flat == certain().flat


def test_the_pose_of_another_belief_is_all_that_is_taken_of_it() -> None:
    P = some_covariance()
    drive, other = DriveFilter(MEAN, P, GEOMETRY, STILL), flatten(2.0 * MEAN, 3.0 * P)
    drive.copy_pose(other)
    mean, found = mean_of(drive.flat), covariance_of(drive.flat)
    pose, rest = slice(State.X, State.VELOCITY), slice(State.VELOCITY, SIZE)
    np.testing.assert_array_equal(mean, [*2.0 * MEAN[pose], *MEAN[rest]])
    np.testing.assert_array_equal(found[pose, pose], 3.0 * P[pose, pose])
    np.testing.assert_array_equal(found[rest, rest], P[rest, rest])
    assert not found[pose, rest].any()


def test_priors_of_wheel_scales_and_track_are_those_of_the_states_that_hold_them() -> None:
    def states(errors: Array) -> Array:
        """Way, balance and wheel turn by the relative errors of left wheel, right wheel and track width."""
        left, right, track = 1.0 + errors
        way, balance = 2.0 / (left + right), (right - left) / (left + right)
        assert wheel_scales(way, balance) == pytest.approx((left, right))
        return np.array([way, balance, track / way])  # the wheels' turn is that of a track so much wider

    H = slopes(states, np.zeros(3))
    deviations = np.array([0.01, 0.02, 0.03])
    np.testing.assert_allclose(scale_covariance(*deviations), H @ np.diag(deviations**2) @ H.T, rtol=1e-6)


def test_a_motor_without_ticks_is_as_sure_as_its_wheel_and_its_magnet_and_as_such_motors_are() -> None:
    of_radius = {"wheel_radius": {"value": 0.0345, "std": 0.03 * 0.0345}}
    robot = parse_robot(
        {"model": {"drive": of_radius, "motor": {"back_emf_constant": {"value": 1.08, "std": 0.04 * 1.08}}}}
    )
    for least, expected in ((0.01, 0.05), (0.06, 0.06)):
        settings = OdometrySettings(uncalibrated_scale=least)
        assert scale_std(robot, settings, "left") == pytest.approx(expected)


def test_scales_that_are_doubted_and_that_wander_do_so_as_both_wheels_scales() -> None:
    scales = slice(State.WAY, State.GYRO_SCALE)
    drive = certain()
    drive.widen_scales(0.05)
    np.testing.assert_allclose(covariance_of(drive.flat)[scales, scales], scale_covariance(0.05, 0.05, 0.0))
    drive = certain(noise=process_noise(RobotConfig(), OdometrySettings(scale_walk=0.05), 1.0))
    drive.predict(4.0)
    np.testing.assert_allclose(
        covariance_of(drive.flat)[scales, scales], scale_covariance(0.1, 0.1, 0.0), atol=1e-15
    )


def test_a_taped_way_moves_the_states_along_its_slopes() -> None:
    way = WheelTravel(left=12.0, right=14.0, seconds=5.0)
    H = slopes(lambda state: way.expected(state, 0.0345), MEAN)
    np.testing.assert_allclose(way.jacobian(MEAN, 0.0345), H, rtol=1e-7, atol=1e-9)
    # It is as sure as the tape, and as what the wheels slip on it.
    fusion = Fusion(certain(), OdometrySettings(slip_noise=0.05))
    fusion.wheel_travel = way
    taped = way.expected(MEAN, 0.0345)[0] - 0.02
    seen = fusion.observe_way(taped, 0.03)
    assert seen.mahalanobis == pytest.approx(0.02 / math.sqrt(0.03**2 + 0.05**2 * taped))


def test_a_wheel_whose_ticks_are_all_there_is_errs_by_a_tick_at_either_end() -> None:
    """Each of the two counts is off by a part of a tick, evenly: a twelfth of a tick squared."""
    wheel, settings = WheelTrack(0.0), OdometrySettings(slip_noise=0.0, timing=0.0)
    tick = counts_scale(RobotConfig(), "left", SIMULATOR) * SIMULATOR.position_counts_seconds
    variance = WheelNoise(RobotConfig(), settings, SIMULATOR).variance(wheel, 0.0, 0.02)
    assert variance == pytest.approx(2.0 * (tick / 0.02) ** 2 / 12.0, rel=1e-4)


def test_a_way_slips_by_its_square_root_and_one_nobody_reads_may_be_any() -> None:
    """Alike in steps, as a mean speed, and in a gap, as an angle."""
    settings, span, angle = OdometrySettings(slip_noise=0.05, timing=0.0), 0.5, -4.0
    noise, wheel = WheelNoise(RobotConfig(), settings, SIMULATOR), WheelTrack(0.0)
    radius = RobotConfig().model.drive.wheel_radius.value
    slip = 0.05**2 * abs(angle * radius) / radius**2
    assert noise.angle_variance(wheel, angle, span) - noise.angle_variance(wheel, 0.0, span) == pytest.approx(
        slip
    )
    of_speed = noise.variance(wheel, angle / span, span) - noise.variance(wheel, 0.0, span)
    assert of_speed == pytest.approx(slip / span**2)
    wheel.silence = 1.0
    assert noise.angle_variance(wheel, angle, span) == pytest.approx(
        noise.variance(wheel, 0.0, span) * span**2
    )


@pytest.mark.parametrize("arc", [0.5 * math.pi, math.pi])
def test_wheels_that_are_not_round_err_by_the_mean_of_their_runout_over_the_arc(arc: float) -> None:
    """Each by the integral of runout sin(angle + where it began), from any beginning; half the difference of
    the two counts."""
    settings = OdometrySettings(runout=0.01)
    span, speed = 0.02, 4.0
    wobble = WheelNoise(RobotConfig(), settings, SIMULATOR).runout_variance(speed, -speed, span)
    of_angle = wobble * span**2 * arc / (speed * span)  # the sum of so many steps
    begun = np.linspace(0.0, 2.0 * math.pi, 1000, endpoint=False)
    of_wheel = np.mean((0.01 * (np.cos(begun) - np.cos(begun + arc))) ** 2)
    assert of_angle == pytest.approx(0.25 * 2.0 * of_wheel, rel=0.15)


def said(delay: float, held: bool = False) -> tuple[Array, float, float, float, float]:
    """Covariance of the filter, and x, y, heading and deviation of the speed that are published of it."""
    A = 1e-2 * np.random.default_rng(1).normal(size=(SIZE, SIZE))
    mean = MEAN.copy()
    mean[State.HEADING], mean[State.GYRO_DELAY] = 0.0, delay
    fusion = Fusion(DriveFilter(mean, A @ A.T, GEOMETRY, STILL), OdometrySettings())
    fusion.may_be_held = held
    found = build_estimate(fusion, DriveReadings(RobotConfig()), OdometrySettings())
    return A @ A.T, found.x, found.y, found.heading, found.velocity_std


def test_a_place_is_unsure_the_way_it_moves() -> None:
    """By the time by which a reading may be early or late, and across that way not at all."""
    stds = []
    for heading in (0.0, 0.5 * math.pi):
        mean = MEAN.copy()
        mean[State.HEADING], mean[State.VELOCITY] = heading, 0.3
        mean[State.TURN_RATE] = mean[State.GYRO_DELAY] = 0.0
        fusion = Fusion(DriveFilter(mean, 1e-8 * np.eye(SIZE), GEOMETRY, STILL), OdometrySettings())
        found = build_estimate(fusion, DriveReadings(RobotConfig()), OdometrySettings())
        stds.append((found.x_std, found.y_std))
    along, across = stds[0]
    assert across == pytest.approx(1e-4)
    assert along > 2.0 * across
    assert stds[1] == pytest.approx((across, along))


@pytest.mark.parametrize(("delay", "lead"), [(0.012, 0.006), (-0.012, -0.012)])
def test_the_pose_is_that_of_now_whoever_of_wheels_and_gyro_is_late(delay: float, lead: float) -> None:
    """Half of a gyro's delay is the wheels' lead; wheels behind a gyro are late themselves."""
    _, x, y, heading, _ = said(delay)
    assert x == pytest.approx(0.3 - lead * 1.05 * 0.15, abs=1e-5)
    assert y == pytest.approx(-0.2, abs=1e-5)
    assert heading == pytest.approx((delay - lead) * 0.4)


def test_the_speed_is_as_unsure_as_way_and_wheels_together() -> None:
    P, *_, deviation = said(0.0)
    two = [State.VELOCITY, State.WAY]
    slope = np.array([1.05, 0.15])
    variance = slope @ P[np.ix_(two, two)] @ slope
    assert deviation**2 == pytest.approx(variance)
    *_, deviation = said(0.0, held=True)  # all of it may be wheels that spin
    assert deviation**2 == pytest.approx(variance + (1.05 * 0.15) ** 2)


def test_a_robot_stands_when_all_is_quiet_for_longer_than_it_coasts() -> None:
    still = StandstillDetector()
    quiet: dict[str, Any] = {"driven": False, "wheel": (0.04, 0.0), "gyro": (0.01, 0.0)}
    said = [still.update(0.005, **quiet) for _ in range(61)]
    assert said == [False] * 59 + [True] * 2
    loud: dict[str, Any] = {"driven": True, "wheel": (0.06, 0.0), "gyro": (0.02, 0.0)}
    for name, value in loud.items():
        assert not still.update(0.005, **{**quiet, name: value})
        assert not still.update(0.29, **quiet)
        assert still.update(0.02, **quiet)
    still.restart()
    assert not still.update(0.29, **quiet)


def test_a_belief_survives_being_flattened() -> None:
    A = np.random.default_rng(2).normal(size=(SIZE, SIZE))
    flat = flatten(MEAN, A @ A.T)
    np.testing.assert_array_equal(mean_of(flat), MEAN)
    np.testing.assert_array_equal(covariance_of(flat), np.triu(A @ A.T) + np.triu(A @ A.T, 1).T)


@pytest.mark.parametrize(
    ("left", "right", "rate", "driven", "creeps"),
    [
        ((0.2, 0.0), (-0.1, 0.0), (0.05, 0.0), False, True),  # rad/s at the begin, and what it changes by a s
        ((0.2, 0.0), (-0.1, 0.0), (0.05, 0.0), True, False),
        ((0.2, -0.4), (0.2, 0.0), (0.05, 0.0), False, False),  # it rolls out
        ((0.2, 0.0), (0.2, -0.4), (0.05, 0.0), False, False),
        ((-0.5, 0.0), (0.1, 0.0), (0.05, 0.0), False, False),  # no offset is that large
        ((0.2, 0.0), (-0.1, 0.0), (0.05, 0.1), False, False),  # a hand turns it
        ((0.2, 0.0), (-0.1, 0.0), (-0.2, 0.0), False, False),  # no bias is that large
        ((0.2, 0.0), (-0.1, 0.0), None, False, False),
    ],
)
def test_what_keeps_its_speed_undriven_for_half_a_second_is_an_offset(
    left: tuple[float, float],
    right: tuple[float, float],
    rate: tuple[float, float] | None,
    driven: bool,
    creeps: bool,
) -> None:
    creeping, told = CreepDetector(), []
    for step in range(60):
        time = 0.02 * step
        read = [None if each is None else each[0] + time * each[1] for each in (left, right, rate)]
        told.append(0.02 * step if creeping.update(0.02, driven, *read) else 0.0)  # type: ignore[arg-type]
    found = [time for time in told if time]
    assert found == (pytest.approx([0.5, 1.0], abs=0.05) if creeps else [])


def test_what_the_gyro_read_before_a_motor_was_driven_is_no_part_of_the_mean_after_it() -> None:
    """A duty that moves nothing leaves wheels and gyro as they were."""
    creeping = CreepDetector()
    for step in range(60):
        if creeping.update(0.02, step == 24, 0.0, 0.0, 0.02):
            break
    assert creeping.mean_rate == pytest.approx(0.02)
