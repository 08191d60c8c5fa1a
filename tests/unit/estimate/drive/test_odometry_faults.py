"""What damaged readings do to the odometry: a bounded error, a status and its reason at once, and
recovery.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.readings import Fault, Inputs, Outputs, Status
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.slip import slipping_wheel
from raccoon.estimate.ekf.state import OdometrySettings

CURVE: list[Segment] = [(1.5, 0.0, 0.0), (3.0, 0.15, 0.3), (1.0, 0.0, 0.0)]
STRAIGHT: list[Segment] = [(1.5, 0.0, 0.0), (3.0, 0.18, 0.0), (1.0, 0.0, 0.0)]
Cycle = tuple[Inputs, Outputs]
Damage = Callable[[int, Inputs], Inputs]
Found = list[tuple[DriveEstimate, Inputs]]


def run(cycles: Iterator[Cycle], damage: Damage = lambda _, inputs: inputs) -> Found:
    odometry = Odometry(RobotConfig())
    found = []
    for number, (inputs, command) in enumerate(cycles):
        damaged = damage(number, inputs)
        found.append((odometry.update(damaged, command), inputs))
    return found


def errors(found: Found) -> tuple[float, float]:
    """Final error of position (m) and heading (rad)."""
    estimate, inputs = found[-1]
    truth = inputs.truth
    assert truth is not None
    return math.hypot(estimate.x - truth.x, estimate.y - truth.y), abs(estimate.heading - truth.heading)


def between(begin: float, end: float, change: Callable[[Inputs], Inputs]) -> Damage:
    return lambda _, inputs: change(inputs) if begin <= inputs.time < end else inputs


def word(inputs: Inputs, port: int, value: float | None, kind: str) -> Inputs:
    words = list(getattr(inputs, kind))
    words[port] = value
    return replace(inputs, **{kind: tuple(words)})  # type: ignore[arg-type]


FAULTS: dict[str, tuple[Damage, str, float, float]] = {
    # what happens, what is told, largest error of position (m) and of heading (degrees)
    "gyro gone": (between(2.0, 2.6, lambda i: replace(i, gyro=None)), "the gyro is silent", 0.02, 2.0),
    "gyro not a number": (
        between(2.0, 2.6, lambda i: replace(i, gyro=(0.0, 0.0, math.nan))),
        "the gyro's reading is not a number",
        0.02,
        2.0,
    ),
    "gyro at full scale": (
        between(2.0, 2.6, lambda i: replace(i, gyro=(0.0, 0.0, 32767.0))),
        "the gyro is at full scale",
        0.02,
        2.0,
    ),
    "gyro frozen by word of the port": (
        between(2.0, 2.6, lambda i: replace(i, faults=(Fault.IMU_FROZEN,))),
        "the gyro is frozen",
        0.02,
        2.0,
    ),
    "left wheel gone": (
        between(2.0, 2.5, lambda i: word(word(i, 0, None, "bemf"), 0, None, "position")),
        "the left wheel is silent",
        0.03,
        1.0,
    ),
    "back-EMF not a number": (
        between(2.0, 2.5, lambda i: word(i, 1, math.nan, "bemf")),
        "a wheel's reading is not a number",
        0.01,
        1.0,
    ),
    "back-EMF beyond its word": (
        between(2.0, 2.5, lambda i: word(i, 1, 1e300, "bemf")),
        "the right back-EMF is larger than any wheel's",
        0.01,
        1.0,
    ),
    "counter beyond its word": (
        between(2.0, 2.5, lambda i: word(i, 1, 1e300, "position")),
        "a wheel's reading is not a number",
        0.01,
        1.0,
    ),
    "counter jumps": (
        lambda n, i: word(i, 1, (i.position[1] or 0.0) + (1e7 if n >= 450 else 0.0), "position"),
        "the right counter jumped",
        0.01,
        1.0,
    ),
    "controller restarts": (
        between(2.0, 2.005, lambda i: replace(i, faults=(Fault.RESET,))),
        "port: reset",
        0.01,
        1.0,
    ),
    "stale frames": (
        between(2.0, 2.05, lambda i: replace(i, faults=(Fault.STALE,))),
        "port: stale",
        0.02,
        1.0,
    ),
    "time repeats": (
        lambda n, i: replace(i, time=i.time - 0.005) if n % 50 == 40 else i,
        "time stands still or goes backwards",
        0.01,
        1.0,
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told_bounded_and_gets_over_with(name: str) -> None:
    damage, reason, place, heading = FAULTS[name]
    found = run(drive(CURVE), damage)
    told = [estimate.time for estimate, _ in found if reason in estimate.reasons]
    assert told, f"never said: {sorted({r for e, _ in found for r in e.reasons})}"
    assert told[0] < 2.4
    assert all(e.status is not Status.OK for e, _ in found if reason in e.reasons)
    place_error, heading_error = errors(found)
    assert place_error < place
    assert math.degrees(heading_error) < heading
    if name != "time repeats":
        assert found[-1][0].status is Status.OK


@pytest.mark.parametrize("odd", [1e9, 2.0**64, 1e155, -1e300])
@pytest.mark.parametrize("kind", ["bemf", "position", "gyro", "accel", "time"])
def test_no_word_is_too_odd(kind: str, odd: float) -> None:
    """Every fifth word of half a second: nothing is raised, and the pose stays where it belongs."""

    def spoil(number: int, inputs: Inputs) -> Inputs:
        if number % 5 or not 1.2 <= inputs.time < 1.7:
            return inputs
        if kind == "gyro":
            return replace(inputs, gyro=(odd, odd, odd))
        if kind == "accel":
            return replace(inputs, accel=(odd, odd, odd))
        return replace(inputs, time=odd) if kind == "time" else word(inputs, 0, odd, kind)

    found = run(drive([(1.0, 0.0, 0.0), (1.0, 0.18, 0.0), (0.5, 0.0, 0.0)]), spoil)
    if kind == "time" and odd == 1e9:
        assert found[-1][0].status is Status.INVALID, "hours went by"
    else:
        assert errors(found)[0] < 0.01
        assert found[-1][0].status is Status.OK


def test_a_frozen_gyro_is_noticed_in_a_turn_within_60_ms() -> None:
    frozen: list[tuple[float, float, float]] = []

    def freeze(_: int, inputs: Inputs) -> Inputs:
        if inputs.time < 1.9 or inputs.gyro is None:
            return inputs
        frozen.append(inputs.gyro)
        return replace(inputs, gyro=frozen[0])

    turn: list[Segment] = [(2.0, 0.0, 0.0), (1.0, 0.0, 1.5), (1.0, 0.0, 0.0)]
    found = run(drive(turn), freeze)
    told = [e.time for e, _ in found if "the gyro is frozen" in e.reasons]
    assert 1.9 <= told[0] < 1.97
    assert math.degrees(errors(found)[1]) < 8.0, "the wheels, still uncalibrated, take over"
    assert errors(found)[1] < 4 * found[-1][0].heading_std


def test_a_gap_is_told_and_the_counters_bridge_it() -> None:
    cycles = ((i, c) for i, c in drive(STRAIGHT) if not 2.0 < i.time < 2.4)
    found = run(cycles)
    assert any("between two cycles" in reason for e, _ in found for reason in e.reasons)
    assert errors(found)[0] < 0.01


def test_time_that_jumps_back_for_good_does_not_stop_the_estimate() -> None:
    def rewound(_: int, inputs: Inputs) -> Inputs:
        return replace(inputs, time=inputs.time - 1.5) if inputs.time > 2.5 else inputs

    found = run(drive(STRAIGHT), rewound)
    assert errors(found)[0] < 0.02
    assert found[-1][0].status is Status.OK


def test_dead_counter_leaves_the_back_emf_and_the_other_way_round() -> None:
    for kind, reason in (("position", "counter"), ("bemf", "back-EMF")):
        found = run(drive(STRAIGHT), between(2.0, 9.0, lambda i, k=kind: word(i, 0, 0.0, k)))  # type: ignore[misc]
        assert any(f"the left {reason} does not move" in e.reasons for e, _ in found)
        assert errors(found)[0] < 0.03


def test_an_imu_that_appears_late_is_taken_up() -> None:
    late = Errors(gyro_bias=0.003)
    found = run(drive(CURVE, late), between(0.0, 0.7, lambda i: replace(i, gyro=None)))
    assert found[-1][0].gyro_bias == pytest.approx(0.003, abs=0.001)
    assert math.degrees(errors(found)[1]) < 1.0


def test_no_wheel_at_all_is_invalid() -> None:
    blind = between(2.0, 9.0, lambda i: replace(i, bemf=(None,) * 4, position=(None,) * 4))
    found = run(drive(STRAIGHT), blind)
    assert found[-1][0].status is Status.INVALID
    assert found[-1][0].x_std > 0.1


@pytest.mark.parametrize(("side", "velocity"), [("left", 0.18), ("right", 0.18), ("right", -0.18)])
def test_a_slipping_wheel_is_named_within_a_fifth_of_a_second(side: str, velocity: float) -> None:
    straight: list[Segment] = [(1.5, 0.0, 0.0), (3.0, velocity, 0.0), (1.0, 0.0, 0.0)]
    found = run(drive(straight, Errors(slip=(2.5, 3.0, side, 0.5))))
    told = [e.time for e, _ in found if f"the {side} wheel slips" in e.reasons]
    assert 2.5 <= told[0] <= 2.7
    assert not any("slips" in reason for e, _ in found for reason in e.reasons if side not in reason)
    place, heading = errors(found)
    assert math.degrees(heading) < 0.3
    # Dead reckoning is off by the heading the slip leaves, 16 degrees, over the rest of the way: 0.08 m.
    assert place < 0.02


@pytest.mark.parametrize("turn_rate", [1.5, -1.5])
def test_either_wheel_may_slip_in_a_turn_on_the_spot(turn_rate: float) -> None:
    """Whichever does, the robot turns less than its wheels: its place is halfway between what both say, and
    no surer than that."""
    spin: list[Segment] = [(1.0, 0.0, 0.0), (1.2, 0.0, turn_rate), (0.5, 0.0, 0.0)]
    off = {}
    for side in ("left", "right"):
        found = run(drive(spin, Errors(slip=(1.5, 2.0, side, 0.5))))
        off[side], heading = errors(found)
        assert math.degrees(heading) < 0.3
        assert off[side] < 1.5 * math.hypot(found[-1][0].x_std, found[-1][0].y_std)
    assert off["left"] == pytest.approx(off["right"], rel=0.1)


@pytest.mark.parametrize("ahead", [1.0, -1.0])
@pytest.mark.parametrize(
    ("left", "right"), [(9.0, 9.0), (9.0, 4.0), (4.0, 9.0), (-5.0, 5.0), (5.0, -5.0), (0.0, 8.0), (8.0, 0.0)]
)
def test_the_wheel_that_slips_reads_more_than_it_rolls(left: float, right: float, ahead: float) -> None:
    rolls = ahead * left, ahead * right
    for side, name in enumerate(("left", "right")):
        reads = [1.3 * rolled if each == side else rolled for each, rolled in enumerate(rolls)]
        unexplained = (rolls[1] - rolls[0]) - (reads[1] - reads[0])
        assert not unexplained or slipping_wheel(unexplained, *reads) == name


def test_a_calm_drive_raises_no_alarm() -> None:
    worse = Errors(scale=(1.06, 0.95), offset_counts=(50.0, -60.0), gyro_bias=0.004, track=1.02)
    found = run(drive([*CURVE, (1.0, 0.0, -2.0), (2.0, -0.2, 0.0), (1.0, 0.0, 0.0)], worse))
    assert {reason for e, _ in found for reason in e.reasons} == set()


def test_scales_that_are_far_off_are_learnt_again() -> None:
    robot = RobotConfig()
    odometry = Odometry(robot, settings=OdometrySettings(uncalibrated_scale=0.005))
    cycles = drive([(1.0, 0.0, 0.0), (9.0, 0.2, 0.0)], Errors(scale=(1.12, 0.90)))
    told: set[str] = set()
    for inputs, command in cycles:
        estimate = odometry.update(inputs, command)
        told.update(estimate.reasons)
    assert "the wheels' scales do not fit the gyro" in told
    left, right = odometry.wheel_scales
    assert right / left == pytest.approx(0.90 / 1.12, rel=0.01)
    assert inputs.truth is not None
    assert math.degrees(abs(estimate.heading - inputs.truth.heading)) < 0.5


@pytest.mark.parametrize(
    ("scale", "track"), [((1.15, 1.0), 1.0), ((1.15, 1.0), 1.15), ((1.05, 0.9), 1.15), ((0.87, 0.87), 1.15)]
)
def test_scales_that_robot_toml_may_be_wrong_by_are_learnt_and_lead_home(
    scale: tuple[float, float], track: float
) -> None:
    """Uncalibrated: wheels and gyro tell the ratio of the scales; the turn is right in any case."""
    odometry = Odometry(RobotConfig())
    turn_rate = 1.4 if scale[1] == 1.0 else -1.4
    square: list[Segment] = [(1.0, 0.0, 0.0), *[(2.0, 0.18, 0.0), (1.2, 0.0, turn_rate), (0.8, 0.0, 0.0)] * 2]
    for inputs, command in drive(square, Errors(scale=scale, track=track)):
        estimate = odometry.update(inputs, command)
    assert inputs.truth is not None
    assert math.degrees(abs(estimate.heading - inputs.truth.heading)) < 0.5
    left, right = odometry.wheel_scales
    assert right / left == pytest.approx(scale[1] / scale[0], rel=0.005)


@pytest.mark.parametrize(("side", "lost"), [("left", 1.0), ("right", 0.6), ("left", 0.3)])
def test_a_wheel_that_spins_for_long_teaches_no_scales(side: str, lost: float) -> None:
    spins: list[Segment] = [(1.0, 0.0, 0.0), (14.0, 0.18, 0.0), (1.0, 0.0, 0.0)]
    odometry = Odometry(RobotConfig())
    for inputs, command in drive(spins, Errors(slip=(3.0, 14.0, side, lost))):
        estimate = odometry.update(inputs, command)
        assert abs(estimate.velocity) < 0.25
    assert inputs.truth is not None
    assert odometry.wheel_scales == pytest.approx((1.0, 1.0), abs=0.01)
    assert math.degrees(abs(estimate.heading - inputs.truth.heading)) < 1.0


def test_what_no_robot_toml_is_wrong_by_is_no_scale() -> None:
    """A wheel that spins from the first moment on, as where a robot stands at a wall when it starts."""
    spins: list[Segment] = [(1.0, 0.0, 0.0), (20.0, 0.18, 0.0), (1.0, 0.0, 0.0)]
    odometry = Odometry(RobotConfig())
    told: set[str] = set()
    for inputs, command in drive(spins, Errors(slip=(0.9, 20.0, "right", 1.0))):
        told.update(odometry.update(inputs, command).reasons)
        assert odometry.wheel_scales == pytest.approx((1.0, 1.0), abs=0.2)
    assert "the right wheel slips" in told
    assert "the wheels' scales do not fit the gyro" not in told


def test_a_bump_is_felt() -> None:
    device_scale = 9.80665 / 8192

    def hit(_: int, inputs: Inputs) -> Inputs:
        force = -4.0 if 2.5 <= inputs.time < 2.55 else 0.0
        return replace(inputs, accel=(force / device_scale, 0.0, 8192.0))

    found = run(drive(STRAIGHT), hit)
    told = [e.time for e, _ in found if any("bumped" in reason for reason in e.reasons)]
    assert 2.5 <= told[0] < 2.6
    quiet = run(drive([(1.5, 0.0, 0.0), (2.0, 0.0, 0.0)]), hit)
    assert not any("bumped" in r for e, i in quiet if i.time < 2.5 for r in e.reasons)


@pytest.mark.parametrize("late", [0.0, 0.005, 0.010, 0.015])
def test_a_blow_that_one_reading_shows_is_felt_whenever_it_comes(late: float) -> None:
    begin = 2.5 + late

    def hit(_: int, inputs: Inputs) -> Inputs:
        force = -20.0 if begin - 0.001 <= inputs.time < begin + 0.004 else 0.0  # 0.1 m/s
        return replace(inputs, accel=(force / (9.80665 / 8192), 0.0, 8192.0))

    found = run(drive(STRAIGHT), hit)
    told = [e.time for e, _ in found if any("bumped" in reason for reason in e.reasons)]
    assert begin <= told[0] < begin + 0.03


@pytest.mark.parametrize(("seconds", "unseen_wheels"), [(0.7, 2), (0.3, 1), (0.317, 2)])
def test_wheels_that_nobody_sees_are_no_bump(seconds: float, unseen_wheels: int) -> None:
    """RaccoonOS leaves a back-EMF beyond 2000 counts out: a fresh battery's at full power."""

    def unseen(_: int, inputs: Inputs) -> Inputs:
        felt = replace(inputs, accel=(0.0, 0.0, 8192.0))
        if not 2.5 <= inputs.time < 2.5 + seconds:
            return felt
        missing = (None,) * unseen_wheels
        return replace(
            felt, bemf=missing + felt.bemf[unseen_wheels:], position=missing + felt.position[unseen_wheels:]
        )

    fast: list[Segment] = [(1.5, 0.0, 0.0), (2.0, 0.3, 0.0), (1.0, 0.0, 0.0)]
    assert not any("bumped" in reason for e, _ in run(drive(fast), unseen) for reason in e.reasons)


def test_a_ramp_is_no_bump() -> None:
    """A robot that comes onto a ramp of 6 degrees within 0.4 s feels a tenth of its weight from then on. As
    its left wheel climbs something at 2 rad/s, it feels its weight to the left, and the gyro shows why."""
    rate, steepest = 2.0, 0.32

    def tilted(_: int, inputs: Inputs) -> Inputs:
        force = 1.02 * min(1.0, max(0.0, (inputs.time - 2.0) / 0.4))
        side = min(steepest, max(0.0, rate * (inputs.time - 3.0)))
        assert inputs.gyro is not None
        roll = rate / inputs.device.gyro_rad_s if 0.0 < side < steepest else 0.0
        accel = force * 8192 / 9.80665, math.sin(side) * 8192, 8192.0
        return replace(inputs, accel=accel, gyro=(roll, 0.0, inputs.gyro[2]))

    assert not any("bumped" in reason for e, _ in run(drive(STRAIGHT), tilted) for reason in e.reasons)


def test_a_gyro_that_lies_about_the_axis_is_no_bump() -> None:
    """A word that sticks at the end of its range (35 rad/s) would be a robot that turns head over heels."""

    def stuck(_: int, inputs: Inputs) -> Inputs:
        assert inputs.gyro is not None
        lies = (0.0, 32767.0) if 2.0 < inputs.time < 3.0 else (32767.0 * (inputs.time >= 3.0), 0.0)
        return replace(inputs, accel=(0.0, 0.0, 8192.0), gyro=(*lies, inputs.gyro[2]))

    assert not any("bumped" in reason for e, _ in run(drive(STRAIGHT), stuck) for reason in e.reasons)


@pytest.mark.parametrize(
    "settings",
    [{"gyro_noise": 0.0}, {"slip_noise": math.nan}, {"gyro_bias": -1.0}],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        OdometrySettings(**settings)
