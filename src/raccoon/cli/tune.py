"""`raccoon tune wheels`: identify each wheel from a short excitation and compute the gains of its loop."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import cast

from raccoon.cli.motors import add_arguments, excited, finish, show

HELP = "identify the wheels of a robot and compute their gains, with the margins they give"


def configure(parser: argparse.ArgumentParser) -> None:
    """A sub-command a thing to tune."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    text = "friction, speed and inertia voltage of each wheel, and the gains of its speed loop"
    wheels = kinds.add_parser("wheels", help=text, description=text)
    add_arguments(wheels)
    wheels.set_defaults(tune=_wheels, parser=wheels)


def run(args: argparse.Namespace) -> int:
    """Do the sub-command."""
    return cast(Callable[[argparse.Namespace], int], args.tune)(args)


def _wheels(args: argparse.Namespace) -> int:
    seen, fits = excited(args)
    entries = {}
    for fit in fits:
        show(fit)
        entries.update(fit.entries(seen.battery))
    return finish(args, entries)
