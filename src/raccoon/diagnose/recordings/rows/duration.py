"""Limits how much of a drive is simulated: pauses without rows, rest, and the total duration."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.commands import brake_in_force, hold_until_next
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MAX_PAUSE_S = 5.0
"""Duration, s, to which a longer pause without rows is shortened. The simulator steps through it in
milliseconds without a comparison: a pause of a day would need more memory than there is."""
MAX_DURATION_S = 240.0
"""Longest diagnosed duration of one recording, s, which needs 1 GB of memory. A match has 120 s."""
MAX_LISTED_PAUSES = 3
"""Largest number of pauses whose times a note lists."""
MARGIN_S = 10.0
"""Time that is kept before the first command and after the last one, s: more of a standing robot shows
nothing and costs as much as driving. A minute may pass until the light starts a match."""
_COMMAND, _BRAKE = re.compile(r"motor\.\d+\.(duty|voltage|force|torque)"), re.compile(r"motor\.\d+\.brake")


def limit_duration(columns: Columns, *, shorten_pauses: bool = True) -> tuple[Columns, tuple[str, ...]]:
    """The columns with shortened pauses and at most `MAX_DURATION_S`, and notes on the changes.

    shorten_pauses: whether pauses are shortened.
    """
    time = np.asarray(columns["t"], float)
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        return columns, ()  # an invalid time, for which `check_time` raises an error
    time, pause_notes = _shorten_pauses(time) if shorten_pauses else (time, ())
    commands = {name: hold_until_next(each) for name, each in columns.items() if _COMMAND.fullmatch(name)}
    driven = np.any([each != 0.0 for each in commands.values()], axis=0)
    driven_part, part_notes = _select_driven_rows(time, driven)
    if part_notes:
        held = {**commands, **_filled_brake_columns(columns)}
        columns = {name: each[driven_part] for name, each in {**columns, "t": time}.items()}
        for name, each in held.items():  # the command in force may have been given before the first row
            columns[name] = np.concatenate([each[driven_part][:1], columns[name][1:]])
    elif pause_notes:
        columns = {**columns, "t": time}
    return columns, (*pause_notes, *part_notes)


def _filled_brake_columns(columns: Columns) -> dict[str, Array]:
    """The brake columns by name, with a value in every row."""
    duties = {name: name.replace(".brake", ".duty") for name in columns if _BRAKE.fullmatch(name)}
    return {
        name: brake_in_force(columns[name], columns[duty])
        for name, duty in duties.items()
        if duty in columns and np.isfinite(columns[name]).any()
    }


def _shorten_pauses(time: Array) -> tuple[Array, tuple[str, ...]]:
    steps = np.diff(time)
    long = np.flatnonzero(steps > max(MAX_PAUSE_S, 2.0 * median_step(time)))
    if len(long) == 0:
        return time, ()
    excess = np.zeros(len(time))
    excess[long + 1] = steps[long] - MAX_PAUSE_S
    gaps = ", ".join(f"{time[row]:.1f} to {time[row + 1]:.1f} s" for row in long[:MAX_LISTED_PAUSES])
    more = f" and {len(long) - MAX_LISTED_PAUSES} more" if len(long) > MAX_LISTED_PAUSES else ""
    which = "it" if len(long) == 1 else "each"
    note = (
        f"no rows from {gaps}{more}: {which} is shortened to {MAX_PAUSE_S:g} s, so all times after it in "
        "this report are earlier by the difference"
    )
    return time - np.cumsum(excess), (note,)


def _select_driven_rows(time: Array, driven: NDArray[np.bool_]) -> tuple[slice, tuple[str, ...]]:
    """Rows from `MARGIN_S` before the first command to `MARGIN_S` after the last one; if that is longer than
    `MAX_DURATION_S`, the part with the most driving. Also a note if rows are left out."""
    whole = slice(0, len(time))
    rows = np.flatnonzero(driven)
    if len(rows) == 0:
        return whole, ()
    begin, end = np.searchsorted(
        time, (time[rows[0]] - MARGIN_S, time[min(rows[-1] + 1, len(time) - 1)] + MARGIN_S)
    )
    if time[end - 1] - time[begin] > MAX_DURATION_S:
        driven_time = np.concatenate([[0.0], np.cumsum(np.where(driven[:-1], np.diff(time), 0.0))])
        ends = np.searchsorted(time[:end], time + MAX_DURATION_S, side="right")
        begin = begin + int(np.argmax((driven_time[np.maximum(ends, 1) - 1] - driven_time)[begin:end]))
        end = ends[begin]
        why = f"at most {MAX_DURATION_S:g} s are diagnosed, and these have the most driving"
    elif (time[begin] - time[0]) + (time[-1] - time[end - 1]) > MARGIN_S:
        why = "nothing is commanded before and after that"
    else:
        return whole, ()
    note = f"of {time[-1] - time[0]:.0f} s only {time[begin]:.1f} to {time[end - 1]:.1f} s are used: {why}"
    return slice(int(begin), int(end)), (note,)
