"""What a blow leaves in doubt, and what is none: an accelerometer that sits beside the middle, a reversal."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from drive_traces import Segment, drive
from raccoon.core.config import MotorConfig, RobotConfig
from raccoon.core.readings import GRAVITY, SIMULATOR, Inputs, Outputs
from raccoon.estimate.drive.bump import BumpWatch
from raccoon.estimate.drive.odometry import Odometry

STRAIGHT: list[Segment] = [(1.0, 0.0, 0.0), (1.6, 0.18, 0.0)]
PUSHED, SLIDES = 0.1, 0.075
"""s for which something pushes a robot with 6 m/s2 more than its tyres hold, and s until these, of 8 m/s2,
have stopped it."""
MOVED = 0.5 * 6.0 * PUSHED**2 + 0.5 * 8.0 * SLIDES**2


def pushed(ahead: float, aside: float, every: int) -> Iterator[tuple[Inputs, Outputs]]:
    """A straight on which it is pushed so; an IMU that is read once in `every` cycles."""
    for cycle, (inputs, command) in enumerate(drive(STRAIGHT, gyro_every=every)):
        since = inputs.time - 2.0
        force = 6.0 if 0.0 <= since < PUSHED else -8.0 if 0.0 <= since < PUSHED + SLIDES else 0.0
        felt = force * ahead / SIMULATOR.accel_m_s2, force * aside / SIMULATOR.accel_m_s2
        accel = (*felt, GRAVITY / SIMULATOR.accel_m_s2) if cycle % every == 0 else None
        yield replace(inputs, accel=accel), command


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize(("ahead", "aside"), [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
def test_what_pushes_a_robot_leaves_its_place_in_doubt(ahead: float, aside: float, every: int) -> None:
    """Its wheels turn as if nothing were. To the side nothing but the accelerometer tells of it at all."""
    odometry, told = Odometry(RobotConfig()), set[str]()
    for inputs, command in pushed(ahead, aside, every):
        told.update(odometry.update(inputs, command).reasons)
    here = odometry.estimate
    along, across = (here.x_std, here.y_std) if ahead else (here.y_std, here.x_std)
    assert any(reason.startswith("bumped") for reason in told)
    assert 0.4 * MOVED < along < 2.0 * MOVED
    assert across < 0.02


def felt(watch: BumpWatch, forces: list[float], velocities: list[float], turn_rates: list[float]) -> bool:
    """Whether a robot was bumped that stood, and then felt and did this, in steps of 20 ms."""
    for _ in range(25):
        watch.update(0.02, 0.0, 0.0, still=True, sample_period=0.005)
    motion = zip(forces, velocities, turn_rates, strict=True)
    return any(watch.update(0.02, force, v, False, 0.005, turn_rate=w) for force, v, w in motion)


def test_an_accelerometer_beside_the_middle_feels_turns_and_no_blow() -> None:
    """8 cm beside it, in a spin at full power that is turned round."""
    rates = [min(2.5, 0.5 * step) for step in range(20)] + [max(-2.5, 2.5 - 0.5 * n) for n in range(20)]
    forces = [0.08 * (after - before) / 0.02 for before, after in zip([0.0, *rates], rates, strict=False)]
    still = [0.0] * len(rates)
    assert not felt(BumpWatch(), forces, still, rates)
    assert felt(BumpWatch(), forces, still, still)  # it was the turn that explained it


def test_a_full_reversal_that_is_felt_a_little_late_is_no_blow() -> None:
    def velocity(time: float) -> float:
        return 0.4 * (1.0 - math.exp(-time / 0.2)) - 0.8 * min(max((time - 1.0) / 0.08, 0.0), 1.0)

    times = [0.02 * step for step in range(80)]
    forces = [(velocity(t - 0.009) - velocity(t - 0.029)) / 0.02 for t in times]
    assert not felt(BumpWatch(), forces, [velocity(t) for t in times], [0.0] * len(times))


def test_a_jolt_that_the_duties_make_is_no_blow() -> None:
    """RaccoonOS reads the accelerometer every 20 ms: the first reading of a reversal counts for all of it."""
    jolted, struck = BumpWatch(), BumpWatch()
    for watch in (jolted, struck):
        for _ in range(25):
            watch.update(0.02, 0.0, 0.0, True, 0.02)
    assert not jolted.update(0.02, -9.0, 0.0, False, 0.02, jolt=1.8)
    assert struck.update(0.02, -9.0, 0.0, False, 0.02)


@pytest.mark.parametrize("inverted", [False, True])
def test_a_reversal_of_duties_on_a_coarse_accelerometer_is_no_blow(inverted: bool) -> None:
    robot = RobotConfig(motors={0: MotorConfig(inverted=inverted)})
    odometry = Odometry(robot)
    for cycle, (inputs, _) in enumerate(drive([(1.0, 0.0, 0.0), (1.2, 0.15, 0.0)], gyro_every=4)):
        sign = -1.0 if inverted else 1.0
        bemf, position = (sign * (each[0] or 0.0) for each in (inputs.bemf, inputs.position))
        ahead = 0.9 if inputs.time < 2.0 else -0.9
        duty = ahead if inputs.time > 1.0 else 0.0
        struck = 2.119 < inputs.time < 2.135
        force = -14.0 if struck else -9.0 if 1.999 < inputs.time < 2.015 else 0.0
        accel = (force / SIMULATOR.accel_m_s2, 0.0, GRAVITY / SIMULATOR.accel_m_s2)
        read = replace(
            inputs,
            accel=accel if cycle % 4 == 0 else None,
            bemf=(bemf, *inputs.bemf[1:]),
            position=(position, *inputs.position[1:]),
        )
        told = odometry.update(read, Outputs(duty=(sign * duty, duty, 0.0, 0.0))).reasons
        bumped = any(reason.startswith("bumped") for reason in told)
        assert not bumped or inputs.time > 2.119
    assert bumped  # by the blow a moment after the reversal


@pytest.mark.parametrize("silent", ["accelerometer", "IMU", "all"])
def test_a_speed_gained_while_nothing_was_felt_is_no_blow(silent: str) -> None:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(0.8, 0.0, 0.0), (0.7, 0.3, 0.0)], gyro_every=4):
        unseen = 0.8 <= inputs.time < 1.2  # it reaches 0.3 m/s after 0.375 s
        if unseen and silent == "all":
            continue
        accel = None if unseen or inputs.gyro is None else (0.0, 0.0, GRAVITY / SIMULATOR.accel_m_s2)
        gyro = None if unseen and silent == "IMU" else inputs.gyro
        told = odometry.update(replace(inputs, accel=accel, gyro=gyro), command).reasons
        assert not any(reason.startswith("bumped") for reason in told)
    assert odometry.estimate.velocity == pytest.approx(0.3, abs=0.02)
