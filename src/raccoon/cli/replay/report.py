"""The results of a replay as text and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from raccoon.cli.replay.drive import COLUMNS, Drive
from raccoon.cli.replay.each_file import not_replayed_text
from raccoon.core.files import write_atomically
from raccoon.trace.pose_error import pool_errors
from raccoon.trace.problems import without_repeats

SHOWN_PROBLEMS = 5


def report(drives: list[Drive], failed: Mapping[str, str]) -> dict[str, Any]:
    """All results of the runs as JSON values (m, rad, s). failed: the reason for each file that cannot be
    used."""
    errors = [drive.error for drive in drives if drive.error is not None]
    return {
        "runs": [_run(drive) for drive in drives],
        "pooled": _finite(asdict(pool_errors(errors))) if errors else None,
        "failed": dict(failed),
    }


def _run(drive: Drive) -> dict[str, Any]:
    recording = drive.run.recording
    count = len(recording)
    return {
        "name": drive.run.name,
        "cycles": count,
        "seconds": float(recording["t"][-1] - recording["t"][0]) if count else 0.0,
        "end": {name: float(drive.estimate[name][-1]) for name in COLUMNS} if count else None,
        "status": drive.status,
        "reasons": list(drive.reasons),
        "error": None if drive.error is None else _finite(asdict(drive.error)),
        "deviation_from_recorded_estimate": drive.deviation,
        "notes": [*drive.notes, *without_repeats(recording.problems)],
    }


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    """The values with None for numbers that are not finite, since JSON has no NaN."""
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def print_report(results: dict[str, Any]) -> None:
    """Print one line per run, and the pooled error of the runs with truth; files that cannot be used come
    first."""
    for name, reason in results["failed"].items():
        print(not_replayed_text(name, reason))
    runs = results["runs"]
    if not runs:
        return
    width = max([len(run["name"]) for run in runs] + [4])
    print(
        f"{'run':{width}}  cycles  seconds    end x, y (m)    heading    "
        + (_HEADING if _truth(runs) else "")
    )
    for run in runs:
        start = f"{run['name']:{width}}  {run['cycles']:6d}  {run['seconds']:7.1f}"
        print(f"{start}  {_end(run)}  {_error(run['error'])}")
        for note in run["notes"][:SHOWN_PROBLEMS]:
            print(f"{'':{width}}  note: {note}")
        if len(run["notes"]) > SHOWN_PROBLEMS:
            print(f"{'':{width}}  and {len(run['notes']) - SHOWN_PROBLEMS} notes more")
        _print_deviation(run, width)
    if results["pooled"] is not None and results["pooled"]["runs"] > 1:
        _print_pooled(results["pooled"])


_HEADING = "path m   rms mm  final mm  heading rms deg  final deg"


def _truth(runs: list[dict[str, Any]]) -> bool:
    return any(run["error"] is not None for run in runs)


def _end(run: dict[str, Any]) -> str:
    end = run["end"]
    if end is None:
        return "nothing recorded"
    return f"{end['x']:7.3f}, {end['y']:7.3f}  {math.degrees(end['heading']):7.1f} deg"


def _error(error: dict[str, float] | None) -> str:
    if error is None:
        return ""
    return (
        f"{error['distance']:6.2f}  {1000 * error['rms']:7.1f}  {1000 * error['final']:8.1f}  "
        f"{math.degrees(error['heading_rms']):15.2f}  {math.degrees(error['heading_final']):+9.2f}"
    )


def _print_deviation(run: dict[str, Any], width: int) -> None:
    deviation = run["deviation_from_recorded_estimate"]
    if deviation == 0.0:
        print(f"{'':{width}}  identical to the estimate while driving, in every cycle")
    elif deviation is not None:
        print(f"{'':{width}}  differs from the estimate while driving by up to {deviation:.3g} (m, rad)")


def _print_pooled(error: dict[str, float]) -> None:
    print(
        f"pooled over {error['runs']} runs with truth: "
        f"position rms {1000 * error['rms']:.1f} mm, final {1000 * error['final']:.1f} mm; "
        f"heading rms {math.degrees(error['heading_rms']):.2f} deg, "
        f"final {math.degrees(error['heading_final']):.2f} deg"
    )


def write_json(results: dict[str, Any], path: Path) -> None:
    """Write the results as JSON, atomically."""
    write_atomically(path, json.dumps(results, indent=1, allow_nan=False) + "\n")
