"""`raccoon diagnose`: what the simulation gets wrong in a recording, and why."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.diagnose.result import Diagnosis

HELP = "compare a recording with the simulation, name what is wrong and write the better model"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("trace", type=Path, nargs="+", help="recordings: traces, CSV or MCAP files")
    parser.add_argument(
        "--robot", type=Path, help="robot.toml; without it the recording's own, or the default"
    )
    parser.add_argument("--model", type=Path, help="model.toml to start from instead of robot.toml's model")
    parser.add_argument("--holdout", type=Path, help="another recording of this robot to judge on")
    parser.add_argument(
        "--truth-free", action="store_true", help="use no truth.* column (drives never do in this version)"
    )
    parser.add_argument("--json", type=Path, help="write the diagnosis as JSON")
    parser.add_argument("--html", type=Path, help="write a report with pictures")
    parser.add_argument("--save-model", type=Path, help="write the extended simulation model")


def run(args: argparse.Namespace) -> int:
    """Diagnose; the exit status is 0 when it ran, whatever it found."""
    from raccoon.diagnose.report import terminal_report

    if len(args.trace) > 1:
        return _run_fleet(args)
    diagnosis = _diagnosed(args, args.trace[0])
    print(terminal_report(diagnosis))
    if args.json is not None:
        diagnosis.save_json(args.json)
    if args.html is not None:
        from raccoon.diagnose.html import save_html

        save_html(diagnosis, args.html, title=args.trace[0].name)
    if args.save_model is not None and diagnosis.model is not None:
        diagnosis.model.save(args.save_model)
    return 0


def _diagnosed(args: argparse.Namespace, path: Path) -> Diagnosis:
    from raccoon.core.config import RobotConfig, load_robot
    from raccoon.diagnose.diagnosis import diagnose
    from raccoon.trace.loading import load_run

    loaded = load_run(path)
    robot = load_robot(args.robot) if args.robot is not None else loaded.robot or RobotConfig()
    holdout = load_run(args.holdout).recording.columns if args.holdout is not None else None
    start = None
    if args.model is not None:
        from raccoon.sim.parameters import Parameters

        start = Parameters.from_model_file(args.model)
        robot = start.robot
    return diagnose(loaded.recording.columns, robot, holdout=holdout, model=start)


def _run_fleet(args: argparse.Namespace) -> int:
    """Several recordings: a line each, then what they have in common."""
    from raccoon.diagnose.fleet import common_causes, fleet_report

    results = {path.name: _diagnosed(args, path) for path in args.trace}
    print(fleet_report(results, common_causes(results)))
    if args.json is not None:
        import json

        from raccoon.diagnose.result import write_text

        text = json.dumps({name: each.to_dict() for name, each in results.items()}, indent=1)
        write_text(args.json, text + "\n")
    return 0
