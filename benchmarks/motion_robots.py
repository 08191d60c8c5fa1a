"""The simulated robots of benchmarks/motions.py, and what becomes of one motion on one of them.

Each robot has two of the paper's three motors, a battery, back-EMF offsets as measured on real controllers
(30 counts, one standard deviation), the firmware's sensor chain (median of three, slots, coasting windows),
noise and an IMU at 50 Hz. It is calibrated once, as a team would: a taped straight drive of 1 m whose tape is
read to 1 mm (one standard deviation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Truth
from raccoon.model.paper import MOTORS, PaperMotor
from raccoon.robot.actions.actions import Action, wait
from raccoon.robot.calibration.wheels import calibrate_drive
from raccoon.robot.robot import Robot
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

BATTERIES = (6.1, 6.6, 7.0)
TAPE_STD = 0.001
OFFSET_STD = 30.0  # counts
IMU_RATE_HZ = 50.0
DEG = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Case:
    """One robot: battery V, indices of the paper's motors, seed of everything random."""

    battery: float
    left: int
    right: int
    seed: int

    @property
    def robot(self) -> tuple[int, int, int]:
        """What names the robot, on whatever battery."""
        return self.seed, self.left, self.right

    def noise(self, run: int) -> int:
        """Seed of the noise of one of its runs on this battery."""
        return int(np.random.default_rng((*self.robot, round(100.0 * self.battery), run)).integers(1 << 31))


def parameters_of(case: Case, config: RobotConfig) -> Parameters:
    """The simulated robot with the paper's motors in it."""
    parameters = Parameters.from_robot(config).with_chain(Chain.firmware())
    parameters = parameters.with_effect("battery.open_circuit_voltage", voltage=case.battery)
    offsets = OFFSET_STD * np.random.default_rng((*case.robot, 11)).standard_normal(2)
    for side, index, offset in (("left", case.left, offsets[0]), ("right", case.right, offsets[1])):
        parameters = with_motor(parameters, side, MOTORS[index])
        parameters = parameters.with_effect("bemf.offset", side, counts=float(offset))
    return parameters


def with_motor(parameters: Parameters, side: str, motor: PaperMotor) -> Parameters:
    """One of the paper's motors: resistance, constant and what its free current says of friction."""
    model = parameters.robot.model
    nominal = getattr(model, side)
    coulomb = motor.friction_torque - model.friction.viscous.value * motor.speed
    resistance = motor.armature_resistance / nominal.armature_resistance.value
    constant = motor.back_emf_constant / nominal.back_emf_constant.value
    return (
        parameters.with_effect("motor.armature_resistance", side, factor=resistance)
        .with_effect("motor.back_emf_constant", side, factor=constant)
        .with_effect("friction.coulomb", side, torque=coulomb)
    )


def simulated(parameters: Parameters, config: RobotConfig, seed: int) -> SimPort:
    """The robot on an endless white floor."""
    return SimPort(parameters, World.empty(), robot=config, seed=seed, imu_rate_hz=IMU_RATE_HZ)


def truth_of(robot: Robot) -> Truth:
    """Where the simulator has the robot."""
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    return robot.inputs.truth


def calibrated(case: Case, config: RobotConfig) -> RobotConfig:
    """The configuration after a taped drive of this robot on the battery of `case`."""
    error = TAPE_STD * float(np.random.default_rng((*case.robot, 7)).standard_normal())
    port = simulated(parameters_of(case, config), config, case.noise(99))
    with Robot(port, config) as robot:
        return calibrate_drive(robot, lambda: truth_of(robot).x + error, distance=1.0, tape_std=TAPE_STD)


@dataclass(frozen=True, slots=True)
class Error:
    """Ends of a motion against its goal: m, m, deg; s it took."""

    along: float
    across: float
    heading_deg: float
    seconds: float


def run(
    action: Action[object],
    goal: tuple[float, float, float],
    parameters: Parameters,
    config: RobotConfig,
    seed: int,
) -> Error:
    """Stand a second, do it, stand 0.3 s; the true end against the goal (x, y m, heading rad)."""
    with Robot(simulated(parameters, config, seed), config) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        robot.run(action)
        seconds = robot.time - begin
        robot.run(wait(0.3))
        return error_of(truth_of(robot), goal, seconds)


def error_of(end: Truth, goal: tuple[float, float, float], seconds: float) -> Error:
    """Along and across the goal's heading."""
    dx, dy = end.x - goal[0], end.y - goal[1]
    cos, sin = math.cos(goal[2]), math.sin(goal[2])
    return Error(
        abs(dx * cos + dy * sin),
        abs(dy * cos - dx * sin),
        abs(end.heading - goal[2]) / DEG,
        seconds,
    )
