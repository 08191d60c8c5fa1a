"""Things seen in the field: fused with the full covariance, gated, and put where they belong in time."""

import math
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from drive_traces import LAG, Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Truth
from raccoon.estimate.drive.observations import (
    WheelTravel,
    heading_measurement,
    line_measurement,
    pose_measurement,
)
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.ekf.state import SIZE, State

OUT: list[Segment] = [(1.0, 0.0, 0.0), (3.0, 0.2, 0.0), (1.0, 0.0, 1.0), (2.0, 0.2, 0.0), (1.0, 0.0, 0.0)]
WRONG = Errors(scale=(1.04, 1.04), gyro_bias=0.003)


def driven(segments: list[Segment] = OUT) -> tuple[Odometry, Truth]:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive(segments, WRONG):
        odometry.update(inputs, command)
    assert inputs.truth is not None
    return odometry, inputs.truth


def test_a_taped_way_tells_the_scales_and_mends_the_pose() -> None:
    odometry, truth = driven([(1.0, 0.0, 0.0), (3.0, 0.2, 0.0), (1.0, 0.0, 0.0)])
    before = abs(odometry.estimate.x - truth.x)
    found = odometry.observe_distance(math.hypot(truth.x, truth.y), 0.002)
    assert found.accepted
    assert before > 0.015
    assert abs(odometry.estimate.x - truth.x) < 0.004
    assert odometry.estimate.x_std < 0.005


def test_a_way_is_taken_from_the_mark() -> None:
    odometry = Odometry(RobotConfig())
    cycles = list(
        drive([(1.0, 0.0, 0.0), (2.0, 0.2, 0.0), (1.0, 0.0, 0.0), (2.0, -0.2, 0.0), (1.0, 0.0, 0.0)], WRONG)
    )
    for inputs, command in cycles:
        if inputs.time == pytest.approx(3.9):
            odometry.mark()
            assert inputs.truth is not None
            turned_round = inputs.truth.x
        odometry.update(inputs, command)
    assert inputs.truth is not None
    assert odometry.observe_distance(inputs.truth.x - turned_round, 0.002).accepted
    assert not odometry.observe_distance(turned_round - inputs.truth.x, 0.002).accepted


def test_what_is_seen_late_is_worth_what_it_was_when_it_was_seen() -> None:
    """The robot stands: what standing still tells is taken again, too. A late one that is rejected before it
    changes nothing."""
    at_once, later = Odometry(RobotConfig()), Odometry(RobotConfig())
    seen_at = 3.4
    for inputs, command in drive([(1.0, 0.0, 0.0), (2.0, 0.2, 0.3), (1.2, 0.0, 0.0)], WRONG):
        for each in (at_once, later):
            each.update(inputs, command)
        if inputs.time == pytest.approx(seen_at):
            assert at_once.observe_heading(0.61, std=0.01).accepted
    assert not later.observe_heading(2.0, std=0.01, time=seen_at - 0.3).accepted
    assert later.observe_heading(0.61, std=0.01, time=seen_at).accepted
    for each in (at_once, later):  # of what was taken again something more may be told
        assert each.observe_heading(0.61, std=0.01, time=seen_at + 0.4).accepted
    late, prompt = later.estimate, at_once.estimate
    for name in ("x", "y", "heading", "gyro_bias", "x_std", "heading_std", "turn_rate_std", "gyro_bias_std"):
        assert getattr(late, name) == pytest.approx(getattr(prompt, name), rel=1e-6, abs=1e-9), name


def test_a_known_pose_is_taken_with_its_deviation() -> None:
    odometry, truth = driven()
    found = odometry.observe_pose(truth.x, truth.y, truth.heading, position_std=0.003, heading_std=0.005)
    assert found.accepted
    assert math.hypot(odometry.estimate.x - truth.x, odometry.estimate.y - truth.y) < 0.006
    assert odometry.estimate.heading_std < 0.005


def test_a_heading_counts_modulo_a_turn() -> None:
    odometry, truth = driven()
    found = odometry.observe_heading(truth.heading - 4 * math.pi, 0.002)
    assert found.accepted
    assert odometry.estimate.heading == pytest.approx(truth.heading, abs=0.006)


def test_a_line_mends_only_what_lies_across_it() -> None:
    odometry, truth = driven()
    ahead = 0.11
    c, s = math.cos(truth.heading), math.sin(truth.heading)
    point = truth.x + ahead * c + 0.02 * -s, truth.y + ahead * s + 0.02 * c
    direction = truth.heading + math.pi / 2
    odometry.reset(truth.x + 0.03 * c, truth.y + 0.03 * s, truth.heading)
    odometry._stepper.fusion.drive.widen((State.X, State.Y), 0.02)
    before = odometry.estimate
    assert odometry.observe_line(point, direction, sensor=(ahead, 0.02), std=0.003).accepted

    def along(x: float, y: float) -> float:
        return (x - truth.x) * c + (y - truth.y) * s

    assert along(before.x, before.y) == pytest.approx(0.03)
    assert abs(along(odometry.estimate.x, odometry.estimate.y)) < 0.006


def test_what_cannot_be_true_is_told_and_not_taken() -> None:
    odometry, truth = driven()
    before = odometry.estimate
    found = odometry.observe_pose(truth.x + 1.0, truth.y, truth.heading, position_std=0.01, heading_std=0.1)
    assert not found.accepted
    assert found.mahalanobis > 4.0
    assert "standard deviations off" in found.reason
    assert odometry.estimate == before


@pytest.mark.parametrize("delay", [0.1, 1.5])
def test_a_late_observation_counts_where_it_was_made(delay: float) -> None:
    """Seen at t and told at t + delay must give what it gives when told at once."""
    told: list[tuple[float, float, float]] = []
    for late in (False, True):
        odometry = Odometry(RobotConfig())
        seen = None
        for inputs, command in drive(OUT, WRONG):
            odometry.update(inputs, command)
            if inputs.time == pytest.approx(5.5):
                assert inputs.truth is not None
                seen = inputs.truth, inputs.time
                if not late:
                    odometry.observe_pose(*pose(seen[0]), position_std=0.002, heading_std=0.01)
            if late and seen and inputs.time == pytest.approx(5.5 + delay):
                found = odometry.observe_pose(
                    *pose(seen[0]), position_std=0.002, heading_std=0.01, time=seen[1]
                )
                assert found.accepted
        estimate = odometry.estimate
        told.append((estimate.x, estimate.y, estimate.heading))
    np.testing.assert_allclose(told[0], told[1], atol=2e-3)


@pytest.mark.parametrize("told_at", [3.21, 3.215, 3.6])
def test_what_is_seen_late_is_set_against_a_gyro_that_is_late_too(told_at: float) -> None:
    """The robot turns: a heading of a moment is not what the gyro read then. How late that is was learnt."""
    swings: list[Segment] = [(1.0, 0.0, 0.0), (0.8, 0.15, 1.8), (0.8, 0.15, -1.8), (1.4, 0.15, 1.8)]
    odometry = Odometry(RobotConfig())
    odometry.reset(heading_std=0.1)
    for inputs, command in drive(swings, Errors(imu_latency=0.03)):
        odometry.update(inputs, command)
        assert inputs.truth is not None
        if inputs.time == pytest.approx(3.21):  # within a step of the filter
            seen = inputs.truth.heading, inputs.time
        if inputs.time == pytest.approx(told_at):
            assert odometry.observe_heading(seen[0], 0.001, time=seen[1]).accepted
    assert inputs.truth is not None
    assert odometry.estimate.heading == pytest.approx(inputs.truth.heading, abs=0.003)


@pytest.mark.parametrize("taped", [False, True])
def test_what_was_seen_meanwhile_stays_where_something_earlier_is_told_late(taped: bool) -> None:
    """A heading, or a taped way, at 3.4 s, and a line that was crossed at 3.2 s: in either order."""
    ends: list[tuple[float, float, float, float, float]] = []
    for late in (False, True):
        odometry, last, went = Odometry(RobotConfig()), (0.0, 0.0), 0.0
        odometry.reset(heading_std=0.02)
        for inputs, command in islice(drive([(1.0, 0.0, 0.0), (3.0, 0.2, 0.3)], WRONG), 700):
            odometry.update(inputs, command)
            truth = inputs.truth
            assert truth is not None
            went, last = went + math.dist(last, (truth.x, truth.y)), (truth.x, truth.y)
            if inputs.time == pytest.approx(3.2):
                place, across = (truth.x, truth.y), truth.heading + 1.5
                line = partial(odometry.observe_line, place, across, sensor=(0.0, 0.0), std=0.003)
                assert late or line().accepted
            elif inputs.time == pytest.approx(3.4):
                heading = partial(odometry.observe_heading, truth.heading, 0.001)
                tape = partial(odometry.observe_distance, went, 0.002)
                assert (tape if taped else heading)().accepted
            elif inputs.time == pytest.approx(3.45):  # the robot has gone on
                assert not late or line(time=3.2).accepted
        here = odometry.estimate
        ends.append((here.x, here.y, here.heading, here.x_std, here.heading_std))
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-3, atol=2e-4)


def pose(truth: Truth) -> tuple[float, float, float]:
    return truth.x, truth.y, truth.heading


@pytest.mark.parametrize("cycle", range(4))
def test_what_is_seen_in_this_cycle_counts_alike_with_its_time_and_without(cycle: int) -> None:
    """The filter moves every 20 ms, the robot 4 mm meanwhile."""
    told = []
    for says in (False, True):
        odometry = Odometry(RobotConfig())
        for inputs, command in islice(drive(OUT, WRONG), 700 + cycle):
            odometry.update(inputs, command)
        assert inputs.truth is not None
        time = inputs.time if says else None
        assert odometry.observe_pose(
            *pose(inputs.truth), position_std=0.001, heading_std=0.01, time=time
        ).accepted
        told.append((odometry.estimate.x, odometry.estimate.y, odometry.estimate.heading))
    np.testing.assert_allclose(told[0], told[1], atol=2e-4)


def test_what_was_seen_more_than_two_seconds_ago_is_not_taken_after_a_pause_either() -> None:
    """The steps of two seconds reach further back where nobody looked in between."""
    odometry = Odometry(RobotConfig())
    for inputs, command in islice(drive(OUT, WRONG), 500):
        late = 4.0 if inputs.time > 2.0 else 0.0
        odometry.update(replace(inputs, time=inputs.time + late), command)
    now = inputs.time + 4.0
    assert inputs.truth is not None
    for ago, taken in ((1.0, True), (3.0, False)):
        found = odometry.observe_pose(*pose(inputs.truth), position_std=1.0, heading_std=1.0, time=now - ago)
        assert found.accepted is taken
    assert "allowed are the 2 s before" in found.reason


@pytest.mark.parametrize("time", [-1.0, 2.0, 1e9])
def test_an_observation_from_too_long_ago_or_the_future_is_not_taken(time: float) -> None:
    odometry, truth = driven()
    found = odometry.observe_pose(*pose(truth), position_std=0.01, heading_std=0.01, time=time)
    assert (found.accepted, "seen at" in found.reason) == (False, True)


def test_a_robot_that_moves_is_where_it_was_said_to_be() -> None:
    """Also where its gyro was found to be late."""
    odometry = Odometry(RobotConfig())
    swings: list[Segment] = [(1.0, 0.0, 0.0), (0.8, 0.15, 1.8), (0.8, 0.15, -1.8), (0.8, 0.15, 1.8)]
    for inputs, command in drive(swings, Errors(imu_latency=0.03)):
        odometry.update(inputs, command)
    odometry.reset(1.0, 2.0, 0.5)
    here = odometry.estimate
    assert (here.x, here.y, here.heading) == pytest.approx((1.0, 2.0, 0.5), abs=1e-9)
    assert here.turn_rate == pytest.approx(1.8, abs=0.1)


def test_what_was_seen_before_the_robot_was_put_elsewhere_is_not_taken() -> None:
    odometry, cycles = Odometry(RobotConfig()), drive(OUT, WRONG)
    for inputs, command in islice(cycles, 600):
        odometry.update(inputs, command)
    assert inputs.truth is not None
    seen, time = pose(inputs.truth), inputs.time
    odometry.reset(1.0, 2.0, 0.5, position_std=10.0, heading_std=3.0)
    put = odometry.estimate
    assert (put.x_std, put.y_std, put.heading_std) == pytest.approx((10.0, 10.0, 3.0), rel=1e-3)
    found = odometry.observe_pose(*seen, position_std=0.01, heading_std=0.01, time=time - 0.01)
    assert (found.accepted, found.reason) == (False, f"seen at {time - 0.01} s: no cycle is stored yet")
    for inputs, command in islice(cycles, 40):
        odometry.update(inputs, command)
    here = odometry.estimate
    found = odometry.observe_pose(*seen, position_std=0.01, heading_std=0.01, time=time)
    assert (found.accepted, "cycles are stored from" in found.reason) == (False, True)
    assert (odometry.estimate.x, odometry.estimate.y) == (here.x, here.y)


def test_bad_arguments_are_refused() -> None:
    odometry = Odometry(RobotConfig())
    for std in (0.0, -0.1, math.nan, math.inf):
        with pytest.raises(ValueError, match=f"std is {std}"):
            odometry.observe_heading(0.0, std)
    with pytest.raises(ValueError, match="finite"):
        odometry.observe_pose(math.nan, 0.0, 0.0, position_std=0.1, heading_std=0.1)
    with pytest.raises(ValueError, match="finite"):
        odometry.observe_distance(math.inf, 0.1)
    with pytest.raises(ValueError, match=r"heading is 90: .*write deg\(90\) for degrees"):
        odometry.reset(1.0, 0.0, 90.0)
    odometry.reset(1.0, 0.0, 6.0 * math.pi)  # of several turns, as a robot believes it that has made them
    assert odometry.estimate.heading == 6.0 * math.pi


@pytest.mark.parametrize(
    "seen",
    [
        pose_measurement(0.1, 0.2, 0.3, 0.01, 0.02),
        heading_measurement(0.3, 0.1),
        line_measurement((0.4, 0.1), 0.7, (0.11, -0.02), 0.01),
    ],
)
def test_jacobians_are_slopes(seen: object) -> None:
    at, step = np.array([0.2, -0.1, 0.6]), 1e-6
    expected, jacobian = seen.expected, seen.jacobian  # type: ignore[attr-defined]
    slopes = [(expected(at + h) - expected(at - h)) / (2 * step) for h in step * np.eye(3)]
    np.testing.assert_allclose(jacobian(at), np.array(slopes).T, atol=1e-8)


def test_the_jacobian_of_a_taped_way_is_its_slope() -> None:
    way, at, step = WheelTravel(left=7.0, right=9.0, seconds=2.0), np.zeros(SIZE), 1e-6
    at[[State.WAY, State.BALANCE, State.LEFT_OFFSET, State.RIGHT_OFFSET]] = 1.03, 0.02, 0.1, -0.2
    slopes = [
        (way.expected(at + h, 0.03) - way.expected(at - h, 0.03)) / (2 * step) for h in step * np.eye(SIZE)
    ]
    np.testing.assert_allclose(way.jacobian(at, 0.03), np.array(slopes).T, atol=1e-8)


def test_a_start_that_is_not_sure_stays_so_when_the_controller_is_known() -> None:
    """The first cycle tells whose words follow; where the robot was put down it does not."""
    odometry = Odometry(RobotConfig())
    odometry.reset(1.0, 0.5, 0.3, position_std=0.02, heading_std=math.radians(3.0))
    inputs, command = next(drive([(0.1, 0.0, 0.0)]))
    estimate = odometry.update(replace(inputs, device=replace(inputs.device, name="another")), command)
    assert (estimate.x, estimate.y, estimate.heading) == pytest.approx((1.0, 0.5, 0.3), abs=1e-6)
    assert (estimate.x_std, estimate.y_std) == pytest.approx((0.02, 0.02), rel=0.01)
    assert estimate.heading_std == pytest.approx(math.radians(3.0), rel=0.01)


def test_counters_are_as_late_as_the_controller_is_known_to_be_by_its_first_cycle() -> None:
    """Those of one whose counters are not late are taken for where the robot is now."""
    late, at_once = Odometry(RobotConfig()), Odometry(RobotConfig())
    unfiltered = replace(SIMULATOR, name="unfiltered", bemf_lag=0.0)
    for inputs, command in drive([(0.5, 0.2, 0.0)], Errors(bemf_noise_counts=0.0, slip_noise=0.0)):
        late.update(inputs, command)
        at_once.update(replace(inputs, device=unfiltered), command)
    assert inputs.truth is not None
    assert late.estimate.x == pytest.approx(inputs.truth.x, abs=0.001)
    assert inputs.truth.x - at_once.estimate.x == pytest.approx(0.2 * LAG, abs=0.001)
