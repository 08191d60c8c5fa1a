"""Whether wheels answer within the long rows of a recording, before the command that they answer is logged.

Where a controller is as slow as its rows, a command is given at its row, and no wheel answers before. Of one
that runs faster, and of which every so many cycles were logged, commands change somewhere within a row, and
wheels have begun to answer by the row that shows it. So a reading is foreseen from what was commanded and
read until then (ARX), and by the change of the command in its own row. Of what a command moves in the end,
the share that is there at once was 0 to 0.014 of 50 Hz as they were driven, and 0.03 to 0.25 of every fourth
row of 200 Hz. It is nothing either where a reading is as old as a row is long, as behind a firmware's median
and slots. A gyro is read as it is: of what turns the robot 0.05 to 0.31 was there at once in every third row
of that, and 0.006 at most of 67 Hz as they were driven.
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
"""s between rows of a controller that runs faster. A command changes somewhere within a row: of a clean drive
at 200 Hz every second row is diagnosed as all are, every third makes an inertia 17 % too small of it. Longer
rows are taken for cycles where wheels do not answer within them."""
MAX_ROW_CYCLES = 1.25
"""Of the controller's cycle: how long rows may be that are one cycle each."""
COMMAND_LAGS, READING_LAGS = 7, 3
"""Rows of them before that a reading is foreseen from."""
MIN_IMMEDIATE_SHARE = 0.01
"""Of its answer from which a wheel has begun to answer, two standard deviations taken off."""
MIN_ROWS_PER_NUMBER = 10
"""Rows for each number that is fitted."""


def check_row_length(row: float, rate_hz: float, wheels: Wheels, turns: Wheels) -> tuple[str, ...]:
    """What is said of rows, s, that are longer than robot.toml's cycles. wheels: commands and readings of
    each, NaN where there is none. turns: what turns the robot, and the gyro's readings, where it has one.

    Raises TraceError where a command's moment is not known: such rows name causes that are not there.
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
            f"{told}: it is taken to be as slow as its rows, and {slower} in robot.toml says so; if it is "
            f"faster, {unknown}",
        )
    say = f", or say in robot.toml that the controller itself is as slow ({slower})" if own else ""
    raise TraceError(f"{told}: {unknown}{say}")


def _respond_within_rows(wheels: Wheels) -> bool:
    """Whether these surely answer a command before the row that holds it."""
    seen = [each for each in (_immediate_share(*pair) for pair in wheels) if each is not None]
    if not seen:
        return False
    shares, variances = np.array(seen).T
    return bool(shares.mean() - 2.0 * np.sqrt(variances.sum()) / len(seen) > MIN_IMMEDIATE_SHARE)


def _immediate_share(duty: Array, reading: Array) -> tuple[float, float] | None:
    """Of what a change of its command moves a reading by in the end, the share that is there at the row of
    the change, and its variance."""
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
