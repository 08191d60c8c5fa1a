"""Times in which nobody looked: the counters say how far the wheels turned, and no one knows more of it."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.readings import Fault, Inputs, Outputs, Status
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.ekf.bridge import bridge_gap
from raccoon.estimate.ekf.state import SIZE, State
from raccoon.model.drive import DriveGeometry

Cycle = tuple[Inputs, Outputs]
Found = list[tuple[DriveEstimate, Inputs]]
OFFSETS = (11.0, -8.0)


def run(cycles: Iterator[Cycle]) -> Found:
    odometry = Odometry(RobotConfig())
    return [(odometry.update(inputs, command), inputs) for inputs, command in cycles]


def sigmas(estimate: DriveEstimate, inputs: Inputs) -> tuple[float, float, float]:
    """How many of its standard deviations the estimate is off in x, y and heading."""
    truth = inputs.truth
    assert truth is not None
    return (
        abs(estimate.x - truth.x) / estimate.x_std,
        abs(estimate.y - truth.y) / estimate.y_std,
        abs(estimate.heading - truth.heading) / estimate.heading_std,
    )


@pytest.mark.parametrize(
    ("motion", "seconds"),
    [
        ((1.0, 0.0, 1.5), 0.15),
        ((1.0, 0.0, 1.5), 1.0),
        ((1.0, 0.15, 0.0), 0.4),
        ((1.0, 0.15, 0.0), 5.0),
        ((1.0, 0.12, 1.0), 0.4),
        ((1.0, 0.12, 1.0), 5.0),
    ],
)
def test_motion_that_ends_unseen_is_counted(motion: Segment, seconds: float) -> None:
    segments: list[Segment] = [(2.0, 0.0, 0.0), (1.0, 0.0, -1.0), (1.0, 0.0, 0.0), motion, (6.0, 0.0, 0.0)]
    cycles = drive(segments, Errors(offset_counts=OFFSETS, gyro_bias=0.003))
    found = run(each for each in cycles if not 4.6 < each[0].time < 4.6 + seconds)
    gap = next(n for n, (e, _) in enumerate(found) if any("between two cycles" in r for r in e.reasons))
    for estimate, inputs in found[gap + 2], found[-1]:
        assert max(sigmas(estimate, inputs)) < 3.0
        truth = inputs.truth
        assert truth is not None
        assert abs(estimate.heading - truth.heading) < math.radians(1.0)
        assert math.hypot(estimate.x - truth.x, estimate.y - truth.y) < 0.01
    said = {reason for estimate, _ in found for reason in estimate.reasons}
    assert all("between two cycles" in reason for reason in said)
    assert found[-1][0].status is Status.OK


@pytest.mark.parametrize("seconds", [0.12, 0.3, 1.0])
def test_a_gyro_that_is_late_tells_no_part_of_a_turn_twice_after_a_gap_in_it(seconds: float) -> None:
    """The heading is of the gyro's time: a turn that goes on after the gap does not bring it up to date."""
    cycles = drive([(2.0, 0.0, 0.0), (3.0, 0.0, 1.5), (1.0, 0.0, 0.0)], Errors(imu_latency=0.012))
    found = run(each for each in cycles if not 3.0 < each[0].time < 3.0 + seconds)
    estimate, inputs = found[-1]
    assert inputs.truth is not None
    assert abs(estimate.heading - inputs.truth.heading) < 0.006


@pytest.mark.parametrize(
    ("motion", "seconds", "gyro_every"),
    [
        ((1.0, 0.0, 1.5), 0.07, 1),
        ((1.0, 0.0, 1.5), 0.12, 4),
        ((1.0, 0.0, 1.5), 0.3, 1),
        ((1.0, 0.0, 1.5), 1.0, 4),
        ((1.0, 0.15, 0.0), 0.07, 4),
        ((1.0, 0.15, 0.0), 0.12, 1),
        ((1.0, 0.15, 0.0), 0.3, 4),
        ((1.0, 0.15, 0.0), 1.0, 1),
    ],
)
def test_a_silent_link_is_a_gap_though_cycles_come(motion: Segment, seconds: float, gyro_every: int) -> None:
    segments: list[Segment] = [(2.0, 0.0, 0.0), motion, (2.0, 0.0, 0.0)]

    def silent(inputs: Inputs) -> Inputs:
        nothing = (None,) * 4
        return replace(inputs, bemf=nothing, position=nothing, gyro=None)

    begin = 2.6
    cycles = drive(segments, Errors(offset_counts=OFFSETS, gyro_bias=0.003), gyro_every=gyro_every)
    found = run(
        (silent(inputs) if begin < inputs.time < begin + seconds else inputs, command)
        for inputs, command in cycles
    )
    estimate, inputs = found[-1]
    assert inputs.truth is not None
    assert max(sigmas(estimate, inputs)) < 3.0
    assert abs(estimate.heading - inputs.truth.heading) < math.radians(0.6)
    assert math.hypot(estimate.x - inputs.truth.x, estimate.y - inputs.truth.y) < 0.005
    assert estimate.heading_std < math.radians(1.5)
    assert math.hypot(estimate.x_std, estimate.y_std) < 0.02
    within = found[round((begin + min(seconds, 0.05)) / 0.005)][0]
    assert within.x == pytest.approx(found[round(begin / 0.005)][0].x, abs=0.02)


@pytest.mark.parametrize("seconds", [0.08, 0.12, 0.18])
@pytest.mark.parametrize(
    "motion", [(1.0, 0.0, 1.5), (1.0, 0.2, 0.0), (1.0, 0.12, 1.0)], ids=["turn", "straight", "arc"]
)
def test_what_a_controller_did_not_count_while_it_hung_is_in_doubt(motion: Segment, seconds: float) -> None:
    """Its motors ran on meanwhile. What is lost is no more than that, and alike for both wheels."""
    begin, nothing = 2.6, (None,) * 4

    def hanging(inputs: Inputs, before: Inputs, back: Inputs) -> Inputs:
        if inputs.time < before.time:
            return inputs
        if inputs.time < back.time:
            return replace(inputs, bemf=nothing, position=nothing, gyro=None, faults=(Fault.STALE,))
        ticks = zip(inputs.position[:2], before.position[:2], back.position[:2], strict=True)
        counted = [(now or 0) - ((then or 0) - (last or 0)) for now, last, then in ticks]
        faults = (Fault.POSITION_JUMP,) if inputs is back else ()
        return replace(inputs, position=(*counted, None, None), faults=faults)

    cycles = list(drive([(2.0, 0.0, 0.0), motion, (1.0, 0.0, 0.0)], Errors(offset_counts=OFFSETS)))
    before, back = cycles[round(begin / 0.005)][0], cycles[round((begin + seconds) / 0.005)][0]
    found = run((hanging(inputs, before, back), command) for inputs, command in cycles)
    estimate, inputs = found[-1]
    assert max(sigmas(estimate, inputs)) < 2.0
    assert math.hypot(estimate.x_std, estimate.y_std) < 0.05
    assert estimate.heading_std < 0.4


@pytest.mark.parametrize("offset", [0.0, 15.0])
def test_repeated_frames_are_no_motors_that_stand_at_their_offset(offset: float) -> None:
    """What the wheels turned meanwhile the next counters tell, whatever offset robot.toml has."""
    robot = RobotConfig()
    motor = replace(robot.wheel_motor("left"), bemf_offset=Measured(offset, 0.5))
    odometry = Odometry(replace(robot, motors={robot.drive.left: motor, robot.drive.right: motor}))
    last: Inputs | None = None
    for inputs, command in drive([(0.6, 0.0, 0.0), (1.0, 0.2, 0.0)], Errors(offset_counts=(offset, offset))):
        if last is not None and 1.0 < inputs.time < 1.15:
            inputs = replace(inputs, bemf=last.bemf, position=last.position, faults=(Fault.STALE,))
        else:
            last = inputs
        estimate = odometry.update(inputs, command)
    assert inputs.truth is not None
    assert estimate.x == pytest.approx(inputs.truth.x, abs=0.002)


@pytest.mark.parametrize(("begin", "seconds"), [(3.2, 0.12), (3.2, 2.0), (2.5, 0.12)])
@pytest.mark.parametrize("side", [0, 1])
def test_a_pause_does_not_lose_a_robot_one_wheel_of_which_is_silent(
    side: int, begin: float, seconds: float
) -> None:
    """The other wheel and the gyro before and after it tell how far it may have turned."""
    odometry = Odometry(RobotConfig())
    segments: list[Segment] = [(1.0, 0.0, 0.0), (2.0, 0.2, 0.2), (2.5, 0.0, 0.0)]
    for inputs, command in drive(segments, Errors(offset_counts=OFFSETS, gyro_bias=0.02), seed=side):
        if begin < inputs.time < begin + seconds:
            continue
        if inputs.time > 1.5:
            bemf, position = list(inputs.bemf), list(inputs.position)
            bemf[side] = position[side] = None
            inputs = replace(inputs, bemf=tuple(bemf), position=tuple(position))
        estimate = odometry.update(inputs, command)
    assert max(sigmas(estimate, inputs)) < 3.0
    assert inputs.truth is not None
    assert estimate.heading == pytest.approx(inputs.truth.heading, abs=0.01)  # half of the turn in the gap
    assert estimate.status is Status.UNCERTAIN  # for the wheel
    assert math.hypot(estimate.x_std, estimate.y_std) < 0.1
    assert estimate.heading_std < (0.4 if begin < 3.0 else math.radians(2.0))


def later(cycles: Iterator[Cycle], after: float, seconds: float) -> Iterator[Cycle]:
    """The same with so many s of standing still between, in which the counters count their offsets."""
    for inputs, command in cycles:
        if inputs.time < after:
            yield inputs, command
            continue
        counted = [
            math.floor((each or 0.0) + offset * seconds / inputs.device.position_counts_seconds)
            for each, offset in zip(inputs.position[:2], OFFSETS, strict=True)
        ]
        yield replace(inputs, time=inputs.time + seconds, position=(*counted, None, None)), command


@pytest.mark.parametrize("seconds", [10.0, 600.0, 3599.0, 3601.0, 36000.0])
def test_a_long_pause_neither_moves_the_robot_nor_makes_it_sure(seconds: float) -> None:
    segments: list[Segment] = [
        *((2.0, 0.0, 0.0), (1.0, 0.3, 0.4), (2.0, 0.0, 0.0)),
        *((2.0, 0.1, 0.0), (1.0, 0.0, -1.5), (2.0, 0.1, 0.0), (1.0, 0.0, 0.0)),
    ]
    cycles = drive(segments, Errors(offset_counts=OFFSETS, gyro_bias=0.003), seed=0)
    found = run(later(cycles, 4.5, seconds))
    before, after = found[899][0], found[902][0]
    assert after.time - before.time > seconds
    assert max(sigmas(*found[902])) < 3.5
    assert max(sigmas(*found[-1])) < 3.5
    assert after.heading_std > before.heading_std
    assert (after.status is Status.INVALID) == (after.heading_std > math.radians(25.0))
    assert math.hypot(after.x - before.x, after.y - before.y) < 0.2
    # From there it goes on: what it drives is seen as it is, and a place that is not known stands still.
    (begin, at_begin), (end, at_end) = found[905], found[-1]
    assert at_begin.truth is not None
    assert at_end.truth is not None
    assert end.distance - begin.distance == pytest.approx(0.4, abs=0.03)
    if after.status is Status.INVALID:
        assert after.distance == pytest.approx(before.distance, abs=0.005)
        turned = (end.heading - begin.heading) - (at_end.truth.heading - at_begin.truth.heading)
        assert abs(turned) < math.radians(1.5)


def test_the_bridge_has_the_derivatives_of_its_motion() -> None:
    generator = np.random.default_rng(4)
    geometry = DriveGeometry(0.0345, 0.16)
    mean = np.array([0.3, -0.2, 0.7, 0.15, 0.4, 0.002, 0.01, -0.02, 1.02, 0.01, 0.98, 1.0, 0.01])
    angles, seconds, tiny, after = (1.1, 2.3), 1.7, 1e-6, -0.6
    pose = [State.X, State.Y, State.HEADING]

    def end(state: np.ndarray, left: float = angles[0], right: float = angles[1]) -> np.ndarray:
        found: np.ndarray = bridge_gap(
            state, np.zeros((SIZE, SIZE)), seconds, (left, right), np.zeros((2, 2)), geometry, after
        )[0][pose]
        return found

    def exact(spread: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """Covariance of the pose, by differences."""
        steps = [(end(mean + tiny * one) - end(mean - tiny * one)) / (2.0 * tiny) for one in np.eye(SIZE)]
        by_left = (end(mean, angles[0] + tiny) - end(mean, angles[0] - tiny)) / (2.0 * tiny)
        by_right = (end(mean, right=angles[1] + tiny) - end(mean, right=angles[1] - tiny)) / (2.0 * tiny)
        J, K = np.array(steps).T, np.array([by_left, by_right]).T
        found: np.ndarray = J @ spread @ J.T + K @ noise @ K.T
        return found

    A = 0.01 * generator.normal(size=(SIZE, SIZE))
    B = 0.01 * generator.normal(size=(2, 2))
    spread, noise = A @ A.T, B @ B.T
    sure = np.zeros((SIZE, SIZE)), seconds, angles, np.zeros((2, 2))
    _, known, travel = bridge_gap(mean, *sure, geometry, after)
    _, P, _ = bridge_gap(mean, spread, seconds, angles, noise, geometry, after)
    np.testing.assert_allclose((P - known)[np.ix_(pose, pose)], exact(spread, noise), rtol=0.02, atol=3e-6)
    assert travel == pytest.approx(1.02 * 0.5 * 0.0345 * (1.083 / 0.99 + 2.334 / 1.01))
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert P[State.VELOCITY, State.X] == P[State.TURN_RATE, State.HEADING] == 0.0


def test_a_doubt_after_a_gap_stays_when_something_older_is_told() -> None:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(0.5, 0.0, 0.0), (0.6, 0.2, 0.0)]):
        if not 0.8 < inputs.time < 1.0:
            estimate = odometry.update(inputs, command)
        if inputs.time >= 1.0:
            break
    before = estimate.x_std
    odometry.doubt_way(0.1)
    assert odometry.observe_heading(0.0, 0.01, time=0.75).accepted
    assert odometry.estimate.x_std == pytest.approx(math.hypot(0.1, before), rel=1e-3)
