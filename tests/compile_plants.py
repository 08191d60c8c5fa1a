"""Compiles the simulated robots while the linters run, so that two test processes do not both have to."""

import numpy as np

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.sim.commands import Commands
from raccoon.sim.parameters import Parameters
from raccoon.sim.rollout import rollout

ROBOT = Parameters.from_robot(RobotConfig())
LOOSE = ROBOT.with_effect("drive.backlash", angle=0.1)
GIVING = ROBOT.with_effect("friction.presliding", compliance=0.001)
TIME = np.arange(3) * 0.005

for robots in ([ROBOT], [ROBOT, ROBOT], [LOOSE, LOOSE], [GIVING, GIVING]):
    rollout(robots, Commands.of_wheels(TIME, 0.0 * TIME, 0.0 * TIME))
rollout(
    [GIVING, GIVING],
    Commands.of_wheels(TIME, 0.0 * TIME, 0.0 * TIME),
    channels=("imu.gyro.z",),
    readings_only=True,
)
make(1, seconds=4.0)
