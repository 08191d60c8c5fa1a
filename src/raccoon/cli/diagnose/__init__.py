"""`raccoon diagnose`: find what the simulation gets wrong about a recording, and why."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raccoon.cli.crew import add_crew_options, check_crew
from raccoon.cli.recording_argument import recording_path
from raccoon.cli.wrapping import print_wrapped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from raccoon.diagnose.result import Diagnosis

HELP = "compare a recording with the simulation, name what is wrong and write the better model"
DEFAULT_WORKERS = 1
"""Default number of processes."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "trace",
        type=recording_path,
        metavar="recording",
        nargs="+",
        help="recordings: traces, CSV, MCAP or EMPS files, or folders of them",
    )
    parser.add_argument(
        "--robot",
        type=Path,
        action=OnceOnly,
        help="robot.toml (default: the one in the recording, else a file beside it or in this folder)",
    )
    parser.add_argument("--model", type=Path, help="model.toml to start from instead of robot.toml's model")
    parser.add_argument(
        "--holdout",
        type=Path,
        nargs="+",
        default=[],
        help="other recordings of this robot, on which the result is tested",
    )
    parser.add_argument(
        "--causes", type=Path, help="Python file with effects of your own, a list CAUSES of OwnEffect"
    )
    parser.add_argument(
        "--port",
        choices=("wombat", "wombat-raccoon"),
        help="the controller of a recording that does not name it, such as a CSV of your own logger "
        "(default: controller.port, if robot.toml has that line)",
    )
    parser.add_argument(
        "--together",
        action="store_true",
        help="fit all drives of one robot together: several short ones can show what none shows alone",
    )
    parser.add_argument("--truth-free", action="store_true", help="use no truth.* column")
    add_crew_options(parser, DEFAULT_WORKERS)
    parser.add_argument("--json", type=Path, help="write the diagnosis as JSON")
    parser.add_argument("--html", type=Path, help="write a report with pictures")
    parser.add_argument(
        "--save-model",
        type=Path,
        help="write the extended simulation model; of several recordings, what they have in common",
    )


class OnceOnly(argparse.Action):
    """The action of `--robot`, which refuses to be given twice: the last of two would be used for the
    recordings of both robots."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: Any = None,
    ) -> None:
        if getattr(namespace, self.dest) is not None:
            parser.error(
                f"{option_string} {values}: it is given twice; for several robots, put the recordings of "
                "each in a folder with its robot.toml"
            )
        setattr(namespace, self.dest, values)


def run(args: argparse.Namespace) -> int:
    """Diagnose the recordings. Returns exit status 0 if the diagnosis ran, whatever it found; of several
    recordings, as `run_fleet`. Raises ConfigError, TraceError."""
    from raccoon.cli.diagnose.files import recordings
    from raccoon.cli.diagnose.fleet import diagnose_pooled_geometry, run_fleet
    from raccoon.cli.diagnose.job import diagnose_job, diagnose_together, make_job
    from raccoon.cli.outputs import check_folders, check_holdout, check_not_read, check_replaceable
    from raccoon.cli.progress import show_progress
    from raccoon.core.errors import TraceError

    outputs = (args.json, args.html, args.save_model)
    check_folders(*outputs)
    check_crew(args)
    _show_remarks()
    paths = recordings(args.trace)
    if not paths:
        raise TraceError(f"{', '.join(map(str, args.trace))}: there is no recording in it")
    args.holdout = holdout = _holdout_files(args.holdout)
    check_not_read(outputs, [*paths, *holdout, args.robot, args.model, args.causes])
    check_holdout(holdout, paths)
    check_replaceable(args.json, args.html, model=args.save_model)
    _check_numba(paths, args.robot)
    if len(paths) == 1:
        _warn_of_unused_workers(args)
        with show_progress():
            found = diagnose_job(make_job(args, paths[0])).diagnosis
        _write(args, found, paths[0].name)
        return 0
    if args.together:
        _warn_of_unused_workers(args)
        with show_progress():
            found = diagnose_together(args, paths)
        _write(args, found, f"{len(paths)} recordings together")
        return 0
    together = diagnose_pooled_geometry(args, paths)
    if together is None:
        return run_fleet(args, paths)
    _warn_of_unused_workers(args)
    _write(args, together, f"{len(paths)} runs")
    return 0


def _warn_of_unused_workers(args: argparse.Namespace) -> None:
    """Print a warning if `--workers` or `--executor` has no effect: a single diagnosis is not divided."""
    named = [f"--executor {args.executor}"] if args.executor != "processes" else []
    named += [f"--workers {args.workers}"] if args.workers != DEFAULT_WORKERS else []
    if named:
        print(f"{' '.join(named)}: not used: a single diagnosis runs in this process", file=sys.stderr)


def _holdout_files(named: Sequence[Path]) -> list[Path]:
    from raccoon.cli.diagnose.files import recordings
    from raccoon.core.errors import TraceError

    found = recordings(named)
    if named and not found:
        raise TraceError(f"--holdout {', '.join(map(str, named))}: there is no recording in it")
    return found


def _check_numba(paths: Sequence[Path], robot_toml: Path | None) -> None:
    """Without numba, refuse recordings of drives (ConfigError) and warn about recordings of motors; other
    kinds are not simulated."""
    from raccoon.cli.numba_check import check_numba, warn_without_numba
    from raccoon.core.config import RobotConfig, load_robot
    from raccoon.core.errors import RaccoonError
    from raccoon.diagnose.recordings.kind import Kind, kind_of
    from raccoon.sim.plant.compiled import has_numba
    from raccoon.trace.loading import load_run

    if has_numba():
        return
    given = None if robot_toml is None else load_robot(robot_toml)
    kinds = set()
    for path in paths:
        try:
            run = load_run(path)
            kind = kind_of(run.recording.columns, given or run.robot or RobotConfig())
        except (RaccoonError, OSError):  # reported when it is diagnosed
            continue
        if kind is Kind.DRIVE:
            check_numba(f"{path}: a drive is diagnosed by simulating it thousands of times")
        kinds.add(kind)
    if Kind.MOTORS in kinds:
        warn_without_numba()


def _show_remarks() -> None:
    """Show the library's log on standard error: the first diagnosis takes half a minute longer, and the log
    says why."""
    import logging

    logging.basicConfig(format="%(message)s")
    logging.getLogger("raccoon").setLevel(logging.INFO)


def _write(args: argparse.Namespace, diagnosis: Diagnosis, name: str) -> None:
    """Write the files, then print the report. Files come first because a closed pipe ends the command when it
    prints; the report is printed even if a file cannot be written."""
    from raccoon.diagnose.reports.terminal import terminal_report

    try:
        _save(args, diagnosis, name)
    finally:
        print_wrapped(terminal_report(diagnosis))
    if args.save_model is not None and diagnosis.model is None:
        print(f"{args.save_model}: not written: this kind of recording gives no model of a robot")


def _save(args: argparse.Namespace, diagnosis: Diagnosis, name: str) -> None:
    if args.json is not None:
        diagnosis.save_json(args.json)
    if args.save_model is not None:
        _save_model(args.save_model, diagnosis, name)
    if args.html is not None:  # last: only this needs an optional dependency, which may be missing
        from raccoon.diagnose.reports.html import save_html

        save_html(diagnosis, args.html, title=name)


def _save_model(path: Path, diagnosis: Diagnosis, name: str) -> None:
    from dataclasses import replace
    from datetime import date

    from raccoon import __version__
    from raccoon.sim.effects.provenance import Provenance

    if diagnosis.model is None:
        return
    today = date.today().isoformat()
    provenance = Provenance(name, f"raccoon diagnose {__version__}", today, str(diagnosis.verdict))
    replace(diagnosis.model, provenance=provenance).save(path)
