"""Planned drives that excite possible causes: duty (n, 2) at 200 Hz, left before right."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean

Array = NDArray[np.float64]

RATE = 200
"""Rate of a planned drive's rows, Hz."""
CHECKUP = "checkup"
"""Name of the drive that shows something of every cause."""
CREEP_DUTY = 0.2
"""Largest duty of a creeping wheel: from rest through its dead band until it just turns."""


def _hold(left: float, right: float, seconds: float) -> Array:
    return np.tile([left, right], (max(int(seconds * RATE), 1), 1))


def _hold_and_rest(left: float, right: float, seconds: float) -> Array:
    return np.vstack([_hold(left, right, seconds), _hold(0.0, 0.0, 0.5)])


def _ramp(left: float, right: float, seconds: float) -> Array:
    return np.linspace([0.0, 0.0], [left, right], max(int(seconds * RATE), 2))


def _creep() -> Array:
    up = _ramp(0.3, 0.3, 1.25)
    spin = _ramp(-0.3, 0.3, 1.25)
    return np.vstack([up, up[::-1], -up, -up[::-1], spin, spin[::-1], -spin, -spin[::-1]])


def _steps() -> Array:
    rng = np.random.default_rng(1)
    levels = rng.uniform(-1.0, 1.0, (12, 2))
    pairs = np.vstack([levels, -levels])  # with opposite steps, the robot stays near its start
    return np.vstack([_hold(left, right, 0.4) for left, right in pairs])


def _checkup() -> Array:
    """Four rounds of random steps, creeping, a spin, a reversal and a fast arc.

    No single manoeuvre shows everything: resistance and heating need reversals, friction steady legs at many
    speeds, a dead zone and stiction creeping, a slope all headings. Unlike in `_steps`, steps are not
    followed by their opposite: if each speed came with its mirror image, direction-dependent friction and the
    scale of a reading would not show.
    """
    rng = np.random.default_rng(11)  # the seed of the first dozen whose drive needs least room
    parts = [_hold(0.0, 0.0, 0.5)]
    for index, fast in enumerate((1.0, 0.6, 0.8, 0.45)):
        side, way = (-1.0 if index % 2 else 1.0), (-1.0 if index // 2 else 1.0)
        for left, right, share in zip(*rng.uniform(-1.0, 1.0, (2, 6)), rng.random(6), strict=True):
            parts.append(_hold(left, right, 0.2 + 0.5 * share))
        up = way * _ramp(side * CREEP_DUTY, CREEP_DUTY, 1.2)
        parts += [up, up[::-1], _hold(0.0, 0.0, 0.2)]
        parts += [_hold(-side * fast, side * fast, 0.6), _hold(side * fast, -side * fast, 0.5)]
        parts += [_hold(fast, fast, 0.8), _hold(-fast, -fast, 0.8)]
        inner, outer = (0.6, 1.0) if index % 2 else (1.0, 0.6)
        parts += [_hold(inner, outer, 1.8), _hold(0.0, 0.0, 0.2)]
    return np.vstack(parts)


MANOEUVRES: Mapping[str, Callable[[], Array]] = {
    CHECKUP: _checkup,
    "straight": lambda: np.vstack([_hold_and_rest(0.8, 0.8, 2.0), _hold_and_rest(-0.8, -0.8, 2.0)]),
    "back and forth": lambda: np.vstack([_hold(1, 1, 0.7), _hold(-1, -1, 0.7)] * 5 + [_hold(0, 0, 0.5)]),
    "spin": lambda: np.vstack([_hold(-0.8, 0.8, 0.9), _hold(0.8, -0.8, 0.9)] * 5),
    "creep": _creep,
    "steps": _steps,
    "circles": lambda: np.vstack([_hold_and_rest(0.9, 0.45, 4.0), _hold_and_rest(0.45, 0.9, 4.0)]),
    "still": lambda: _hold(0.0, 0.0, 6.0),
}  # fmt: skip
"""Safe drives, by name."""


def manoeuvre(name: str) -> Array:
    """Duty (n, 2) of a manoeuvre. Raises ConfigError for an unknown name."""
    if name not in MANOEUVRES:
        raise ConfigError(
            f"manoeuvre {name!r}: there is none of that name{did_you_mean(name, MANOEUVRES)}; allowed are"
            f" {', '.join(MANOEUVRES)}"
        )
    return MANOEUVRES[name]()
