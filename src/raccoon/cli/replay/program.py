"""Replay of a program on a recording of itself: it must estimate and command the same again."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from raccoon.cli.progress import show_progress
from raccoon.cli.replay.each_file import BAD_FILE, not_replayed_text, replay_each
from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, RaccoonError, ReplayDiverged
from raccoon.core.near_names import did_you_mean_file
from raccoon.robot.actions.functions import perform
from raccoon.robot.opening import no_robot_opened, replay
from raccoon.robot.robot import Robot
from raccoon.sweep.program import Mission, Program
from raccoon.trace.loading import Run


def replay_program(args: argparse.Namespace, files: Sequence[Path], robot: RobotConfig | None) -> int:
    """Replay a program on traces. Returns exit status 1 if it diverges from one of them, 2 if one of several
    cannot be used. Raises ConfigError."""
    program = read_program(args.program)
    with _program_errors(program), no_robot_opened():
        mission = program.mission()

    def same(run: Run) -> bool:
        if run.trace is None:
            raise ConfigError(f"{run.name}: a program needs a trace with its commands (.jsonl.gz)")
        try:
            with _program_errors(program), no_robot_opened():
                ran = _replay(run, mission, args, robot)
            print(f"{run.name}: {_verdict(ran, len(run.trace.ticks), compared=not args.ignore_commands)}")
        except ReplayDiverged as difference:
            print(f"{run.name}: {difference}")
            return False
        except EOFError as end:
            print(f"{run.name}: the program still ran when {end}")
        return True

    found, failed = replay_each(files, same)
    for name, reason in failed.items():
        print(not_replayed_text(name, reason))
    diverged = not all(found)
    if diverged and not args.ignore_commands:
        print(
            f"only mission(robot) of {args.program} ran, not the code around it: it must do everything with "
            "the robot that was done in the recording, including the wait for the start"
        )
    return BAD_FILE if failed else int(diverged)


def _replay(run: Run, mission: Mission, args: argparse.Namespace, robot: RobotConfig | None) -> int:
    """Replay the program on one run. Returns the number of cycles in which it ran. Raises ReplayDiverged,
    EOFError."""
    assert run.trace is not None

    def cycles(opened: Robot) -> int:
        perform(opened, mission)
        return opened.ticks

    with show_progress():
        checked = not args.ignore_commands
        return replay(run.trace, cycles, config=robot, tolerance=args.tolerance, check=checked)


def _verdict(ran: int, recorded: int, *, compared: bool) -> str:
    if not compared:
        return f"ran in {ran} of {recorded} cycles; its commands were not compared"
    if ran == recorded:
        return f"the same in all of {recorded} cycles"
    return f"the same in the first {ran} of {recorded} cycles, and ended; nothing moves in the others"


def read_program(path: Path) -> Program:
    """The program of a file. Raises ConfigError if there is no such file."""
    if path.is_dir():
        raise ConfigError(f"--program {path}: it is a folder; name a file")
    if not path.is_file():
        raise ConfigError(f"--program {path}: there is no such file{did_you_mean_file(path)}")
    return Program.read(path)


@contextmanager
def _program_errors(program: Program) -> Iterator[None]:
    """Context that turns errors of a team's program into a ConfigError with the program's line."""
    try:
        yield
    except (RaccoonError, EOFError):
        raise
    except (Exception, SystemExit) as error:
        line = program.line_of(error)
        place = f"{program.name}" if line is None else f"{program.name}, line {line}"
        raise ConfigError(f"--program {place}: {type(error).__name__}: {error}") from error
