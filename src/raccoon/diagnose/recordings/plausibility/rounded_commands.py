"""Commands that were rounded for the log: their ramps are stairs, which the motors did not get.

Rounded to one digit, the ramps of a contest's drive gave a fault-free robot four causes. Whole percent are
what many programs send, and then right. But if a program calculates its commands, half a percent of the
battery's voltage is some counts at a wheel for as long as a command holds: a fault-free robot got a scrub of
6 mN m.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.result import Diagnosis, Verdict

Columns = Mapping[str, NDArray[np.float64]]

COARSE_STEPS = (0.1, 0.05)
"""Rounding steps of commands that are detected, duty."""
PERCENT_STEP, MIN_CALCULATED_COMMANDS = 0.01, 30
"""A finer rounding step, duty, and the number of different commands above which they are calculated, since
nobody writes so many into a program."""
MIN_COMMANDS, MIN_SINGLE_STEPS, MIN_SINGLE_STEP_SHARE = 6, 20, 0.5
"""Least number of different commands, of changes by a single step, and their least share of all changes for a
column that looks rounded. The share is at least 0.8 in drives that ramp, and 0.3 in one that mostly jumps,
where rounding matters little. A program with a few powers of its own jumps between them."""


def with_rounding_doubt(found: Diagnosis, columns: Columns) -> Diagnosis:
    """The diagnosis; if commands look rounded, with a note and explained at most in part."""
    steps = {name: _rounding_step(each) for name, each in columns.items() if name.endswith(".duty")}
    steps = {name: each for name, each in steps.items() if each}
    if found.verdict in (Verdict.ADEQUATE, Verdict.NOT_IDENTIFIABLE):
        return found
    if not steps:
        return _with_percent_note(found, columns)
    note = (
        f"{' and '.join(steps)} hold whole multiples of {min(steps.values()):g} and step from one to the "
        "next, like commands that were rounded for the log: that alone may explain what was found. Log them "
        "with four digits (if the program itself sends them rounded, they are right)"
    )
    verdict = Verdict.PARTLY if found.verdict is Verdict.EXPLAINED else found.verdict
    return replace(found, verdict=verdict, notes=(note, *found.notes))


def _with_percent_note(found: Diagnosis, columns: Columns) -> Diagnosis:
    """The diagnosis; if calculated commands are in whole percent, with a note on causes whose effect is
    smaller than that of this rounding."""
    names = [
        name for name, each in columns.items() if name.endswith(".duty") and _is_calculated_in_percent(each)
    ]
    if not names:
        return found
    volts = float(np.nanmedian(columns["battery.voltage"])) if "battery.voltage" in columns else 0.0
    rounding_counts = PERCENT_STEP / np.sqrt(12.0) * volts / BEMF_VOLTS_PER_COUNT
    noise = [each.noise_floor for each in found.channels if each.name.endswith(".bemf")]
    doubtful = [each.name for each in found.causes if noise and each.change * max(noise) < rounding_counts]
    if not doubtful:
        return found
    note = (
        f"{' and '.join(names)} hold whole percent, and rounding to these changes the wheels' readings by "
        f"{rounding_counts:.0f} counts, more than {' and '.join(doubtful)}: commands that were rounded for "
        "the log alone may explain that. Log them with four digits (if the program itself sends percent, "
        "they are right)"
    )
    return replace(found, notes=(note, *found.notes))


def _is_calculated_in_percent(duty: NDArray[np.float64]) -> bool:
    """Whether there are many different commands, all in whole percent."""
    percents = np.rint(duty[np.isfinite(duty)] / PERCENT_STEP)
    errors = np.abs(duty[np.isfinite(duty)] - PERCENT_STEP * percents).max(initial=0.0)
    return bool(errors < 1e-6) and len(np.unique(percents)) >= MIN_CALCULATED_COMMANDS


def _rounding_step(duty: NDArray[np.float64]) -> float:
    """The rounding step of the commands, duty; 0 if they do not look rounded."""
    known = duty[np.isfinite(duty)]
    for step in COARSE_STEPS:
        multiples = np.rint(known / step)
        if np.abs(known - step * multiples).max(initial=0.0) > 1e-6:
            continue
        changes = np.abs(np.diff(multiples))
        single_steps, all_changes = int((changes == 1.0).sum()), int((changes > 0.0).sum())
        is_rounded = len(np.unique(multiples)) >= MIN_COMMANDS and single_steps >= max(
            MIN_SINGLE_STEPS, MIN_SINGLE_STEP_SHARE * all_changes
        )
        return step if is_rounded else 0.0
    return 0.0
