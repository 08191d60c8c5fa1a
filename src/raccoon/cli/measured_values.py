"""Storing measured values in robot.toml on request, and the text that reports it."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.config import REAL_CONTROLLERS, Measured

if TYPE_CHECKING:
    from raccoon.trace.loading import Run

SIMULATED_NOTE = (
    "these are the simulated robot's values: measure again on the real one before it drives by them"
)


def write_if_asked(args: argparse.Namespace, entries: Mapping[str, Measured], of_a_simulation: bool) -> int:
    """Write the values to robot.toml if `--write` was given, and print what was done. Returns exit status
    0."""
    if not args.write:
        print(f"{args.robot} is unchanged: add --write to put these values in")
        return 0
    print(write_values(args.robot, entries))
    if of_a_simulation:
        print(SIMULATED_NOTE)
    return 0


def write_values(robot: Path, entries: Mapping[str, Measured]) -> str:
    """Write measured values to a robot.toml. Returns a text of what was done. Raises as `write_measured`."""
    from raccoon.core.config_file import write_measured

    history = write_measured(robot, entries, day=date.today())
    replaced = "" if history is None else f"; what was replaced is in {history.name} beside it"
    return f"wrote {robot}{replaced}"


def is_any_simulated(runs: Iterable[Run]) -> bool:
    """Whether at least one of these recordings names a simulated robot as its source."""
    return any(run.robot is not None and run.robot.controller.port not in REAL_CONTROLLERS for run in runs)
