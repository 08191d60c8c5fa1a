"""`raccoon doctor`: find what is wrong with the robot, and what to do about it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.config import RobotConfig, load_robot
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.sections import CONTROLLERS, REAL_CONTROLLERS

if TYPE_CHECKING:
    from raccoon.core.port import Port
    from raccoon.hal.doctor import Report

HELP = "check controller, motors, sensors and battery; exit status 0 only when all is well"
FIRMWARES = ("stock", "17", "21")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--robot", type=Path, help="robot description (default: robot.toml, if it exists)")
    parser.add_argument(
        "--port", choices=CONTROLLERS, help="controller to examine (default: controller.port of robot.toml)"
    )
    parser.add_argument(
        "--no-motion", action="store_true", help="move nothing; without this each wheel turns back and forth"
    )
    parser.add_argument(
        "--firmware",
        choices=FIRMWARES,
        help="firmware of the emulated controller, only with --port emulator (default: stock)",
    )
    parser.add_argument("--i2c", default="/dev/i2c-1", metavar="DEVICE", help="I2C bus for added sensors")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(args: argparse.Namespace) -> int:
    """Examine the robot and print the report. Returns 0 if everything is well, otherwise 1."""
    config = _config(args)
    port = config.controller.port
    if args.firmware is not None and port != "emulator":
        choice = "it is an option of --port emulator"
        raise ConfigError(f"--firmware {args.firmware}: {choice}, and {port} is examined")
    say = _silent if args.json else _print_progress
    if not args.no_motion:
        say("the robot will move: put it on the floor with 20 cm around it, and keep it still")
    report = _report(config, args, say)
    if args.json:
        print(json.dumps(report.as_json(), indent=2, allow_nan=False))
    else:
        print(report.table())
    return 0 if report.well else 1


def _config(args: argparse.Namespace) -> RobotConfig:
    usual = Path("robot.toml")
    path = args.robot or (usual if usual.exists() else None)
    config = RobotConfig() if path is None else load_robot(path)
    if args.port is None:
        return config
    return replace(config, controller=replace(config.controller, port=args.port))


def _report(config: RobotConfig, args: argparse.Namespace, say: Callable[[str], None]) -> Report:
    from raccoon.hal.doctor import Report, examine
    from raccoon.hal.doctor.buses import list_i2c_devices, list_serial_ports
    from raccoon.hal.doctor.examination import lost_device_finding
    from raccoon.robot.loop import stopped_on_exit

    report = Report()
    try:
        port = _port(config, args.firmware or "stock")
    except HardwareError as error:
        report.add(lost_device_finding(error))
    else:
        try:
            with stopped_on_exit(port.close):
                report = examine(port, config, move=not args.no_motion, progress=say)
        except HardwareError as error:  # raised by close if the motors may still run
            report.add(lost_device_finding(error))
    if config.controller.port in REAL_CONTROLLERS:
        report.add(list_i2c_devices(args.i2c), list_serial_ports())
    return report


def _port(config: RobotConfig, firmware: str) -> Port:
    if config.controller.port == "emulator":
        from raccoon.robot.emulated import open_emulated

        return open_emulated(config, "stock" if firmware == "stock" else 17 if firmware == "17" else 21)
    from raccoon.robot.opening import open_port

    return open_port(config)


def _print_progress(text: str) -> None:
    print(text, file=sys.stderr)


def _silent(_: str) -> None:
    """Print no progress, with `--json`."""
