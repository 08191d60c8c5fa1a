"""A program over a recording of itself: it must estimate and command the same again."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, cast

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, ReplayDiverged
from raccoon.robot.opening import replay
from raccoon.trace.loading import Run


def replay_program(args: argparse.Namespace, runs: list[Run], robot: RobotConfig | None) -> int:
    """Replay a program on traces. Exit status 1 where it diverges from one of them."""
    mission = load_mission(args.program)
    diverged = 0
    for run in runs:
        if run.trace is None:
            raise ConfigError(f"{run.name}: a program needs a trace with its commands (.jsonl.gz)")
        try:
            _replay(run, mission, args, robot)
            print(f"{run.name}: the same in all of {len(run.trace.ticks)} cycles")
        except ReplayDiverged as difference:
            diverged += 1
            print(f"{run.name}: {difference}")
        except EOFError as end:
            print(f"{run.name}: the program still ran when {end}")
    return 1 if diverged else 0


def _replay(
    run: Run, mission: Callable[[Any], Any], args: argparse.Namespace, robot: RobotConfig | None
) -> None:
    assert run.trace is not None
    replay(run.trace, mission, config=robot, tolerance=args.tolerance, check=not args.ignore_commands)


def load_mission(path: Path) -> Callable[[Any], Any]:
    """The function `mission` of a program file. Raises ConfigError where there is none."""
    if not path.is_file():
        raise ConfigError(f"--program {path}: there is no such file")
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"--program {path}: not a Python file (.py)")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    mission = getattr(module, "mission", None)
    if not callable(mission):
        raise ConfigError(f"--program {path}: it must define mission(robot)")
    return cast(Callable[[Any], Any], mission)
