"""The speed loop of benchmarks/motions.py: a step of the wanted speed, and the margins of its gains."""

from __future__ import annotations

import math

from motion_robots import DEG, Case, parameters_of, simulated, truth_of
from raccoon.control.feedforward import WheelModel, wheel_models
from raccoon.control.tuning import margins, speed_loop_gains
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.wheel_track import SPEED_SMOOTHING_S
from raccoon.model.paper import MOTORS
from raccoon.robot.actions.actions import Action, Steps, wait
from raccoon.robot.parts.drive import dead_time
from raccoon.robot.robot import Robot

STEP_SPEED = 4.0  # rad/s; needs 4.7 V of a nominal wheel, so the weakest battery has something left
STEP_BATTERIES = (5.8, 6.4, 7.2)
STEP_TICKS = 121
PERIOD = 0.005
BAND = 0.05
NOMINAL = wheel_models(RobotConfig())[0]
SETTLE_LIMIT = 3.0 * NOMINAL.time_constant + 2.0 * PERIOD
"""s: three mechanical time constants and two ticks."""
INERTIAS = (0.020, 0.014)  # kg m2 that one motor feels straight on and turning


def step_response(
    battery: float, left: int, right: int, config: RobotConfig, seed: int
) -> tuple[float, float]:
    """(s until both wheels stay within 5 % of a step of speed, overshoot as a share), from the true pose."""
    parameters = parameters_of(Case(battery, left, right, seed), RobotConfig())
    radius, half = config.model.drive.wheel_radius.value, 0.5 * config.model.drive.track_width.value
    speeds: list[tuple[float, float]] = []

    def steps(robot: Robot) -> Steps[None]:
        before = truth_of(robot)
        for _ in range(STEP_TICKS):
            robot.drive.velocity(STEP_SPEED * radius)
            yield
            here = truth_of(robot)
            way = math.copysign(math.hypot(here.x - before.x, here.y - before.y), here.x - before.x)
            turned = half * (here.heading - before.heading)
            speeds.append(((way - turned) / radius / PERIOD, (way + turned) / radius / PERIOD))
            before = here

    with Robot(simulated(parameters, config, seed), config) as robot:
        robot.run(wait(1.0))
        robot.run(Action("step", steps))
    return _settled(speeds)


def _settled(speeds: list[tuple[float, float]]) -> tuple[float, float]:
    late, most = 0, 0.0
    for number, pair in enumerate(speeds):
        if any(abs(speed - STEP_SPEED) > BAND * STEP_SPEED for speed in pair):
            late = number + 1
        most = max(most, *pair)
    return late * PERIOD, most / STEP_SPEED - 1.0


def worst_margins(config: RobotConfig, pairing: tuple[int, int] | None = None) -> tuple[float, float]:
    """(deg, dB) that the loops of a robot so calibrated have on its true motors, straight on and turning.

    pairing: indices of the paper's motors; without it the nominal gains on each of them.
    """
    left, right = wheel_models(config, SIMULATOR)
    late = dead_time(config)
    pairs = [(left, each) for each in MOTORS]
    if pairing is not None:
        pairs = [(left, MOTORS[pairing[0]]), (right, MOTORS[pairing[1]])]
    found = []
    for believed, motor in pairs:
        gains = speed_loop_gains(believed, SPEED_SMOOTHING_S, late)
        for inertia in INERTIAS:
            true = WheelModel(
                motor.armature_resistance, motor.back_emf_constant, NOMINAL.coulomb, NOMINAL.viscous, inertia
            )
            found.append(margins(gains, true, SPEED_SMOOTHING_S, late))
    return min(each.phase for each in found) / DEG, min(each.gain_db for each in found)
