"""Compiles the simulated robots while the linters run, so that two test processes do not both have to."""

import gc
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from blind.generator import make
from blind.table import Eye, Floor, Numbers, TableRobot
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.motors.diagnosis import diagnose_motors
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from unit.diagnose.axes import motor

ROBOT = Parameters.from_robot(RobotConfig())
LOOSE = ROBOT.with_effect("drive.backlash", angle=0.1)
GIVING = ROBOT.with_effect("friction.presliding", compliance=0.001)
TIME = np.arange(3) * 0.005
STILL = Commands.of_wheels(TIME, 0.0 * TIME, 0.0 * TIME)

ASKED = [
    GIVING,
    GIVING.with_effect("drive.turn_scrub", torque=0.01),
    GIVING.with_effect("drive.backlash", angle=0.1),
]

COMPILING: list[Callable[[], object]] = [
    *(partial(rollout, [each] * 2, STILL, channels=("imu.gyro.z",), readings_only=True) for each in ASKED),
    partial(make, 1, seconds=4.0),
    *(partial(rollout, robots, STILL) for robots in ([ROBOT], [ROBOT] * 2, [LOOSE] * 2, [GIVING] * 2)),
    partial(TableRobot, Numbers(), Floor([[0.0, 1.0, 1.0, 1.0, 0.025]]), [Eye(0, 0.1, 0.0, 200.0, 3000.0)]),
    partial(diagnose_motors, motor(5, 0.008), RobotConfig()),
]


def compiled(number: int) -> None:
    """Compiles one of them, into the cache."""
    COMPILING[number]()


if __name__ == "__main__":
    # A compiler makes millions of objects and lets few go: looking after them took a sixth of the time.
    with ProcessPoolExecutor(2, initializer=gc.disable) as pool:
        list(pool.map(compiled, range(len(COMPILING))))
