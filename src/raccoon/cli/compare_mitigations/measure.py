"""Every mitigation drives every manoeuvre on every robot; the true ends are kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

from numpy.random import default_rng

from raccoon.cli.compare_mitigations.robots import Trial, trial
from raccoon.cli.compare_mitigations.timed import (
    TimedDrive,
    TimedRobot,
    Tuned,
    quarter_turn,
    straight_leg,
    tune,
)
from raccoon.control.voltage import VoltageScaling
from raccoon.core.config import RobotConfig
from raccoon.core.errors import MotionTimeout
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs, Truth
from raccoon.model.paper import COMPETITION_VOLTAGE
from raccoon.robot.actions import Action, repeat, seq, wait
from raccoon.robot.calibration import calibrate_drive
from raccoon.robot.motions import straight, turn
from raccoon.robot.robot import Robot
from raccoon.sim.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world import World

QUARTER = 0.5 * math.pi
MANOEUVRES = ("30 cm", "1 m", "square 4 x 0.5 m", "turn 90")
GOALS = {
    "30 cm": (0.3, 0.0, 0.0),
    "1 m": (1.0, 0.0, 0.0),
    "square 4 x 0.5 m": (0.0, 0.0, 4.0 * QUARTER),
    "turn 90": (0.0, 0.0, QUARTER),
}
TAPE_STD = 0.001


@dataclass(frozen=True, slots=True)
class End:
    """Errors of a manoeuvre: distance and lateral m, heading rad; s it took."""

    distance: float
    lateral: float
    heading: float
    seconds: float


Cells = dict[tuple[str, str, str], list[End]]
"""By mitigation, condition and manoeuvre."""


def _timed(way: TimedDrive, pick: Callable[[Trial], tuple[Parameters, Parameters]]) -> Method:
    def measure(each: Trial, config: RobotConfig) -> dict[str, End]:
        before, now = pick(each)
        tuned = tune(way, before, config)
        return {name: _drive_timed(name, way, tuned, now, config, each.seed) for name in MANOEUVRES}

    return measure


def _drive_timed(
    name: str, way: TimedDrive, tuned: Tuned, parameters: Parameters, config: RobotConfig, seed: int
) -> End:
    robot = TimedRobot(parameters, config, seed)
    robot.stand(0.5, learn=True)
    begin = robot.inputs.time
    if name == "turn 90":
        quarter_turn(robot, way, tuned)
    elif name == "square 4 x 0.5 m":
        for corner in range(4):
            straight_leg(robot, way, tuned, 0.5, corner * QUARTER)
            quarter_turn(robot, way, tuned, (corner + 1) * QUARTER)
    else:
        straight_leg(robot, way, tuned, GOALS[name][0], 0.0)
    return _end(robot.truth, GOALS[name], robot.inputs.time - begin)


def _static_k(each: Trial, config: RobotConfig) -> dict[str, End]:
    """The faster motor is slowed by what the straight drive of the tuned robot shows."""
    trims = (1.0, 1.0)
    for _ in range(3):
        way = TimedDrive(0.8, trims=trims)
        robot = TimedRobot(each.tuned, config, 1, noise=False)
        robot.leg(way, 0.8, 0.8, lambda seconds: seconds >= 3.0, None)
        length = math.hypot(robot.truth.x, robot.truth.y)
        ratio = 1.0 + robot.truth.heading * config.model.drive.track_width.value / max(length, 0.1)
        left, right = trims[0], trims[1] / ratio  # a turn to the left: the right motor is faster
        trims = left / max(left, right), right / max(left, right)
    return _timed(TimedDrive(0.8, trims=trims), lambda trial: (trial.tuned, trial.run))(each, config)


class WithoutGyro:
    """The robot without an IMU."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def read(self) -> Inputs:
        return replace(self._port.read(), gyro=None, accel=None)

    def write(self, outputs: Outputs) -> None:
        self._port.write(outputs)

    def close(self) -> None:
        self._port.close()


def _closed_loop(gyro: bool) -> Method:
    def measure(each: Trial, config: RobotConfig) -> dict[str, End]:
        calibrated = _calibrated(each, config)
        return {name: _drive_closed(name, gyro, each, calibrated) for name in MANOEUVRES}

    return measure


def _calibrated(each: Trial, config: RobotConfig) -> RobotConfig:
    """After a taped metre on the robot as it was tuned."""
    error = TAPE_STD * float(default_rng(each.seed).standard_normal())
    with Robot(SimPort(each.tuned, World.empty(), robot=config, seed=each.seed + 1), config) as robot:

        def taped() -> float:
            assert robot.inputs is not None
            assert robot.inputs.truth is not None
            return robot.inputs.truth.x + error

        return calibrate_drive(robot, taped, distance=1.0, tape_std=TAPE_STD)


def _drive_closed(name: str, gyro: bool, each: Trial, config: RobotConfig) -> End:
    actions: dict[str, Action[object]] = {
        "30 cm": straight(0.3),
        "1 m": straight(1.0),
        "square 4 x 0.5 m": repeat(seq(straight(0.5), turn(QUARTER)), 4),
        "turn 90": turn(QUARTER),
    }
    port: Port = SimPort(each.run, World.empty(), robot=config, seed=each.seed)
    with Robot(port if gyro else WithoutGyro(port), config) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        with suppress(MotionTimeout):  # where it stands then is its error
            robot.run(actions[name])
        seconds = robot.time - begin
        robot.run(wait(0.3))
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        return _end(robot.inputs.truth, GOALS[name], seconds)


def _end(truth: Truth, goal: tuple[float, float, float], seconds: float) -> End:
    dx, dy = truth.x - goal[0], truth.y - goal[1]
    cos, sin = math.cos(goal[2]), math.sin(goal[2])
    return End(abs(dx * cos + dy * sin), abs(dy * cos - dx * sin), abs(truth.heading - goal[2]), seconds)


Method = Callable[[Trial, RobotConfig], dict[str, End]]
SCALING = VoltageScaling(COMPETITION_VOLTAGE)


def _as_is(each: Trial) -> tuple[Parameters, Parameters]:
    return each.tuned, each.run


METHODS: dict[str, Method] = {
    "none": _timed(TimedDrive(1.0), _as_is),
    "fresh battery": _timed(TimedDrive(1.0), lambda each: each.fresh),
    "voltage scaling, 100 %": _timed(TimedDrive(1.0, scaling=SCALING), _as_is),
    "voltage scaling, 80 %": _timed(TimedDrive(0.8, scaling=SCALING), _as_is),
    "motor swapping": _timed(TimedDrive(1.0), lambda each: each.matched),
    "static k": _static_k,
    "wheel PID on back-EMF": _closed_loop(gyro=False),
    "IMU heading only": _timed(TimedDrive(0.8, gyro=True), _as_is),
    "back-EMF + IMU fusion": _closed_loop(gyro=True),
}


def cell(job: tuple[str, str, int, int]) -> dict[str, End]:
    """All manoeuvres of one robot under one mitigation: (mitigation, condition, number, seed)."""
    method, condition, number, seed = job
    config = RobotConfig()
    return METHODS[method](trial(condition, number, seed, config), config)


def measured(conditions: tuple[str, ...], robots: int, seed: int, processes: int) -> Cells:
    """Everything; in several processes where there is more than one."""
    jobs = [(m, c, n, seed) for m, c, n in product(METHODS, conditions, range(robots))]
    if processes > 1:
        with ProcessPoolExecutor(processes) as pool:
            found = list(pool.map(cell, jobs, chunksize=4))
    else:
        found = [cell(job) for job in jobs]
    cells: Cells = {}
    for (method, condition, _, _), ends in zip(jobs, found, strict=True):
        for name, end in ends.items():
            cells.setdefault((method, condition, name), []).append(end)
    return cells
