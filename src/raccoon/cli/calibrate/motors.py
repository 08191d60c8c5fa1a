"""The work of `raccoon calibrate motors` (not a command of its own)."""

from __future__ import annotations

import argparse

from raccoon.cli.wheel_excitation import excite_and_fit, show_and_write
from raccoon.robot.calibration.identification import power_factors


def calibrate(args: argparse.Namespace) -> int:
    """Measure the power factor k of both motors and, with `--write`, store it with date, battery voltage and
    standard deviation. Returns the exit status."""
    seen, fits = excite_and_fit(args, bare=True)
    return show_and_write(args, power_factors(fits, seen.battery))
