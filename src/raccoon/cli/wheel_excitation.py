"""The shared parts of `raccoon tune wheels` and `raccoon calibrate motors`: exciting a robot's wheels, and
showing and storing the result."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.measured_values import write_if_asked
from raccoon.cli.outputs import check_folders
from raccoon.cli.shared_options import check_seed
from raccoon.core.config import REAL_CONTROLLERS, Measured, RobotConfig, load_robot

if TYPE_CHECKING:
    from raccoon.robot.calibration.identification import Excitation, WheelFit

PORTS = ("wombat", "wombat-raccoon", "sim")
FRESH_BATTERY_FACTOR = 1.06
"""Voltage of a fully charged battery relative to robot.toml's open-circuit voltage: 7.2 V where that is 6.8
V."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of both commands."""
    parser.add_argument(
        "--robot", type=Path, default=Path("robot.toml"), help="the robot's description (%(default)s)"
    )
    parser.add_argument(
        "--port", choices=PORTS, help="controller to drive (default: controller.port of robot.toml)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulator's noise (%(default)s)")
    parser.add_argument(
        "--write", action="store_true", help="write the result to robot.toml (default: only show it)"
    )


def excite_and_fit(
    args: argparse.Namespace, *, bare: bool = False
) -> tuple[Excitation, tuple[WheelFit, WheelFit]]:
    """Drive the robot forward and back and identify both wheels. Raises CalibrationError, HardwareError.

    bare: ignore the `power_factor` in robot.toml, since a new one must not build on it.
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
    room = required_room(config)
    print(f"the robot moves {room:.1f} m ahead and back: put it on the floor with room in front")
    with open_robot(config, seed=args.seed) as robot:
        robot.run(wait(1.0))
        seen = robot.run(excite())
        assert robot.inputs is not None
        return seen, fit_wheels(seen, config, robot.inputs.device)


def required_room(config: RobotConfig) -> float:
    """Free space ahead of the robot within which the drive stays, m, rounded up to decimetres: the way
    without any friction."""
    from raccoon.robot.calibration.identification import DUTY_LEVELS, LEVEL_TIME_S

    model = config.model
    seconds = LEVEL_TIME_S * (
        sum(DUTY_LEVELS) + sum(DUTY_LEVELS[:-1])
    )  # at full power, for the levels up and down again
    volts = FRESH_BATTERY_FACTOR * model.battery.open_circuit_voltage.value
    slowest = min(each.back_emf_constant.value for each in (model.left, model.right))
    return math.ceil(10.0 * seconds * volts / slowest * model.drive.wheel_radius.value) / 10.0


def show_and_write(args: argparse.Namespace, entries: Mapping[str, Measured]) -> int:
    """Print the measured values and, with `--write`, store them in robot.toml. Returns the exit status."""
    from raccoon.diagnose.reports.numbers import value_with_std_text

    for key, value in entries.items():
        print(f"{key} = {value_with_std_text(value.value, value.std)}, at {value.battery_voltage:.2f} V")
    return write_if_asked(args, entries, is_simulated(args))


def is_simulated(args: argparse.Namespace) -> bool:
    """Whether the driven robot is a simulated one."""
    return (args.port or load_robot(args.robot).controller.port) not in REAL_CONTROLLERS
