"""The commands of motors in each row of a recording, in which many rows may be blank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.trace.file_hints import misnamed_columns_note, unnamed

Array = NDArray[np.float64]


def commanded_duty(columns: Mapping[str, Array], port: int) -> Array:
    """The duty of a motor, -1 to 1, in force from each row on. Raises TraceError if none was recorded."""
    name = f"motor.{port}.duty"
    if name not in columns:
        held = sorted(each for each in columns if each.endswith(".duty")) or ["no commands at all"]
        why = (
            "; ".join(filter(None, (misnamed_columns_note(columns), unnamed(columns))))
            or "is it this robot's?"
        )
        raise TraceError(f"{name} is not in the recording: it holds {', '.join(held)}; {why}")
    duty = np.asarray(columns[name], float)
    if not np.isfinite(duty).any():
        raise TraceError(f"{name} holds no numbers")
    return hold_until_next(duty)


def hold_until_next(values: Array) -> Array:
    """Zero-order hold of the numbers over blank rows; 0 before the first number."""
    latest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(latest < 0, 0.0, values[latest])


def read_brakes(columns: Mapping[str, Array], ports: Sequence[int]) -> NDArray[np.bool_] | None:
    """Whether each motor is shorted at duty 0, (n, 2), valid until the next row. As in the format, a row with
    a command but no brake value does not brake, and a row with neither keeps the state before it. None if a
    motor has no brake value in any row."""
    names = [f"motor.{port}.brake" for port in ports]
    if not all(name in columns and np.isfinite(columns[name]).any() for name in names):
        return None
    duties = [columns[f"motor.{port}.duty"] for port in ports]
    words = [brake_in_force(columns[name], duty) for name, duty in zip(names, duties, strict=True)]
    return np.column_stack([each > 0.5 for each in words])


def brake_in_force(words: Array, duty: Array) -> Array:
    """Whether a motor is shorted at duty 0 in each row, 0 or 1. words, duty: its brake and duty columns as
    recorded."""
    return hold_until_next(np.where(np.isfinite(duty), np.nan_to_num(words), words))
