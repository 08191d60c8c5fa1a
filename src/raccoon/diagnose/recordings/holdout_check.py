"""Check that a recording can be judged on a holdout recording."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.kind import Kind

Columns = Mapping[str, NDArray[np.float64]]

KIND_DESCRIPTIONS: Mapping[Kind, str] = {
    Kind.DRIVE: "a drive with its commands",
    Kind.MOTORS: "single motors",
    Kind.STEP: "one motor under one power",
    Kind.GEOMETRY: "wheels and a reference without commands",
    Kind.TOPHATS: "tophats alone",
    Kind.NOTHING: "neither commands nor a reference",
}
KINDS_WITH_HOLDOUT = (Kind.DRIVE, Kind.MOTORS, Kind.GEOMETRY)
"""Kinds that are judged on a holdout; others are judged on their own last part, or not at all."""
MAX_SHARED_SHARE = 0.5
"""Share of a holdout's samples that are also in the recording above which both count as the same."""


def check_holdout(columns: Columns, holdout: Columns, kind: Kind, holdout_kind: Kind) -> str:
    """A note if a recording of this kind does not use a holdout; "" if it does.

    Raises TraceError for a holdout of another kind, or with the same samples.
    """
    if kind not in KINDS_WITH_HOLDOUT:
        return (
            f"the holdout was not used: a recording that holds {KIND_DESCRIPTIONS[kind]} is validated on its "
            "own data"
        )
    if holdout_kind != kind:
        raise TraceError(
            f"it holds {KIND_DESCRIPTIONS[holdout_kind]}, and the recording that is diagnosed "
            f"{KIND_DESCRIPTIONS[kind]}: name one of the same kind"
        )
    clocks = (columns["t"], holdout["t"]), (_from_zero(columns["t"]), _from_zero(holdout["t"]))
    if max(_shared_sample_share(columns, holdout, *each) for each in clocks) > MAX_SHARED_SHARE:
        raise TraceError(
            "its samples are those of the recording that is diagnosed, so it validates nothing: name another "
            "recording, or none (then a part of the recording itself is held out)"
        )
    return ""


def _from_zero(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Time since the first sample, s: two exports of one recording may begin at different times."""
    return np.asarray(np.round(time - time[0], 5), np.float64)


def _shared_sample_share(
    columns: Columns, holdout: Columns, time: NDArray[np.float64], other: NDArray[np.float64]
) -> float:
    """Share of the holdout's samples that the recording has at the same time with the same values."""
    names = [name for name in columns if name in holdout and name != "t"]
    _, rows, holdout_rows = np.intersect1d(time, other, return_indices=True)
    if not names or len(rows) == 0:
        return 0.0
    are_equal = [
        np.isclose(columns[name][rows], holdout[name][holdout_rows], rtol=1e-9, atol=0.0, equal_nan=True)
        for name in names
    ]
    return float(np.all(are_equal, axis=0).sum()) / len(other)
