"""Limits how much of a drive is simulated: pauses without rows, rest, and its whole duration."""

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
"""s to which a longer pause without rows is shortened. The simulator steps through it millisecond by
millisecond and nothing is compared: a day of it would need more memory than there is."""
MAX_DURATION_S = 240.0
"""s of one recording that are diagnosed, for which 1 GB of memory is needed. A match has 120."""
MAX_LISTED_PAUSES = 3
"""Pauses whose times a note lists."""
MARGIN_S = 10.0
"""s before the first command and after the last one that are kept: more of a robot that stands shows nothing,
and costs as much as driving. A minute may pass until the light starts a match."""
_COMMAND, _BRAKE = re.compile(r"motor\.\d+\.(duty|voltage|force|torque)"), re.compile(r"motor\.\d+\.brake")


def limit_duration(columns: Columns, *, shorten_pauses: bool = True) -> tuple[Columns, tuple[str, ...]]:
    """The columns with short pauses and of no more than `MAX_DURATION_S`, and what is to be said of that.

    shorten_pauses: whether pauses may be in it at all.
    """
    time = np.asarray(columns["t"], float)
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        return columns, ()  # not a time at all, which `check_time` refuses
    time, pause_notes = _shorten_pauses(time) if shorten_pauses else (time, ())
    commands = {name: hold_until_next(each) for name, each in columns.items() if _COMMAND.fullmatch(name)}
    driven = np.any([each != 0.0 for each in commands.values()], axis=0)
    driven_part, part_notes = _select_driven_rows(time, driven)
    if part_notes:
        held = {**commands, **_filled_brake_columns(columns)}
        columns = {name: each[driven_part] for name, each in {**columns, "t": time}.items()}
        for name, each in held.items():  # the command of the first row may have been given before it
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
    """Rows from `MARGIN_S` before the first command to `MARGIN_S` after the last one; where these are more
    than `MAX_DURATION_S`, the part in which wheels are driven for longest. And a note where rows are left
    out."""
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
