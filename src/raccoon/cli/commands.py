"""The commands of `raccoon`: choosing the module of a command, running it, and printing errors as one clear
line."""

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

# Each is a module or package beside this file; the command is its name with - instead of _.
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
    """Interface of a command's module. At its top it imports from the standard library and light modules
    only."""

    HELP: str

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's arguments."""
        ...

    def run(self, args: argparse.Namespace) -> int:
        """Run the command. Returns the exit status."""
        ...


def build_parser() -> Parser:
    """The parser of the command line with all commands."""
    parser = Parser(
        prog="raccoon",
        description="Onboard robot control for the KIPR Wombat.",
        epilog="`raccoon help COMMAND` or `raccoon COMMAND --help` lists the arguments of a command.",
    )
    parser.add_argument("--version", action="version", version=f"raccoon {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = cast(Command, import_module(f"raccoon.cli.{name}"))
        command = commands.add_parser(name.replace("_", "-"), help=module.HELP, description=module.HELP)
        module.configure(command)
        command.set_defaults(run=module.run, parser=command)
    return parser


def run_command(argv: Sequence[str] | None = None) -> int:
    """Parse the arguments (default: sys.argv) and run the command. Returns the exit status as
    `raccoon.cli.main.main`."""
    for name in ("stdout", "stderr"):  # None if closed, as by >&-: output is then discarded
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - until the end
    if isinstance(sys.stdout, TextIOWrapper):  # names of files may be undecodable, and terminals limited
        sys.stdout.reconfigure(errors="backslashreplace")
    given = list(sys.argv[1:] if argv is None else argv)
    name = "raccoon"
    try:
        parser = build_parser()
        if not given:  # the list of commands helps more than an error
            parser.print_help(sys.stderr)
            return 2
        args, unknown = parser.parse_known_args(_with_help_option(_without_view_run(given)))
        if unknown:  # by the parser of this command, which knows its options
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


def _with_help_option(given: list[str]) -> list[str]:
    """The arguments with `--help` behind a command instead of `help` before it."""
    return [*given[1:], "--help"] if given[:1] == ["help"] else given


def _without_view_run(given: list[str]) -> list[str]:
    """The arguments without `run` after `view`: in `view run -o a.svg RECORDING`, argparse would take `run`
    for the recording. They stay unchanged if a recording of that name exists."""
    if given[:2] != ["view", "run"] or len(given) == 2:
        return given
    from raccoon.trace.record import existing_recording

    is_recording = Path("run").exists() or existing_recording("run") is not None
    return given if is_recording else [given[0], *given[2:]]


def _error_text(error: Exception) -> str:
    """Text of an error. For errors of files the name of the file comes first; for a missing robot.toml a hint
    how to get one is added."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    said = f"{error.strerror[0].lower()}{error.strerror[1:]}"
    if error.filename is None:  # an error of the output stream
        return said
    hint = ""
    if isinstance(error, FileNotFoundError) and Path(error.filename).name == "robot.toml":
        hint = "; `raccoon init` writes a template, --robot names another file"
    if isinstance(error, FileNotFoundError):
        said += did_you_mean_file(error.filename)
    return f"{error.filename}: {said}{hint}"
