"""Measured values: put into robot.toml where that was asked for, and what is said then."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.config import REAL_CONTROLLERS, Measured

if TYPE_CHECKING:
    from raccoon.trace.loading import Run

SIMULATED = "these are the simulated robot's values: measure again on the real one before it drives by them"


def put_in_if_asked(args: argparse.Namespace, entries: Mapping[str, Measured], of_a_simulation: bool) -> int:
    """Put the values into robot.toml where that was asked for, and say what was done."""
    if not args.write:
        print(f"{args.robot} is as it was: say --write to put these values in")
        return 0
    print(put_in(args.robot, entries))
    if of_a_simulation:
        print(SIMULATED)
    return 0


def put_in(robot: Path, entries: Mapping[str, Measured]) -> str:
    """Put measured values into a robot.toml; what was done, in words. Raises as `write_measured`."""
    from raccoon.core.config_file import write_measured

    history = write_measured(robot, entries, day=date.today())
    replaced = "" if history is None else f"; what was replaced is in {history.name} beside it"
    return f"wrote {robot}{replaced}"


def recorded_in_simulation(runs: Iterable[Run]) -> bool:
    """Whether one of these recordings says that it is of a simulated robot."""
    return any(run.robot is not None and run.robot.controller.port not in REAL_CONTROLLERS for run in runs)
