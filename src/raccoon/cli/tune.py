"""`raccoon tune wheels`: identify each wheel from a short excitation and compute the gains of its speed
loop."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, cast

from raccoon.cli.wheel_excitation import add_arguments, excite_and_fit, show_and_write

if TYPE_CHECKING:
    from raccoon.robot.calibration.identification import WheelFit

HELP = "identify the wheels of a robot and compute their gains, with the margins they give"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add one sub-command per thing to tune."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    text = "friction, speed and inertia voltage of each wheel, and the gains of its speed loop"
    wheels = kinds.add_parser("wheels", help=text, description=text)
    add_arguments(wheels)
    wheels.set_defaults(tune=_wheels, parser=wheels)


def run(args: argparse.Namespace) -> int:
    """Run the sub-command. Returns the exit status."""
    return cast(Callable[[argparse.Namespace], int], args.tune)(args)


def _wheels(args: argparse.Namespace) -> int:
    seen, fits = excite_and_fit(args)
    entries = {}
    for fit in fits:
        _show(fit)
        entries.update(fit.entries(seen.battery))
    return show_and_write(args, entries)


def _show(fit: WheelFit) -> None:
    """Print the fit, gains and margins of one wheel."""
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
        f"{reached.crossover:.0f} rad/s: tolerates {1e3 * reached.delay:.0f} ms of delay beyond the model's"
    )
