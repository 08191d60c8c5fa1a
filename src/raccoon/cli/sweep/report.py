"""Printed report of a sweep."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from raccoon.sweep.factors import Factor
from raccoon.sweep.match import OK, Match
from raccoon.sweep.results import Row
from raccoon.sweep.summary import Sensitivity, Summary, failure_kind, summary

MAX_ROWS = 3
"""Largest number of parameters in the report."""
MIN_RANKED = 20
"""Number of matches below which only significant parameters are named: with six matches, any parameter
explains nearly all of the variance."""
REASONS = 6


def print_report(match: Match, rows: list[Row], seed: int, given: Sequence[str], table: Path | None) -> None:
    """Print the failure rate, the reasons, and the parameters to which the result is most sensitive.

    given: command line of the sweep. table: its table file, on which a match can be drawn.
    """
    units = {each.name: each for each in match.factors}
    found = summary(rows, list(units))
    low, high = found.rate.interval
    print(f"{match.program.name}: {found.rate.failed} of {found.rate.played} matches failed (seed {seed}).")
    print(f"failure rate {_percent(found.rate.value)}, 95 % interval {_percent(low)} to {_percent(high)}")
    for reason, count in found.reasons[:REASONS]:
        print(f"  {count:6d} x {reason}{_example_text(rows, reason)}")
    _print_first_failure(rows, given, table)
    _print_sensitivities(found, units)


def _example_text(rows: list[Row], kind: str) -> str:
    """Match number and text of the first failure of a kind, if its text says more than the kind; otherwise
    empty."""
    first = next(row for row in rows if row["status"] != OK and failure_kind(row) == kind)
    text = str(first["reason"]).removeprefix(kind).removeprefix(":").strip()
    return f", as match {first['run']}: {text}" if text else ""


def _print_first_failure(rows: list[Row], given: Sequence[str], table: Path | None) -> None:
    """Print the commands that play and draw the first failed match, ready to copy."""
    run = next((row["run"] for row in rows if row["status"] != OK), None)
    if run is not None:
        recording = f"run-{run}.jsonl.gz"
        # In front of the other arguments, which may end with an option's values, or contain --.
        words = ("raccoon", "sweep", "--only", str(run), "--record", recording, *given[1:])
        drawn = ("raccoon", "view", recording, *(() if table is None else ("--table", str(table))))
        print(f"  see one: {shlex.join(words)}\n           {shlex.join(drawn)}")


def _print_sensitivities(found: Summary, units: dict[str, Factor]) -> None:
    what = "failure" if found.of == "failure" else "the distance from the goal"
    ranked = found.rate.played >= MIN_RANKED
    strongest = [each for each in found.sensitivities if ranked or each.is_clear][:MAX_ROWS]
    if not strongest:
        print("\nNothing can be said about what it depends on: too few matches, or all ended alike.")
        return
    print(f"\nMost sensitive to (share of the variance of {what} that goes with it):")
    for number, each in enumerate(strongest, start=1):
        unsure = "" if each.is_clear else "   may be chance; play more matches"
        print(f"  {number}. {each.name:44} {_percent(max(0.0, each.share)):>7}{unsure}")
        print(f"     {_groups(each, found.of, units[each.name].unit)}")


def _groups(each: Sensitivity, of: str, unit: str) -> str:
    """Text of the outcomes in the worst and in the best group of a parameter's values."""
    worst = max(each.groups, key=lambda group: group[2])
    best = min(each.groups, key=lambda group: group[2])
    parts = []
    for low, high, outcome in (worst, best):
        values = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
        result = f"{_percent(outcome)} fail" if of == "failure" else f"{1e3 * outcome:.0f} mm off"
        parts.append(f"{values} {unit}".rstrip() + f": {result}")
    return ";  ".join(parts)


def print_row(row: Row) -> None:
    """Print one match, one line per value."""
    for name, value in row.items():
        if isinstance(value, float):
            print(f"{name:48} {'' if math.isnan(value) else f'{value:.6g}'}")
        else:
            print(f"{name:48} {value}")


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
