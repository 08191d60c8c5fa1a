"""Measurement of the mitigations: each drives every manoeuvre on every robot, and the true errors at the end
are kept."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cached_property

from raccoon.cli.compare_mitigations.robots import TAPE_STD, Trial, trial
from raccoon.cli.compare_mitigations.timed import (
    QUARTER_TURN,
    TimedDrive,
    TunedTimes,
    matched_trims,
    quarter_turn,
    straight_leg,
    tune,
)
from raccoon.cli.compare_mitigations.vehicles import IMU_RATE_HZ, simulated_vehicle
from raccoon.control.voltage import VoltageScaling
from raccoon.core.config import RobotConfig
from raccoon.core.errors import MotionTimeout
from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs, Truth
from raccoon.model.paper import COMPETITION_VOLTAGE
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, repeat, wait
from raccoon.robot.actions.sequences import seq
from raccoon.robot.calibration.wheels import calibrate_drive
from raccoon.robot.motions.goals import straight, turn
from raccoon.robot.robot import Robot
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World
from raccoon.sweep.workers import process_crew

MANOEUVRES = ("30 cm", "1 m", "square 4 x 0.5 m", "turn 90")
GOALS = {
    "30 cm": (0.3, 0.0, 0.0),
    "1 m": (1.0, 0.0, 0.0),
    "square 4 x 0.5 m": (0.0, 0.0, 4.0 * QUARTER_TURN),
    "turn 90": (0.0, 0.0, QUARTER_TURN),
}
ACTIONS: dict[str, Action[object]] = {
    "30 cm": straight(0.3),
    "1 m": straight(1.0),
    "square 4 x 0.5 m": repeat(seq(straight(0.5), turn(QUARTER_TURN)), 4),
    "turn 90": turn(QUARTER_TURN),
}
SCALING = VoltageScaling(COMPETITION_VOLTAGE)


@dataclass(frozen=True, slots=True)
class End:
    """Errors at the end of a manoeuvre: distance along and lateral to the goal's heading (m), heading (rad);
    its duration in seconds."""

    distance: float
    lateral: float
    heading: float
    seconds: float


Ends = dict[str, End]
"""Errors by manoeuvre."""
Cells = dict[tuple[str, str, str], list[End]]
"""Errors of all robots by mitigation, condition and manoeuvre."""


class Candidate:
    """A robot of the table. What several mitigations need is computed once."""

    def __init__(self, each: Trial, config: RobotConfig, tape_std: float) -> None:
        self.trial = each
        self.config = config
        self._tape_std = max(tape_std, 1e-6)  # calibrate_drive refuses a tape without error

    @cached_property
    def calibrated(self) -> RobotConfig:
        """The configuration after a calibration drive of 1 m on the robot as it was tuned, by the tape with
        which times are tuned."""
        each = self.trial
        with Robot(_port(each.tuned, self.config, each.seed + 1), self.config) as robot:
            return calibrate_drive(
                robot, lambda: _truth(robot).x + each.tape[1], distance=1.0, tape_std=self._tape_std
            )


Method = Callable[[Candidate], Ends]


def _timed(way: TimedDrive, pick: Callable[[Trial], tuple[Parameters, Parameters]]) -> Method:
    def measure(robot: Candidate) -> Ends:
        before, now = pick(robot.trial)
        tuned = tune(way, before, robot.config, robot.trial.tape)
        return {name: _drive_timed(name, way, tuned, now, robot) for name in MANOEUVRES}

    return measure


def _drive_timed(
    name: str, way: TimedDrive, tuned: TunedTimes, parameters: Parameters, candidate: Candidate
) -> End:
    robot = simulated_vehicle(parameters, candidate.config, candidate.trial.seed, blind=way.blind)
    robot.stand(0.5, learn=True)
    begin = robot.time
    if name == "turn 90":
        quarter_turn(robot, way, tuned)
    elif name == "square 4 x 0.5 m":
        for corner in range(4):
            straight_leg(robot, way, tuned, 0.5, corner * QUARTER_TURN)
            quarter_turn(robot, way, tuned, (corner + 1) * QUARTER_TURN)
    else:
        straight_leg(robot, way, tuned, GOALS[name][0], 0.0)
    return _end(robot.truth, GOALS[name], robot.time - begin)


def _static_k(robot: Candidate) -> Ends:
    trims = matched_trims(robot.trial.tuned, robot.config)
    return _timed(TimedDrive(0.8, trims=trims), _tuned_and_run)(robot)


class WithoutGyro:
    """A port that hides the IMU of another port."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def read(self) -> Inputs:
        """The readings without gyro and accelerometer."""
        return replace(self._port.read(), gyro=None, accel=None)

    def write(self, outputs: Outputs) -> None:
        """Pass the command on."""
        self._port.write(outputs)

    def close(self) -> None:
        """Close the other port."""
        self._port.close()


def _closed_loop(gyro: bool) -> Method:
    def measure(robot: Candidate) -> Ends:
        return {name: _drive_closed(name, gyro, robot) for name in MANOEUVRES}

    return measure


def _drive_closed(name: str, gyro: bool, candidate: Candidate) -> End:
    config = candidate.calibrated
    port: Port = _port(candidate.trial.run, config, candidate.trial.seed)
    with Robot(port if gyro else WithoutGyro(port), config) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        with suppress(MotionTimeout):  # its error is then that of where it stands
            robot.run(ACTIONS[name])
        seconds = robot.time - begin
        robot.run(wait(0.3))
        return _end(_truth(robot), GOALS[name], seconds)


def _port(parameters: Parameters, config: RobotConfig, seed: int) -> SimPort:
    return SimPort(parameters, World.empty(), robot=config, seed=seed, imu_rate_hz=IMU_RATE_HZ)


def _truth(robot: Robot) -> Truth:
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    return robot.inputs.truth


def _end(truth: Truth, goal: tuple[float, float, float], seconds: float) -> End:
    ahead, aside = Pose(*goal).offset_of(truth.x, truth.y)
    return End(abs(ahead), abs(aside), abs(truth.heading - goal[2]), seconds)


def _tuned_and_run(each: Trial) -> tuple[Parameters, Parameters]:
    return each.tuned, each.run


METHODS: dict[str, Method] = {
    "none": _timed(TimedDrive(1.0), _tuned_and_run),
    "fresh battery": _timed(TimedDrive(1.0), lambda each: each.fresh),
    "voltage scaling, 100 %": _timed(TimedDrive(1.0, scaling=SCALING), _tuned_and_run),
    "voltage scaling, 80 %": _timed(TimedDrive(0.8, scaling=SCALING), _tuned_and_run),
    "motor swapping": _timed(TimedDrive(1.0), lambda each: each.matched),
    "static k": _static_k,
    "wheel PID on back-EMF": _closed_loop(gyro=False),
    "IMU heading only": _timed(TimedDrive(0.8, gyro=True), _tuned_and_run),
    "back-EMF + IMU fusion": _closed_loop(gyro=True),
}


def measure_robot(
    condition: str,
    number: int,
    seed: int,
    methods: Iterable[str] = tuple(METHODS),
    tape_std: float = TAPE_STD,
) -> dict[str, Ends]:
    """The errors of one robot in all manoeuvres under each mitigation. tape_std: standard deviation of the
    tape, m."""
    config = RobotConfig()
    robot = Candidate(trial(condition, number, seed, config, tape_std), config, tape_std)
    return {method: METHODS[method](robot) for method in methods}


Number = tuple[str, int]
"""One robot: its condition and its number."""
Found = dict[Number, dict[str, Ends]]
"""Errors by robot, then by mitigation."""


def _job(job: tuple[str, int, int, float]) -> dict[str, Ends]:
    condition, number, seed, tape_std = job
    with _quiet_log():
        return measure_robot(condition, number, seed, tape_std=tape_std)


@contextmanager
def _quiet_log() -> Iterator[None]:
    """Context in which the log "raccoon" shows errors only: advice to calibrate helps nobody if a motor was
    replaced on purpose."""
    log = logging.getLogger("raccoon")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def measure_all(
    robots: Mapping[str, int],
    seed: int,
    processes: int,
    *,
    tape_std: float = TAPE_STD,
    known: Mapping[Number, dict[str, Ends]] | None = None,
    done: Callable[[Number, dict[str, Ends]], None] = lambda _robot, _ends: None,
) -> Found:
    """Measure these numbers of robots of each condition. processes: number to use, 0 for one per core.

    known: results of robots that need not be driven again. done: called with each robot that was driven and
    its errors.
    """
    found = {robot: ends for robot, ends in (known or {}).items() if robot[1] < robots.get(robot[0], 0)}
    missing = [robot for robot in interleaved(robots) if robot not in found]
    jobs = [(*robot, seed, tape_std) for robot in missing]
    with process_crew(processes or None) if processes != 1 else nullcontext() as crew:
        results = map(_job, jobs) if crew is None else crew.executor.map(_job, jobs)
        for robot, ends in zip(missing, results, strict=True):
            found[robot] = ends
            done(robot, ends)
    return found


def interleaved(robots: Mapping[str, int]) -> list[Number]:
    """All robots in an order that fills every column at the same pace, so that a part of the work contains a
    part of each."""
    every = [(condition, number) for condition, count in robots.items() for number in range(count)]
    return sorted(every, key=lambda robot: (robot[1] + 0.5) / robots[robot[0]])


def group_by_cell(found: Found) -> Cells:
    """The errors of all robots, grouped by mitigation, condition and manoeuvre."""
    cells: Cells = {}
    for (condition, _), methods in sorted(found.items()):
        for method, ends in methods.items():
            for name, end in ends.items():
                cells.setdefault((method, condition, name), []).append(end)
    return cells
