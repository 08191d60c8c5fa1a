"""Whether a recording can be judged on another one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.kind import Kind

Columns = Mapping[str, NDArray[np.float64]]

KINDS: Mapping[Kind, str] = {
    Kind.DRIVE: "a drive with its commands",
    Kind.MOTORS: "single motors",
    Kind.STEP: "one motor under one power",
    Kind.GEOMETRY: "wheels and a reference without commands",
    Kind.TOPHATS: "tophats alone",
    Kind.NOTHING: "neither commands nor a reference",
}
ON_OTHERS = (Kind.DRIVE, Kind.MOTORS, Kind.GEOMETRY)
"""Kinds that are judged on another recording; the others on their own last part, or not at all."""
SAME = 0.5
"""Share of a recording's samples that are in another one as well, from which the two are one."""


def not_judged_on(columns: Columns, holdout: Columns, kind: Kind, other: Kind) -> str:
    """Why the other recording is of no use to this kind, as a note; "" where it is.

    Raises TraceError for one of another kind, and for one that holds the same samples.
    """
    if kind not in ON_OTHERS:
        return f"the other recording was not used: one that holds {KINDS[kind]} is judged by itself"
    if other != kind:
        raise TraceError(
            f"it holds {KINDS[other]}, and the recording that is diagnosed {KINDS[kind]}: name one of the "
            "same kind"
        )
    clocks = (columns["t"], holdout["t"]), (_from_0(columns["t"]), _from_0(holdout["t"]))
    if max(_shared(columns, holdout, *each) for each in clocks) > SAME:
        raise TraceError(
            "its samples are those of the recording that is diagnosed, which would agree with itself: name "
            "another recording, or none: then the part that no fit has seen is the judge"
        )
    return ""


def _from_0(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """A recording that is exported twice may begin at another time."""
    return np.asarray(np.round(time - time[0], 5), np.float64)


def _shared(
    columns: Columns, holdout: Columns, time: NDArray[np.float64], other: NDArray[np.float64]
) -> float:
    """Share of the other recording's samples that are in this one, at the same time with the same numbers."""
    names = [name for name in columns if name in holdout and name != "t"]
    _, ours, theirs = np.intersect1d(time, other, return_indices=True)
    if not names or len(ours) == 0:
        return 0.0
    alike = [
        np.isclose(columns[name][ours], holdout[name][theirs], rtol=1e-9, atol=0.0, equal_nan=True)
        for name in names
    ]
    return float(np.all(alike, axis=0).sum()) / len(other)
