"""Recorded motor commands in the form the plant takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import ConfigError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """Motor commands, one per row: command i is given at time[i] and in force until time[i + 1]. All arrays
    have the same length n.

    time: s, increasing. left, right: duty -1..1, positive drives the wheel forward. closed_left,
    closed_right: 1 where the motor is connected (driven, or braked at duty 0), 0 where it coasts.

    Raises ConfigError, which names the row, for a number that is not finite, a duty outside -1..1, or a time
    that does not increase.
    """

    time: Floats
    left: Floats
    right: Floats
    closed_left: Floats
    closed_right: Floats

    def __post_init__(self) -> None:
        for name in self.__slots__:
            object.__setattr__(self, name, _as_compiled(getattr(self, name)))
        _check_time(self.time)
        for name in ("left", "right"):
            _check_row(name, getattr(self, name), self.time, -1.0, 1.0)
        for name in ("closed_left", "closed_right"):
            _check_row(name, getattr(self, name), self.time, 0.0, 1.0)

    @classmethod
    def of_wheels(
        cls, time: ArrayLike, left: ArrayLike, right: ArrayLike, brake: ArrayLike = True
    ) -> Commands:
        """Commands from the duties of the wheels, -1..1, forward positive, at these times, s.

        brake: whether a motor is shorted where its duty is 0: one value, one per row, or an array (n, 2).
        True is the textbook motor, at 0 V then; the controller's default is to coast (False). Raises
        ConfigError as `Commands` does, and for another value of brake.
        """
        moments = np.asarray(time, dtype=np.float64)
        duties = [np.asarray(each, dtype=np.float64) for each in (left, right)]
        for name, duty in zip(("left", "right"), duties, strict=True):
            _check_row(name, duty, moments, -1.0, 1.0)
        if not np.all(np.isin(brake, (0.0, 1.0))):
            raise ConfigError("brake: allowed are True and False")
        rows = np.asarray(brake, dtype=bool)
        brakes = rows if rows.ndim == 2 else np.stack((rows, rows), axis=-1)
        brakes = np.broadcast_to(brakes, (len(moments), 2))
        closed = [
            np.asarray((duty != 0.0) | brakes[:, side], dtype=np.float64) for side, duty in enumerate(duties)
        ]
        return cls(moments, *duties, *closed)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rows(self) -> tuple[Floats, Floats, Floats, Floats]:
        """The four arrays of duties and closed bridges, as the equations take them."""
        return self.left, self.right, self.closed_left, self.closed_right


def _as_compiled(values: ArrayLike) -> Floats:
    """The values as the kind of array for which the plant is compiled. Any other kind, such as read-only
    arrays from pandas, caused another compilation, of 40 s each."""
    return np.require(values, np.float64, ["C", "W"])


def _check_time(time: Floats) -> None:
    if time.ndim != 1 or len(time) < 2:
        raise ConfigError(f"time has the shape {time.shape}: it must be a row of at least 2 numbers")
    bad = np.flatnonzero(~(np.diff(time) > 0.0) | ~np.isfinite(time[1:]))
    if len(bad) or not np.isfinite(time[0]):
        row = int(bad[0]) + 1 if len(bad) else 0
        raise ConfigError(f"time[{row}] is {time[row]} s: times must be finite and rise")


def _check_row(name: str, values: Floats, time: Floats, low: float, high: float) -> None:
    if values.shape != time.shape:
        raise ConfigError(f"{name} has the shape {values.shape}: it must have that of time, {time.shape}")
    bad = np.flatnonzero(~((values >= low) & (values <= high)))
    if len(bad):
        row = int(bad[0])
        what = "duties" if low < 0.0 else "numbers"
        raise ConfigError(f"{name}[{row}] is {values[row]}: allowed are {what} from {low:g} to {high:g}")
