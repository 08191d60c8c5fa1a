"""What `raccoon tune wheels` and `raccoon calibrate motors` share: excite a robot's wheels and show them."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raccoon.cli.numbers import check_seed
from raccoon.cli.outputs import check_folders
from raccoon.core.config import REAL_CONTROLLERS, Measured, RobotConfig, load_robot

if TYPE_CHECKING:
    from raccoon.robot.calibration.identification import Excitation, WheelFit
    from raccoon.trace.loading import Run

PORTS = ("wombat", "wombat-raccoon", "sim")
SIMULATED = "these are the simulated robot's values: measure again on the real one before it drives by them"
FRESH = 1.06
"""Of robot.toml's battery, the fullest one: of 7.2 V where it says 6.8."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of both commands."""
    parser.add_argument(
        "--robot", type=Path, default=Path("robot.toml"), help="the robot's description (robot.toml)"
    )
    parser.add_argument(
        "--port", choices=PORTS, help="what to drive; without it robot.toml's controller.port"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the simulator's noise (0)")
    parser.add_argument(
        "--write", action="store_true", help="put the result into robot.toml (else only show it)"
    )


def excited(args: argparse.Namespace, *, bare: bool = False) -> tuple[Excitation, tuple[WheelFit, WheelFit]]:
    """Drive the robot ahead and back, and identify both wheels. Raises CalibrationError, HardwareError.

    bare: without the static compensation that robot.toml has, as a new one must not build on it.
    """
    from raccoon.robot.actions.actions import wait
    from raccoon.robot.calibration.identification import excite, fit_wheels
    from raccoon.robot.opening import open_robot

    check_seed(args.seed)
    config = load_robot(args.robot)
    if args.write:
        check_folders(args.robot)  # before anything moves
    if args.port is not None:
        config = replace(config, controller=replace(config.controller, port=args.port))
    if bare:
        ports = {config.drive.left, config.drive.right}
        plain = {port: replace(config.motor(port), power_factor=Measured(1.0)) for port in ports}
        config = replace(config, motors={**config.motors, **plain})
    print(f"the robot moves {room_of(config):.1f} m ahead and back: put it on the floor with room in front")
    with open_robot(config, seed=args.seed) as robot:
        robot.run(wait(1.0))
        seen = robot.run(excite())
        assert robot.inputs is not None
        return seen, fit_wheels(seen, config, robot.inputs.device)


def room_of(config: RobotConfig) -> float:
    """m ahead of the robot that its drive stays within, in whole decimetres: as if no friction held it."""
    from raccoon.robot.calibration.identification import LEVEL_TIME, LEVELS

    model = config.model
    seconds = LEVEL_TIME * (sum(LEVELS) + sum(LEVELS[:-1]))  # of full power: up the levels and down again
    volts = FRESH * model.battery.open_circuit_voltage.value
    slowest = min(each.back_emf_constant.value for each in (model.left, model.right))
    return math.ceil(10.0 * seconds * volts / slowest * model.drive.wheel_radius.value) / 10.0


def show(fit: WheelFit) -> None:
    """One wheel for people."""
    found, gains, reached = fit.voltages, fit.gains, fit.margins
    print(f"{fit.side} wheel, motor port {fit.port}: off by {found.residual:.3f} V on average")
    for name, unit in (("static", "V"), ("speed", "V/(rad/s)"), ("acceleration", "V/(rad/s2)")):
        print(f"  {name:13} {getattr(found, name):8.4f} +- {getattr(found, f'{name}_std'):.4f} {unit}")
    print(
        f"  gains         kp {gains.kp:.3f} V/(rad/s), ki {gains.ki:.2f} V/rad; time constant "
        f"{1e3 * fit.model.time_constant:.0f} ms"
    )
    print(
        f"  margins       {math.degrees(reached.phase):.0f} deg, {reached.gain_db:.1f} dB, crossover "
        f"{reached.crossover:.0f} rad/s: bears {1e3 * reached.delay:.0f} ms of delay beyond the model's"
    )


def finish(args: argparse.Namespace, entries: Mapping[str, Measured]) -> int:
    """Show what was measured by driving, and put it into robot.toml where that was asked for."""
    from raccoon.diagnose.reports.numbers import measured_text

    for key, value in entries.items():
        print(f"{key} = {measured_text(value.value, value.std)}, at {value.battery_voltage:.2f} V")
    return put_in_if_asked(args, entries, simulated(args))


def put_in_if_asked(args: argparse.Namespace, entries: Mapping[str, Measured], of_a_simulation: bool) -> int:
    """Put the values into robot.toml where that was asked for, and say what was done."""
    if not args.write:
        print(f"{args.robot} is as it was: say --write to put these values in")
        return 0
    print(put_in(args.robot, entries))
    if of_a_simulation:
        print(SIMULATED)
    return 0


def simulated(args: argparse.Namespace) -> bool:
    """Whether the robot that was driven is a simulated one."""
    return (args.port or load_robot(args.robot).controller.port) not in REAL_CONTROLLERS


def recorded_in_simulation(runs: Iterable[Run]) -> bool:
    """Whether one of these recordings says that it is of a simulated robot."""
    return any(run.robot is not None and run.robot.controller.port not in REAL_CONTROLLERS for run in runs)


def put_in(robot: Path, entries: Mapping[str, Measured]) -> str:
    """Put measured values into a robot.toml; what was done, in words. Raises as `write_measured`."""
    from raccoon.core.config_file import write_measured

    history = write_measured(robot, entries, day=date.today())
    replaced = "" if history is None else f"; what was replaced is in {history.name} beside it"
    return f"wrote {robot}{replaced}"


def add_calibration(kinds: Any) -> None:
    """`raccoon calibrate motors`."""
    text = "drive ahead and back, and find the factor k by which the faster motor gets less power"
    parser = kinds.add_parser(
        "motors",
        help=text,
        description=(
            "Drive the robot (within 0.3 m ahead, and back; as far as it says on larger wheels) and find the "
            "factor k of each motor, power_factor in robot.toml, that its power is multiplied by: the faster "
            "one gets less, so that at the same power both turn alike. It takes no recording. It is for "
            "programs that give the power themselves, such as motors(0.8, 0.8): straight, turn and the other "
            "motions make up for unequal motors without it."
        ),
    )
    add_arguments(parser)
    parser.set_defaults(calibrate=calibrate)


def calibrate(args: argparse.Namespace) -> int:
    """Measure k of both motors and store it with date, battery voltage and standard deviation."""
    from raccoon.robot.calibration.identification import power_factors

    seen, fits = excited(args, bare=True)
    return finish(args, power_factors(fits, seen.battery))
