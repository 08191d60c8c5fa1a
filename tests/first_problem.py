"""What a search begins with: the problem of a drive whose controller is known."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.habits.controller import find_habits
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.coordinates import Cause
from simulated_drives import BLIND_CONTROLLER


def make_problem(log: Log, robot: RobotConfig, causes: Sequence[Cause]) -> Problem:
    """The problem of a log of a blind drive, with the changes of commands whose rows it lost."""
    restored, habits = find_habits(log, robot, causes, None, BLIND_CONTROLLER)
    return drive_problem(restored, robot, causes, habits, None)
