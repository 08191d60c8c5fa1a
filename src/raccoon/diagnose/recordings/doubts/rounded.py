"""Commands that whoever logged them rounded: a ramp is a stair then that no motor got.

Of a sound robot whose duties had one digit the ramps of a contest's drive made four causes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import Diagnosis, Verdict

Columns = Mapping[str, NDArray[np.float64]]

COARSE = (0.1, 0.05)
"""Steps of commands that are looked for. Percent are no rounding: drivers take them."""
LEVELS, STEPS, MOSTLY = 6, 20, 0.5
"""Different commands, changes by one step, and their share of all changes, from which a column looks
rounded: 0.8 and more of drives that ramp, 0.3 of one that mostly jumps, which little is made of.
A program of its own few powers jumps between them."""


def with_rounded(found: Diagnosis, columns: Columns) -> Diagnosis:
    """A diagnosis that doubts what it found where commands look rounded."""
    steps = {name: _step(each) for name, each in columns.items() if name.endswith(".duty")}
    steps = {name: each for name, each in steps.items() if each}
    if not steps or found.verdict in (Verdict.ADEQUATE, Verdict.NOT_IDENTIFIABLE):
        return found
    note = (
        f"{' and '.join(steps)} hold whole multiples of {min(steps.values()):g} and go from one to the next, "
        "as commands that were rounded for the log do: what was found may be no more than that. Log them "
        "with four digits (if the program itself sends them so, they are right)"
    )
    verdict = Verdict.PARTLY if found.verdict is Verdict.EXPLAINED else found.verdict
    return replace(found, verdict=verdict, notes=(note, *found.notes))


def _step(duty: NDArray[np.float64]) -> float:
    """The step of which the commands are multiples, 0 where they do not look rounded."""
    known = duty[np.isfinite(duty)]
    for step in COARSE:
        whole = np.rint(known / step)
        if np.abs(known - step * whole).max(initial=0.0) > 1e-6:
            continue
        changes = np.abs(np.diff(whole))
        single, every = int((changes == 1.0).sum()), int((changes > 0.0).sum())
        rounded = len(np.unique(whole)) >= LEVELS and single >= max(STEPS, MOSTLY * every)
        return step if rounded else 0.0
    return 0.0
