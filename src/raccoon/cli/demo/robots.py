"""Simulated robots with the paper's batteries and motors, and the demo's mission on each of them."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raccoon import Action, Robot, RobotConfig, after_time, calibrate_drive, motors, open_robot, wait
from raccoon.cli.demo.mission import REST_AT_START_S, Times, closed_loop_mission, goal, timed_mission
from raccoon.core.config import BatteryModel, Measured, NominalModel
from raccoon.core.readings import Inputs, Truth
from raccoon.model.paper import (
    ASSUMED_BACK_EMF_CONSTANT,
    ASSUMED_RESISTANCE,
    AVERAGE_CURRENT,
    COMPETITION_VOLTAGE,
    MOTORS,
    TABLE_VOLTAGE,
    TESTING_VOLTAGE,
    PaperMotor,
    battery_speeds,
)
from raccoon.robot.actions.functions import with_look

if TYPE_CHECKING:
    from raccoon.sim.effects.parameters import Parameters
    from raccoon.sim.port import SimPort

NAME = "demo"  # of the robot, by which the demo's recordings are recognized
BATTERIES = (6.1, 6.6, 7.0)
# As measured on another fleet; two motors at 0.2 A then lose the 0.05 V of the paper's worked example.
BATTERY_RESISTANCE = 0.12
SETTLE = 0.5  # s after the end of a drive, for the robot to come to rest
TAPE_STD = 0.0005  # m, standard deviation of a tape reading


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot: battery voltage (V), index of the paper's motor on each side, seed of its noise."""

    battery: float
    left: int
    right: int
    seed: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors of a mission's true end relative to its goal, and its true path.

    end: distance, m. heading: rad. path: (x, y), m.
    """

    end: float
    heading: float
    path: tuple[tuple[float, float], ...]


def configuration() -> RobotConfig:
    """The robot as its team knows it: nominal motors and battery, before any calibration."""
    model = NominalModel(battery=BatteryModel(internal_resistance=Measured(BATTERY_RESISTANCE, 0.03)))
    return RobotConfig(name=NAME, model=model)


def simulated_port(trial: Trial, run: int) -> SimPort:
    """The simulated robot of a trial, with its battery and motors, with noise. run: number that varies the
    noise's seed."""
    return _port(
        trial.battery, BATTERY_RESISTANCE, MOTORS[trial.left], MOTORS[trial.right], trial.seed * 1000 + run
    )


def _port(voltage: float, resistance: float, left: PaperMotor, right: PaperMotor, seed: int) -> SimPort:
    from raccoon.sim.effects.parameters import Parameters
    from raccoon.sim.port import SimPort
    from raccoon.sim.world.table import World

    config = configuration()
    parameters = (
        Parameters.from_robot(config)
        .with_effect("battery.open_circuit_voltage", voltage=voltage)
        .with_effect("battery.internal_resistance", resistance=resistance)
    )
    for side, motor in (("left", left), ("right", right)):
        parameters = _with_motor(parameters, config, side, motor)
    return SimPort(parameters, World.empty(), robot=config, seed=seed)


def _with_motor(parameters: Parameters, config: RobotConfig, side: str, motor: PaperMotor) -> Parameters:
    """The parameters with one of the paper's motors. The paper assumes the same motor current at every speed:
    that is Coulomb friction without any other friction."""
    nominal = config.model.left if side == "left" else config.model.right
    resistance = motor.armature_resistance / nominal.armature_resistance.value
    constant = motor.back_emf_constant / nominal.back_emf_constant.value
    return (
        parameters.with_effect("motor.armature_resistance", side, factor=resistance)
        .with_effect("motor.back_emf_constant", side, factor=constant)
        .with_effect("friction.coulomb", side, torque=motor.friction_torque)
        .with_effect("friction.viscous", side, coefficient=0.0)
    )


def true_pose(robot: Robot) -> Truth:
    """The robot's true pose in the simulator. Raises ValueError if the port gives none."""
    inputs: Inputs | None = robot.inputs
    if inputs is None or inputs.truth is None:
        raise ValueError("the port gives no truth")
    return inputs.truth


def run_mission(
    trial: Trial, mission: Action[Any], config: RobotConfig, record: Path | None = None
) -> Outcome:
    """Drive a mission on a newly placed robot and measure where it ends."""
    with open_robot(config, port=simulated_port(trial, 1), record=record, seed=trial.seed) as robot:
        path: list[tuple[float, float]] = []
        body = with_true_path(mission, path)
        robot.run(body)
        robot.run(wait(SETTLE))
        end = true_pose(robot)
    meant = goal()
    return Outcome(
        math.hypot(end.x - meant.x, end.y - meant.y), end.heading - meant.heading, tuple(path[::10])
    )


def replay_program(robot: Robot) -> None:
    """The program that was recorded, for its replay."""
    robot.run(closed_loop_mission())
    robot.run(wait(SETTLE))


def with_true_path(mission: Action[Any], path: list[tuple[float, float]]) -> Action[Any]:
    """The mission, with the true position of every cycle appended to `path`."""

    def look(robot: Robot) -> None:
        here = true_pose(robot)
        path.append((here.x, here.y))

    return with_look(mission, look, mission.name)


def open_loop(trial: Trial, times: Times) -> Outcome:
    """The outcome of the mission by time alone."""
    return run_mission(trial, timed_mission(times), configuration())


def calibrated_config(trial: Trial) -> RobotConfig:
    """The configuration after this robot's own calibration drive of 60 cm, measured by tape."""
    tape = random.Random(f"tape {trial.seed}")
    with open_robot(configuration(), port=simulated_port(trial, 0), seed=trial.seed) as robot:
        robot.run(wait(REST_AT_START_S))
        start = true_pose(robot)

        def measure() -> float:
            end = true_pose(robot)
            return math.hypot(end.x - start.x, end.y - start.y) + tape.gauss(0.0, TAPE_STD)

        return calibrate_drive(robot, measure, distance=0.60, tape_std=TAPE_STD)


def closed_loop(trial: Trial, record: Path | None = None) -> Outcome:
    """The outcome of the mission with the library, after the robot's own calibration."""
    return run_mission(trial, closed_loop_mission(), calibrated_config(trial), record)


def run_both(trial: Trial, times: Times, record: Path | None) -> tuple[Trial, Outcome, Outcome]:
    """The outcomes of the mission, open loop and with the library."""
    return trial, open_loop(trial, times), closed_loop(trial, record)


def trials(seed: int) -> list[Trial]:
    """The trials: every battery with every pairing of the paper's motors."""
    pairs = [(left, right) for left in range(len(MOTORS)) for right in range(len(MOTORS))]
    return [
        Trial(battery, left, right, seed * 100 + number)
        for number, (battery, (left, right)) in enumerate(
            (battery, pair) for battery in BATTERIES for pair in pairs
        )
    ]


def measure_times(seed: int) -> Times:
    """The times that a team measures on its own table: half-empty battery, two motors of kind 2, full
    power."""
    trial = Trial(BATTERIES[0], 1, 1, seed)
    metres = [_driven_distance(trial, seconds) for seconds in (1.5, 3.0)]
    radians = [_turned_angle(trial, seconds) for seconds in (0.3, 0.6)]
    per_metre = 1.5 / (metres[1] - metres[0])
    per_radian = 0.3 / (radians[1] - radians[0])
    return Times(per_metre, per_radian, 1.5 / per_metre - metres[0], 0.3 / per_radian - radians[0])


def _driven_distance(trial: Trial, seconds: float) -> float:
    end = _drive_timed(simulated_port(trial, 2), 1.0, 1.0, seconds)
    return math.hypot(end.x, end.y)


def _turned_angle(trial: Trial, seconds: float) -> float:
    return _drive_timed(simulated_port(trial, 2), -1.0, 1.0, seconds).heading


def _drive_timed(port: SimPort, left: float, right: float, seconds: float) -> Truth:
    with open_robot(configuration(), port=port) as robot:
        robot.run(motors(left, right).until(after_time(seconds)))
        robot.run(wait(SETTLE))
        return true_pose(robot)


@dataclass(frozen=True, slots=True)
class Claims:
    """The paper's two claims on this simulator, as relative gains: 0.159 for 15.9 %."""

    battery: float
    motors: float


def measure_claims(seed: int) -> Claims:
    """Compare how far full power drives the robot in the same 1.5 s at speed, as in the paper's two examples.

    battery: two of the assumed motors on a fresh battery relative to a half-empty one. motors: two fast
    motors relative to two slow ones, on a supply that holds 6.6 V, as they were measured.
    """
    assumed = PaperMotor(
        "assumed", battery_speeds()[0], AVERAGE_CURRENT, ASSUMED_RESISTANCE, ASSUMED_BACK_EMF_CONSTANT
    )

    def distance(voltage: float, resistance: float, motor: PaperMotor) -> float:
        ends = [
            _drive_timed(_port(voltage, resistance, motor, motor, seed), 1.0, 1.0, time).x
            for time in (1.5, 3.0)
        ]
        return ends[1] - ends[0]

    fresh = distance(COMPETITION_VOLTAGE, BATTERY_RESISTANCE, assumed)
    half_empty = distance(TESTING_VOLTAGE, BATTERY_RESISTANCE, assumed)
    fast, slow = (distance(TABLE_VOLTAGE, 0.0, motor) for motor in (MOTORS[2], MOTORS[0]))
    return Claims(fresh / half_empty - 1.0, fast / slow - 1.0)
