"""Commands of a recording: duty (n, 2) at 200 Hz, left before right, drawn from a generator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 200


def _hold(left: float, right: float, seconds: float) -> Array:
    return np.tile([left, right], (max(int(seconds * RATE), 1), 1))


def _ramp(start: tuple[float, float], end: tuple[float, float], seconds: float) -> Array:
    share = np.linspace(0.0, 1.0, max(int(seconds * RATE), 2))[:, None]
    return np.asarray(start) * (1.0 - share) + np.asarray(end) * share


def _random_steps(rng: np.random.Generator) -> Array:
    levels = rng.uniform(-1.0, 1.0, size=(8, 2))
    return np.vstack([_hold(left, right, rng.uniform(0.15, 0.7)) for left, right in levels])


def _creep(rng: np.random.Generator) -> Array:
    top = rng.uniform(0.12, 0.3) * rng.choice([-1.0, 1.0])
    turn = rng.choice([-1.0, 1.0])
    return np.vstack(
        [
            _ramp((0.0, 0.0), (top, turn * top), 1.6),
            _ramp((top, turn * top), (0.0, 0.0), 1.2),
            _hold(0, 0, 0.2),
        ]
    )


def _spin(rng: np.random.Generator) -> Array:
    size = rng.uniform(0.4, 1.0) * rng.choice([-1.0, 1.0])
    return np.vstack([_hold(-size, size, 0.8), _hold(size, -size, 0.7), _hold(0.0, 0.0, 0.2)])


def _back_and_forth(rng: np.random.Generator) -> Array:
    size = rng.uniform(0.5, 1.0)
    return np.vstack([_hold(size, size, 0.9), _hold(-size, -size, 0.9), _hold(0.0, 0.0, 0.3)])


def _circle(rng: np.random.Generator) -> Array:
    inner = rng.uniform(0.4, 0.8)
    pair = (1.0, inner) if rng.random() < 0.5 else (inner, 1.0)
    return _hold(*pair, 1.5)


def exciting(rng: np.random.Generator, seconds: float = 40.0) -> Array:
    """A drive that shows everything: random steps, creeping, spins, reversals, full-speed arcs."""
    parts = [_hold(0.0, 0.0, 0.5)]
    makers = (_random_steps, _creep, _spin, _back_and_forth, _circle)
    while sum(map(len, parts)) < seconds * RATE:
        order = rng.permutation(len(makers))
        parts.extend(makers[index](rng) for index in order)
    return np.vstack(parts)[: int(seconds * RATE)]


def _trapezoid(left: float, right: float, seconds: float, rise: float = 0.3) -> Array:
    pair = (left, right)
    return np.vstack([_ramp((0, 0), pair, rise), _hold(left, right, seconds), _ramp(pair, (0, 0), rise)])


def contest(rng: np.random.Generator, seconds: float = 30.0) -> Array:
    """What a team's program does: straight legs, quarter turns, waits for an arm, slow approaches."""
    parts = [_hold(0.0, 0.0, 0.5)]
    while sum(map(len, parts)) < seconds * RATE:
        speed = rng.uniform(0.4, 0.9) * (1.0 if rng.random() < 0.75 else -1.0)
        parts.append(_trapezoid(speed, speed, rng.uniform(0.8, 2.5)))
        turn = rng.uniform(0.3, 0.5) * rng.choice([-1.0, 1.0])
        parts.append(_trapezoid(-turn, turn, rng.uniform(0.4, 0.9), 0.15))
        if rng.random() < 0.5:
            parts.append(_hold(0.0, 0.0, rng.uniform(0.3, 1.5)))
        if rng.random() < 0.4:
            slow = rng.uniform(0.15, 0.25)
            parts.append(_trapezoid(slow, slow, rng.uniform(0.6, 1.4)))
    return np.vstack(parts)[: int(seconds * RATE)]


def legs(rng: np.random.Generator, seconds: float) -> Array:
    """Straight on at one speed after another, with rests: for a robot that steers by itself."""
    parts = [_hold(0.0, 0.0, 0.5)]
    while sum(map(len, parts)) < seconds * RATE:
        speed = rng.uniform(0.3, 0.6)
        parts.append(_ramp((0.0, 0.0), (speed, speed), 0.2))
        parts.append(_hold(speed, speed, rng.uniform(3.0, 6.0)))
        parts.append(_hold(0.0, 0.0, rng.uniform(0.3, 1.0)))
    return np.vstack(parts)[: int(seconds * RATE)]
