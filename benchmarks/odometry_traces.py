"""Traces with known truth for the odometry benchmark: matches of the simulated robot, and the recorded
sessions.

A match: two seconds of waiting, then missions of drives, turns and pauses. The program that drives follows
the true heading, so a trace does not depend on the odometry that is tested on it.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from raccoon.core.config import (
    BemfModel,
    DriveModel,
    Measured,
    MotorConfig,
    NominalModel,
    RobotConfig,
)
from raccoon.core.readings import SI_WORDS, Inputs, Outputs, Truth
from raccoon.estimate.drive_calibration.straight import calibrate_straight
from raccoon.model.drive import arc_end
from raccoon.sim.effects.chain import Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

DATA = Path(os.environ.get("RACCOON_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
DEGREES_AN_HOUR = math.radians(1.0) / 3600.0
Cycle = tuple[Inputs, Outputs]


@dataclass(frozen=True)
class Trace:
    """A recorded or simulated drive. start: cycle at which the match begins (before it is set-up time)."""

    name: str
    robot: RobotConfig
    cycles: Sequence[Cycle]
    start: int = 0

    @property
    def path(self) -> float:
        """Length of the true way after the start, m."""
        truth = [cycle.truth for cycle, _ in self.cycles[self.start :] if cycle.truth is not None]
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(truth))


def missions(random: np.random.Generator, seconds: float) -> list[tuple[float, float, float]]:
    """Segments (seconds, m/s, rad/s) of a match."""
    plan = [(2.0, 0.0, 0.0)]
    while sum(each[0] for each in plan) < seconds - 8.0:
        speed = float(random.choice([0.1, 0.15, 0.18])) * float(random.choice([1, 1, 1, -1]))
        plan.append((float(random.uniform(0.3, 0.9)) / abs(speed), speed, 0.0))
        plan.append((float(random.uniform(0.2, 0.6)), 0.0, 0.0))
        angle = math.radians(float(random.choice([45, 90, 90, 135, 180]))) * float(random.choice([1, -1]))
        plan.append((abs(angle) / 1.6, 0.0, math.copysign(1.6, angle)))
        plan.append((float(random.choice([0.3, 0.6, 1.5])), 0.0, 0.0))
    plan.append((2.0, 0.0, 0.0))
    return plan


class Driver:
    """Duties that follow a plan by the true motion: a feedforward of the nominal motor and a little
    feedback.
    """

    def __init__(self, robot: RobotConfig) -> None:
        model = robot.model
        self._radius = model.drive.wheel_radius.value
        self._half = 0.5 * model.drive.track_width.value
        self._volts = model.battery.open_circuit_voltage.value
        self._k = model.left.back_emf_constant.value
        self._rest = model.friction.coulomb.value / self._k * model.left.armature_resistance.value
        self._speed = self._turn = self._wanted = 0.0

    def outputs(self, truth: Truth, goal: tuple[float, float], dt: float) -> Outputs:
        """Duty for the next cycle."""
        self._speed += float(np.clip(goal[0] - self._speed, -0.6 * dt, 0.6 * dt))
        self._turn += float(np.clip(goal[1] - self._turn, -8.0 * dt, 8.0 * dt))
        self._wanted += self._turn * dt
        if goal == (0.0, 0.0) and abs(self._speed) + abs(self._turn) < 1e-9:
            self._wanted = truth.heading
            return Outputs()
        turn = self._turn + 4.0 * (self._wanted - truth.heading)
        duties = [self._duty((self._speed + side * turn * self._half) / self._radius) for side in (-1.0, 1.0)]
        return Outputs(duty=(duties[0], duties[1], 0.0, 0.0))

    def _duty(self, speed: float) -> float:
        volts = self._k * speed + (math.copysign(self._rest, speed) if abs(speed) > 0.05 else 0.0)
        return max(-1.0, min(1.0, volts / self._volts))


def simulated(
    name: str,
    robot: RobotConfig,
    parameters: Parameters,
    plan: Sequence[tuple[float, float, float]],
    seed: int,
    **options: float | Noise,
) -> Trace:
    """What the simulated robot does and reads when it drives a plan."""
    port = SimPort(parameters, World.empty(), robot=robot, seed=seed, **options)  # type: ignore[arg-type]
    driver, cycles, outputs = Driver(robot), [], Outputs()
    inputs = port.read()
    for seconds, velocity, turn_rate in plan:
        for _ in range(round(seconds * 200)):
            cycles.append((inputs, outputs))
            assert inputs.truth is not None
            outputs = driver.outputs(inputs.truth, (velocity, turn_rate), 0.005)
            port.write(outputs)
            inputs = port.read()
    port.close()
    return Trace(name, robot, cycles)


def match(
    seed: int,
    parameters: Parameters,
    seconds: float = 120.0,
    name: str = "match",
    noise: Noise | None = None,
) -> Trace:
    """A match of the robot with these effects; noise: of its sensors, the simulator's own if None."""
    random = np.random.default_rng([seed, 1])
    plan = missions(random, seconds)
    return simulated(name, parameters.robot, parameters, plan, seed, noise=noise or Noise())


def calibrated(parameters: Parameters, seed: int) -> RobotConfig:
    """The robot after the drive of 0.6 m along a tape (read to 2 mm) that teams make at set-up."""
    robot = parameters.robot
    plan = [(2.0, 0.0, 0.0), (4.0, 0.15, 0.0), (1.0, 0.0, 0.0)]
    cycles = simulated("calibration", robot, parameters, plan, seed + 1_000_000).cycles
    truth = cycles[-1][0].truth
    assert truth is not None
    read = math.hypot(truth.x, truth.y) + 0.002 * float(np.random.default_rng([seed, 4]).normal())
    found = calibrate_straight(robot, [inputs for inputs, _ in cycles], read)
    motors = {
        robot.drive.left: MotorConfig(radians_per_tick=found.left, bemf_offset=found.left_offset),
        robot.drive.right: MotorConfig(radians_per_tick=found.right, bemf_offset=found.right_offset),
    }
    return replace(robot, motors=motors)


def spread_motors(seed: int) -> Parameters:
    """Motors drawn from the spread of real ones: 4 % of back-EMF, offsets of 40 counts."""
    random = np.random.default_rng([seed, 5])
    found = Parameters.from_robot(RobotConfig())
    for side in ("left", "right"):
        factor = 1.0 + 0.04 * float(np.clip(random.normal(), -2.0, 2.0))
        found = found.with_effect("motor.back_emf_constant", side, factor=factor)
        counts = 40.0 * float(np.clip(random.normal(), -2.0, 2.0))
        found = found.with_effect("bemf.offset", side, counts=counts)
    return found


def real_robot(seed: int, robot: RobotConfig | None = None) -> Parameters:
    """The faults of real robots: gyro drift of 109 or 27 degrees an hour, offsets, motors that differ by 4
    %.
    """
    random = np.random.default_rng([seed, 2])
    drift = (109.0, 27.0)[seed % 2] * DEGREES_AN_HOUR * float(random.choice([-1, 1]))
    spread = float(random.choice([-1, 1])) * 0.02
    parameters = Parameters.from_robot(robot or RobotConfig())
    parameters = parameters.with_effect("imu.gyro_bias", rate=0.75 * drift)
    parameters = parameters.with_effect("imu.gyro_drift", rate_per_second=0.5 * drift / 120.0)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        parameters = parameters.with_effect("motor.back_emf_constant", side, factor=1.0 + sign * spread)
        offset = float(np.clip(random.normal(0.0, 40.0), -80.0, 80.0))
        parameters = parameters.with_effect("bemf.offset", side, counts=offset)
    return parameters


# Effects of the drive and its sensors, each at a size that real robots show.
EFFECTS: tuple[tuple[str, str | None, dict[str, float]], ...] = (
    ("motor.back_emf_constant", "left", {"factor": 1.03}),
    ("bemf.offset", "left", {"counts": 30.0}),
    ("bemf.scale", "right", {"factor": 0.97}),
    ("bemf.dead_zone", None, {"counts": 25.0}),
    ("bemf.filter_lag", None, {"time_constant": 0.030}),
    ("drive.wheel_radius", "left", {"factor": 1.02}),
    ("drive.track_width", None, {"factor": 1.02}),
    ("drive.wheel_slip", None, {"time": 0.02}),
    ("drive.wheel_slip", None, {"time": 0.05}),
    ("drive.turn_scrub", None, {"torque": 0.05}),
    ("drive.inertia", None, {"factor": 1.3}),
    ("drive.slope", None, {"along_x": 0.03, "along_y": 0.02}),
    ("drive.wheel_eccentricity", "left", {"amplitude": 0.02, "phase": 0.0}),
    ("drive.backlash", None, {"angle": 0.03}),
    ("imu.gyro_bias", None, {"rate": 109 * DEGREES_AN_HOUR}),
    ("imu.gyro_scale", None, {"factor": 1.002}),
    ("imu.gyro_drift", None, {"rate_per_second": 27 * DEGREES_AN_HOUR / 60}),
    ("imu.latency", None, {"seconds": 0.012}),
)


def with_slip(trace: Trace, begin: float, seconds: float, side: str, share: float) -> Trace:
    """The same drive, but one wheel loses a share of its way over the ground: truth and gyro change,
    wheels do not.

    The left wheel's loss turns the robot left. Its truth is integrated anew with what the wheel still rolls.
    """
    track = trace.robot.model.drive.track_width.value
    cycles: list[Cycle] = []
    x = y = heading = extra = 0.0
    before: Truth | None = None
    for inputs, outputs in trace.cycles:
        truth = inputs.truth
        assert truth is not None
        rate = 0.0
        if before is not None:
            turn = truth.heading - before.heading
            direction = before.heading + 0.5 * turn
            way = (truth.x - before.x) * math.cos(direction) + (truth.y - before.y) * math.sin(direction)
            if begin <= inputs.time < begin + seconds:
                sign = -1.0 if side == "left" else 1.0
                lost = share * (way + sign * 0.5 * turn * track)
                way -= 0.5 * lost
                lost_turn = -sign * lost / track
                turn += lost_turn
                extra += lost_turn
                rate = lost_turn / 0.005
            x += way * math.cos(heading + 0.5 * turn)
            y += way * math.sin(heading + 0.5 * turn)
            heading += turn
        before = truth
        gyro = inputs.gyro
        if gyro is not None and rate:
            gyro = (gyro[0], gyro[1], gyro[2] + round(rate / inputs.device.gyro_rad_s))
        cycles.append((replace(inputs, gyro=gyro, truth=Truth(x, y, heading)), outputs))
    return Trace(f"slip {side}", trace.robot, cycles)


def with_random_slip(trace: Trace, std: float, seed: int) -> Trace:
    """The same drive, but either wheel loses or gains a little way all the time: `std` m after one metre.

    Truth and gyro change, the wheels' readings do not.
    """
    track = trace.robot.model.drive.track_width.value
    random = np.random.default_rng([seed, 6])
    cycles: list[Cycle] = []
    x = y = heading = time = 0.0
    before: Truth | None = None
    for inputs, outputs in trace.cycles:
        truth, gyro = inputs.truth, inputs.gyro
        assert truth is not None
        if before is not None:
            turn = truth.heading - before.heading
            direction = before.heading + 0.5 * turn
            way = (truth.x - before.x) * math.cos(direction) + (truth.y - before.y) * math.sin(direction)
            rolled = np.abs([way - 0.5 * turn * track, way + 0.5 * turn * track])
            left, right = (std * np.sqrt(rolled) * random.standard_normal(2)).tolist()
            if gyro is not None:
                rate = (right - left) / track / (inputs.time - time)
                gyro = (gyro[0], gyro[1], gyro[2] + round(rate / inputs.device.gyro_rad_s))
            way, turn = way + 0.5 * (left + right), turn + (right - left) / track
            x, y, heading = arc_end(x, y, heading, way, turn)
        before, time = truth, inputs.time
        cycles.append((replace(inputs, gyro=gyro, truth=Truth(x, y, heading)), outputs))
    return Trace(f"{trace.name}, random slip", trace.robot, cycles)


def with_wandering_bias(trace: Trace, walk: float, seed: int) -> Trace:
    """The same drive with a gyro whose bias wanders by `walk` rad/s in one second, with the root of time."""
    random = np.random.default_rng([seed, 7])
    cycles: list[Cycle] = []
    bias, time = 0.0, trace.cycles[0][0].time
    for inputs, outputs in trace.cycles:
        bias += walk * math.sqrt(inputs.time - time) * float(random.standard_normal())
        time = inputs.time
        gyro = inputs.gyro
        if gyro is not None:
            gyro = gyro[0], gyro[1], gyro[2] + bias / inputs.device.gyro_rad_s
        cycles.append((replace(inputs, gyro=gyro), outputs))
    return Trace(f"{trace.name}, wandering bias", trace.robot, cycles)


def optiodom_robot(session: str, left: float, right: float, track: float) -> RobotConfig:
    """The recorded robot; left, right: m of wheel way in a tick, track: m. Its wheels' nominal diameter is
    84 mm.
    """
    radius = 0.042
    model = NominalModel(
        drive=DriveModel(wheel_radius=Measured(radius, 1e-4), track_width=Measured(track, 0.001)),
        bemf=BemfModel(offset=Measured(0.0, 0.0)),
    )
    motors = {
        port: MotorConfig(
            radians_per_tick=Measured(way / radius, 0.002 * way / radius), bemf_offset=Measured(0.0, 0.0)
        )
        for port, way in ((0, left), (1, right))
    }
    return RobotConfig(name=session, motors=motors, model=model)


def optiodom(session: str, run: int, robot: RobotConfig) -> Trace:
    """One recorded run: 20 Hz, ticks a cycle right and left, motion capture as truth; no gyro, no
    back-EMF.
    """
    with (DATA / "optiodom" / session / f"run-{run:02d}.csv").open() as file:
        rows = np.array([[float(each) for each in row] for row in csv.reader(file)])
    counts = np.cumsum(rows[:, [5, 4]], axis=0)
    heading = np.unwrap(rows[:, 3])
    cycles = [
        (
            Inputs(
                time=float(row[0]),
                device=SI_WORDS,
                position=(float(ticks[0]), float(ticks[1]), None, None),
                truth=Truth(float(row[1]), float(row[2]), float(angle)),
            ),
            Outputs(),
        )
        for row, ticks, angle in zip(rows, counts, heading, strict=True)
    ]
    return Trace(f"{session} run {run}", robot, cycles)


def sessions() -> list[str]:
    """Names of the recorded sessions."""
    return sorted(each.name for each in (DATA / "optiodom").iterdir() if each.is_dir())


def runs(session: str) -> list[int]:
    """Numbers of a session's runs."""
    return sorted(int(each.stem[4:]) for each in (DATA / "optiodom" / session).glob("run-*.csv"))
