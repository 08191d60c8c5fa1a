"""How much of a drive is simulated: no pause of minutes in it, and no hour of it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.commands import braked, until_next
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

PAUSE = 5.0
"""s that a pause without rows is taken for at most. The simulator goes through it, a millisecond after the
other, and nothing is compared: after a day of it there would be no memory left."""
MOST_SECONDS = 240.0
"""s of one recording that are diagnosed, of which 1 GB of memory is needed. A match has 120."""
PAUSES_SAID = 3
"""Pauses whose times are said."""
REST = 10.0
"""s before the first command and after the last one that are looked at: of a robot that stands there is no
more to see, and each takes as long as one of driving. A minute may pass until the light starts a match."""
_COMMAND, _BRAKE = re.compile(r"motor\.\d+\.(duty|voltage|force|torque)"), re.compile(r"motor\.\d+\.brake")


def bounded(columns: Columns, *, pauses_too: bool = True) -> tuple[Columns, tuple[str, ...]]:
    """The columns with short pauses and of no more than `MOST_SECONDS`, and what is to be said of that.

    pauses_too: whether pauses may be in it at all.
    """
    time = np.asarray(columns["t"], float)
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        return columns, ()  # no time at all, which is said elsewhere
    time, pauses = _with_short_pauses(time) if pauses_too else (time, ())
    commands = {name: until_next(each) for name, each in columns.items() if _COMMAND.fullmatch(name)}
    driven = np.any([each != 0.0 for each in commands.values()], axis=0)
    part, said = _where_it_drives(time, driven)
    if said:
        held = {**commands, **_braked(columns)}
        columns = {name: each[part] for name, each in {**columns, "t": time}.items()}
        for name, each in held.items():  # what holds in the first row may have been commanded before it
            columns[name] = np.concatenate([each[part][:1], columns[name][1:]])
    elif pauses:
        columns = {**columns, "t": time}
    return columns, (*pauses, *said)


def _braked(columns: Columns) -> dict[str, Array]:
    """The words of brakes, by name, as each row has them."""
    duties = {name: name.replace(".brake", ".duty") for name in columns if _BRAKE.fullmatch(name)}
    return {
        name: braked(columns[name], columns[duty])
        for name, duty in duties.items()
        if duty in columns and np.isfinite(columns[name]).any()
    }


def _with_short_pauses(time: Array) -> tuple[Array, tuple[str, ...]]:
    steps = np.diff(time)
    long = np.flatnonzero(steps > max(PAUSE, 2.0 * usual_step(time)))
    if len(long) == 0:
        return time, ()
    cut = np.zeros(len(time))
    cut[long + 1] = steps[long] - PAUSE
    gaps = ", ".join(f"{time[row]:.1f} to {time[row + 1]:.1f} s" for row in long[:PAUSES_SAID])
    more = f" and {len(long) - PAUSES_SAID} more" if len(long) > PAUSES_SAID else ""
    said = (
        f"no rows from {gaps}{more}: as if {'it' if len(long) == 1 else 'each'} were {PAUSE:g} s; all other "
        "times that are said here are shorter by as much from there on"
    )
    return time - np.cumsum(cut), (said,)


def _where_it_drives(time: Array, driven: NDArray[np.bool_]) -> tuple[slice, tuple[str, ...]]:
    """Rows from shortly before the first command to shortly after the last one, and of more than can be
    simulated those in which wheels are driven for longest."""
    whole = slice(0, len(time))
    rows = np.flatnonzero(driven)
    if len(rows) == 0:
        return whole, ()
    begin, end = np.searchsorted(time, (time[rows[0]] - REST, time[min(rows[-1] + 1, len(time) - 1)] + REST))
    if time[end - 1] - time[begin] > MOST_SECONDS:
        passed = np.concatenate([[0.0], np.cumsum(np.where(driven[:-1], np.diff(time), 0.0))])
        ends = np.searchsorted(time[:end], time + MOST_SECONDS, side="right")
        begin = begin + int(np.argmax((passed[np.maximum(ends, 1) - 1] - passed)[begin:end]))
        end = ends[begin]
        why = f"at most {MOST_SECONDS:g} s are diagnosed, and in these it drives most"
    elif (time[begin] - time[0]) + (time[-1] - time[end - 1]) > REST:
        why = "nothing is commanded before and after that"
    else:
        return whole, ()
    said = (
        f"of {time[-1] - time[0]:.0f} s only {time[begin]:.1f} to {time[end - 1]:.1f} s are looked at: {why}"
    )
    return slice(int(begin), int(end)), (said,)
