"""Whether rows longer than the controller's cycle are the cycles of a controller that is as slow as its rows.

Such a controller gives a command at its row, and no wheel responds within that row. Where a controller runs
faster and only every n-th cycle was logged, commands change within a row, and wheels have begun to respond by
the row that shows the command. So each reading is predicted from earlier commands and readings (ARX) and from
the change of the command in its own row. The share of the final response that is there at once was 0 to 0.014
for 50 Hz as driven, and 0.03 to 0.25 for every fourth row of 200 Hz. It is 0 as well where a reading is a row
old, as behind a firmware's median and slots. A gyro has no such delay: the share was 0.05 to 0.31 for every
third row of 200 Hz, and at most 0.006 for 67 Hz as driven.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.core.sections import CYCLE_RATE

Array = NDArray[np.float64]
Wheels = Sequence[tuple[Array, Array]]

MAX_ROW_S = 0.0125
"""Longest row, s, of a controller that runs faster than its rows, since a command changes at an unknown time
within its row. Of a clean drive at 200 Hz every second row gives the same diagnosis as all rows, every third
an inertia 17 % too small. Longer rows are taken for the controller's cycles where wheels do not respond
within them."""
MAX_ROW_CYCLES = 1.25
"""Longest row, in cycles of robot.toml's controller, that counts as one cycle."""
COMMAND_LAGS, READING_LAGS = 7, 3
"""Earlier commands and readings, in rows, from which a reading is predicted."""
MIN_IMMEDIATE_SHARE = 0.01
"""Share of a response, less two standard deviations, from which it began within the command's row."""
MIN_ROWS_PER_NUMBER = 10
"""Least number of rows for each fitted coefficient."""


def check_row_length(row: float, rate_hz: float, wheels: Wheels, turns: Wheels) -> tuple[str, ...]:
    """Notes about rows (s) that are longer than robot.toml's cycles. wheels: commands and readings of each
    wheel, NaN where missing. turns: the turning command and the gyro's readings, where it has one.

    Raises TraceError where the times of commands are not known: such rows would name causes that are not
    there.
    """
    if row <= max(MAX_ROW_S, MAX_ROW_CYCLES / rate_hz):
        return ()
    own = CYCLE_RATE.allows(1.0 / row)
    told = f"the recording has a row every {1000.0 * row:.3g} ms, of a controller that runs at {rate_hz:g} Hz"
    slower = f"controller.rate_hz = {1.0 / row:.3g}"
    unknown = (
        "when a command changed within a row is not known, and that looks like another inertia or friction; "
        f"record at least every {1000.0 * MAX_ROW_S:g} ms"
    )
    if own and not (_respond_within_rows(wheels) or _respond_within_rows(turns)):
        return (
            f"{told}: it is assumed to be as slow as its rows; if it is, write {slower} into robot.toml, and "
            f"if it is faster, {unknown}",
        )
    say = f", or, if the controller itself is as slow, write {slower} into robot.toml" if own else ""
    raise TraceError(f"{told}: {unknown}{say}")


def _respond_within_rows(wheels: Wheels) -> bool:
    """Whether the readings clearly respond to a command within the row in which it is recorded."""
    seen = [each for each in (_immediate_share(*pair) for pair in wheels) if each is not None]
    if not seen:
        return False
    shares, variances = np.array(seen).T
    return bool(shares.mean() - 2.0 * np.sqrt(variances.sum()) / len(seen) > MIN_IMMEDIATE_SHARE)


def _immediate_share(duty: Array, reading: Array) -> tuple[float, float] | None:
    """The share of a reading's response to a change of its command that is there in the row of the change,
    and the variance of that share."""
    rows = np.arange(COMMAND_LAGS, len(duty))
    before = [duty[rows - each] for each in range(1, COMMAND_LAGS + 1)]
    read = [reading[rows - each] for each in range(1, READING_LAGS + 1)]
    at_once = duty[rows] - duty[rows - 1]
    columns = np.column_stack([at_once, *before, *read, np.sign(read[0]), np.ones(len(rows))])
    known = np.isfinite(columns).all(axis=1) & np.isfinite(reading[rows])
    columns, target = columns[known], reading[rows][known]
    if len(target) < MIN_ROWS_PER_NUMBER * columns.shape[1] or not at_once[known].any():
        return None
    inner = np.linalg.pinv(columns.T @ columns)
    found = inner @ (columns.T @ target)
    spread = inner @ (columns.T * (target - columns @ found) ** 2) @ columns @ inner
    driven = np.isfinite(reading)
    gain = float(duty[driven] @ reading[driven]) / float(duty[driven] @ duty[driven])
    return (float(found[0] / gain), float(spread[0, 0] / gain**2)) if gain > 0.0 else None
