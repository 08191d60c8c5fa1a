"""The commands of `raccoon`: find the one that is meant, run it, turn errors into one clear line."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Protocol, cast

from raccoon import __version__
from raccoon.cli.arguments import Parser
from raccoon.core.errors import RaccoonError
from raccoon.core.near_names import did_you_mean_file

# One module or folder of this package each; its name with - for _ is the command.
COMMANDS: tuple[str, ...] = (
    "calibrate",
    "compare_mitigations",
    "convert",
    "demo",
    "diagnose",
    "doctor",
    "effects",
    "excite",
    "init",
    "replay",
    "simulate",
    "sweep",
    "tune",
    "view",
)


class Command(Protocol):
    """What a command's module offers. Only standard-library imports at its top."""

    HELP: str

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's arguments."""
        ...

    def run(self, args: argparse.Namespace) -> int:
        """Do it; the result is the exit status."""
        ...


def build_parser() -> Parser:
    """The parser with every command in it."""
    parser = Parser(prog="raccoon", description="Onboard robot control for the KIPR Wombat.")
    parser.add_argument("--version", action="version", version=f"raccoon {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = cast(Command, import_module(f"raccoon.cli.{name}"))
        command = commands.add_parser(name.replace("_", "-"), help=module.HELP, description=module.HELP)
        module.configure(command)
        command.set_defaults(run=module.run, parser=command)
    return parser


def run_command(argv: Sequence[str] | None = None) -> int:
    """As `raccoon.cli.main.main`."""
    for name in ("stdout", "stderr"):  # closed, as by >&-: what is said goes nowhere, not to the other one
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - until the end
    if isinstance(sys.stdout, TextIOWrapper):  # a file's name may be no text, and a terminal not know all
        sys.stdout.reconfigure(errors="backslashreplace")
    given = list(sys.argv[1:] if argv is None else argv)
    name = "raccoon"
    try:
        parser = build_parser()
        if not given:  # what there is helps more than that a word is missing
            parser.print_help(sys.stderr)
            return 2
        args, unknown = parser.parse_known_args(_without_view_run(given))
        if unknown:  # in the words and with the usage of the command, not of all of them
            args.parser.refuse(unknown)
        args.given = given
        name = f"raccoon {args.command}"
        return int(args.run(args))
    except BrokenPipeError:
        sys.stderr.close()
        return 141
    except (RaccoonError, OSError) as error:
        print(f"{name}: {_error_text(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return 130


def _without_view_run(given: list[str]) -> list[str]:
    """`view run -o a.svg RECORDING` without `run`, which argparse would take for the recording, options
    coming next; as it is where there is a recording of that name."""
    if given[:2] != ["view", "run"] or len(given) == 2:
        return given
    from raccoon.trace.record import existing_recording

    is_recording = Path("run").exists() or existing_recording("run") is not None
    return given if is_recording else [given[0], *given[2:]]


def _error_text(error: Exception) -> str:
    """What went wrong; of a file its name first, and how to come to a robot.toml where there is none."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    said = f"{error.strerror[0].lower()}{error.strerror[1:]}"
    if error.filename is None:  # it was on its way to the output
        return said
    hint = ""
    if isinstance(error, FileNotFoundError) and Path(error.filename).name == "robot.toml":
        hint = "; `raccoon init` writes one to start from, --robot names one that is elsewhere"
    if isinstance(error, FileNotFoundError):
        said += did_you_mean_file(error.filename)
    return f"{error.filename}: {said}{hint}"
