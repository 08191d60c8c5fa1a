"""The manoeuvres on which the plant is compared with the simulators of others, and how it drives them."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from peer_robots import GRAVITY, Body, Motors
from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

BODY = Body()
ROWS = 400
TIME = np.arange(ROWS) * 0.005
ONES = np.ones(ROWS)
Floats = NDArray[np.float64]
PULSE = np.where(TIME < 1.0, 0.8, 0.0)
MANOEUVRES = {
    "straight": (0.6 * ONES, 0.6 * ONES, True, 0.0),
    "turn": (-0.5 * ONES, 0.5 * ONES, True, 0.0),
    "arc": (0.4 * ONES, 0.7 * ONES, True, 0.0),
    "coast": (PULSE, PULSE, False, 0.0),
    "brake": (PULSE, PULSE, True, 0.0),
    "uphill": (0.4 * ONES, 0.55 * ONES, True, -0.1),
    "downhill": (0.4 * ONES, 0.55 * ONES, True, 0.1),
}


def robot(motors: Motors, slope: float = 0.0) -> Parameters:
    """Our plant with a peer's constants."""
    model = RobotConfig().model
    motor = replace(
        model.left,
        armature_resistance=Measured(motors.resistance),
        back_emf_constant=Measured(motors.back_emf),
    )
    model = replace(
        model,
        battery=replace(
            model.battery, open_circuit_voltage=Measured(motors.voltage), internal_resistance=Measured(0.0)
        ),
        left=motor,
        right=motor,
        friction=replace(model.friction, coulomb=Measured(motors.coulomb), viscous=Measured(motors.viscous)),
        drive=replace(
            model.drive,
            inertia_straight=Measured(BODY.inertia_straight),
            inertia_turn=Measured(BODY.inertia_turn),
            wheel_radius=Measured(BODY.radius),
            track_width=Measured(BODY.track),
        ),
    )
    pull = 0.5 * BODY.mass * GRAVITY * math.sin(slope) * BODY.radius
    plant = Parameters.from_robot(replace(RobotConfig(), model=model))
    return plant.with_effect("drive.slope", along_x=pull, along_y=0.0)


def our_end(
    motors: Motors, left: Floats, right: Floats, brake: bool, slope: float = 0.0
) -> tuple[Floats, float]:
    """Pose at the end, and the way of the wheel that turned further (m)."""
    run = rollout(robot(motors, slope), Commands.of_wheels(TIME, left, right, brake), longest_step=0.001)
    pose = np.array([run[f"truth.{each}"][0, -1] for each in ("x", "y", "heading")])
    way = max(0.005 * np.sum(np.abs(run[f"motor.{port}.speed"][0])) for port in (0, 1))
    return pose, BODY.radius * float(way)
