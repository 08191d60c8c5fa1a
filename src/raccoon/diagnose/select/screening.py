"""Screening: the log evidence that each inactive cause or probe would add, by the linear model alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.linear_model import ColumnGroup, GramTable
from raccoon.diagnose.select.state import Search

Array = NDArray[np.float64]
Screening = list[tuple[float, ColumnGroup, Array]]


def screen_groups(search: Search, table: GramTable | None = None, hold_bounds: bool = False) -> Screening:
    """Log evidence that each inactive cause or probe would add in the linear model, and its coordinates; best
    first.

    table: by default that of the search. hold_bounds: whether coordinates at a bound stay there; otherwise
    they are refitted within their bounds together with each group.
    """
    table = search.table if table is None else table
    limits, spans = search.problem.limits(search.fit.point), [span for _, span in table.inactive]
    held = hold_bounds or bool(search.fit.free.all())
    solved = _solve_beside_held(search, table) if held else table.gram.solve_beside_bounded(*limits, spans)
    found = [
        (gain, group, mean)
        for (group, _), (mean, gain) in zip(table.inactive, solved, strict=True)
        if not group.one_sided or mean[0] > 0.0
    ]
    found.sort(key=lambda each: -each[0])
    return found


def _solve_beside_held(search: Search, table: GramTable) -> Iterator[tuple[Array, float]]:
    """Coordinates of each inactive group, and the log evidence that it adds to the free coordinates."""
    free = search.fit.free
    leading = [int(i) for i in np.flatnonzero(free)]
    held = np.zeros(len(table.gram.projection))
    held[: len(free)] = np.where(free, 0.0, search.fit.point.vector())
    shifted = table.gram.shifted(held)
    rest = shifted.take([*leading, *(i for _, span in table.inactive for i in span)]).eliminate_leading(
        len(leading)
    )
    position = 0
    for _, span in table.inactive:
        mean, gain, _ = rest.take(range(position, position + len(span))).solve()
        position += len(span)
        yield mean, gain
