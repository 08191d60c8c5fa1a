"""`raccoon calibrate motors`: the work behind it (no command of its own)."""

from __future__ import annotations

import argparse

from raccoon.cli.motors import excited, finish
from raccoon.robot.calibration.identification import power_factors


def calibrate(args: argparse.Namespace) -> int:
    """Measure k of both motors and store it with date, battery voltage and standard deviation."""
    seen, fits = excited(args, bare=True)
    return finish(args, power_factors(fits, seen.battery))
