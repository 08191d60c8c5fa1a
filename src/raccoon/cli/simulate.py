"""`raccoon simulate PROGRAM`: run a team's unchanged program on the simulated robot."""

from __future__ import annotations

import argparse
import math
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING

from raccoon.cli.shared_options import add_place_options, check_seed, check_start

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig
    from raccoon.core.port import Port
    from raccoon.robot.opening import Substitute
    from raccoon.robot.robot import Robot
    from raccoon.sweep.program import Program

HELP = "run a program as it is, on the simulated robot instead of the controller that its robot.toml names"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("program", type=Path, help="a Python file that opens a robot, or has mission(robot)")
    parser.add_argument(
        "--model", type=Path, help="model.toml of the simulated robot; the program still uses robot.toml"
    )
    add_place_options(parser)
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulated noise (%(default)s)")
    parser.add_argument("--record", type=Path, help="recording to write if the program names none")
    parser.add_argument(
        "--traceback",
        action="store_true",
        help="show an error with the lines of this library too, not only the program's",
    )


def run(args: argparse.Namespace) -> int:
    """Run the program. Returns 1 if it ends with an error or opens no robot, otherwise its own exit status.
    Raises ConfigError for bad options."""
    from raccoon.core.errors import ConfigError, RaccoonError
    from raccoon.robot.opening import Substitute, substitute_robot
    from raccoon.robot.tracebacks import print_error
    from raccoon.sim.effects.model_file import load_model
    from raccoon.sim.port import open_simulated
    from raccoon.sim.world.collision import check_standing
    from raccoon.sim.world.table import World
    from raccoon.sim.world.table_file import load_world
    from raccoon.sweep.program import Program

    check_seed(args.seed)
    check_start(args.start)
    program = Program.read(args.program)
    if args.model is not None:
        args.model.open("rb").close()  # it is parsed later, for the robot that the program names
    world = None if args.table is None else load_world(args.table)
    start = (args.start[0], args.start[1], math.radians(args.start[2]))

    def port(config: RobotConfig, seed: int) -> Port:
        try:
            check_standing(start, World.default() if world is None else world, config.body)
            robot = None if args.model is None else load_model(args.model, config)
        except ConfigError as error:
            refused.append(error)
            raise
        return open_simulated(config, seed=seed, world=world, start=start, robot=robot)

    refused: list[Exception] = []  # errors of the command, not of the program whose robot was opened
    substitute = Substitute(port, args.record, args.seed)
    status = 0
    try:
        with substitute_robot(substitute), _as_main(program) as main:
            _run_program(program, main, substitute)
    except Exception as error:
        step = _traceback_of_program(error, program)
        if error in refused or (step is None and isinstance(error, RaccoonError | OSError)):
            raise
        if args.traceback:
            traceback.print_exception(error.with_traceback(step))
        else:
            print_error(error, "--traceback")
        status = 1
    finally:  # also after an interrupt or an exit
        for robot in substitute.robots:
            print(f"simulated {end_text(robot, start)}", flush=True)
    if not substitute.robots and not status:
        _print_that_nothing_ran(main)
        return 1
    return status


def _print_that_nothing_ran(main: ModuleType) -> None:
    calls = "; it defines main(), but does not call it" if callable(getattr(main, "main", None)) else ""
    said = f"the program opened no robot, and has no mission(robot){calls}"
    print(f"raccoon simulate: {said}", file=sys.stderr)


def end_text(robot: Robot, start: tuple[float, float, float]) -> str:
    """Duration of the run, s, and the robot's final pose, true and estimated, relative to its start, in m and
    degrees."""
    if robot.inputs is None or robot.inputs.truth is None:
        return "0.00 s: the program never read it"
    truth, (x0, y0, heading0) = robot.inputs.truth, start
    x, y, c, s = truth.x - x0, truth.y - y0, math.cos(heading0), math.sin(heading0)
    here = _pose_text(c * x + s * y, c * y - s * x, truth.heading - heading0)
    pose = robot.pose
    return f"{robot.time:.2f} s: it is at {here}; it believes {_pose_text(pose.x, pose.y, pose.heading)}"


def _pose_text(x: float, y: float, heading: float) -> str:
    degrees = math.degrees(math.remainder(heading, math.tau))
    return f"x {x:.3f} m, y {y:.3f} m, heading {degrees:.1f} deg"


def _run_program(program: Program, main: ModuleType, substitute: Substitute) -> None:
    """Run the text of the program in the module `main`; if that opens no robot, run its `mission` on one of
    robot.toml. The library's own `mission`, which a program may import, does not count."""
    import raccoon
    from raccoon.robot.actions.functions import perform
    from raccoon.robot.opening import open_robot

    program.run_in(main)
    mission = getattr(main, "mission", None)
    if not substitute.robots and mission not in (None, raccoon.mission):
        with open_robot("robot.toml") as robot:
            perform(robot, mission)


@contextmanager
def _as_main(program: Program) -> Iterator[ModuleType]:
    """Context with the main module, sys.path and sys.argv as they are for `python PROGRAM`; yields that
    module, which is empty."""
    path, argv, before = list(sys.path), list(sys.argv), sys.modules["__main__"]
    main = sys.modules["__main__"] = ModuleType("__main__")
    sys.path.insert(0, program.folder)
    sys.argv[:] = [program.file]
    try:
        yield main
    finally:
        sys.modules["__main__"] = before
        sys.path[:], sys.argv[:] = path, argv


def _traceback_of_program(error: Exception, program: Program) -> TracebackType | None:
    """The traceback from the program's first frame on, without its callers; None if the error came before the
    program began."""
    step = error.__traceback__
    while step is not None and step.tb_frame.f_code.co_filename != program.file:
        step = step.tb_next
    return step
