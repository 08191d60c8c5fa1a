"""Simulates one motor or axis with many parameter sets (lanes) over many stretches of time at once.

    force or torque u:   f = u, where `inductance` is given with a lag of as many seconds
    voltage u:           L di/dt = u - R i - K w,   f = K i

    M dw/dt = f - o - b (1 + d_b s) w - s (c (1 + d_c s) + c_s exp(-(w/w_s)^2) + q w^2 + l |f|),   s = sign(w)

with u optionally delayed and with a dead band, which follows one of two rules: as in the simulated robot,
nothing up to `deadband` and then linear up to the full effort at `full`; or nothing below `dead_below` and
the full effort above (blended over a tenth of it to either side, so that the fit is differentiable). A step
is exact for the winding, for the time at which a delayed effort changes, and for viscous friction with the
other forces constant. An axis at rest stays at rest until |f| exceeds its dry friction. Neutral values have
exactly no effect.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEUTRAL_VALUES: Mapping[str, float] = {
    "resistance": 1.0, "inductance": 0.0, "back_emf": 1.0, "inertia": 1.0, "coulomb": 0.0, "viscous": 0.0,
    "offset": 0.0, "asymmetry": 0.0, "viscous_asymmetry": 0.0, "stiction": 0.0, "stiction_speed": 1.0,
    "quadratic": 0.0, "load": 0.0, "latency": 0.0, "deadband": 0.0,
    "dead_below": 0.0, "full": 1e9,
}  # fmt: skip
"""Every parameter of the model with its neutral value; the first four must be set."""
MAX_STEP_S, MAX_WINDING_STEP_S = 0.001, 0.0005
"""Longest step of the simulation, s, and the same for a winding with inductance."""
MAX_SUBSTEPS = 10
"""Largest number of simulation steps per sample, however far apart samples are."""
TINY = 1e-12
"""Replaces a 0 in a denominator whose quotient is not used."""


@dataclass(frozen=True, slots=True)
class Stretches:
    """Pieces of a recording, all of the same length, that are simulated side by side.

    first (n,): first sample of each stretch in the recording. count: rows of a stretch, one for `every`
    samples. position, speed (n,): initial state. weight (rows, n): 1 for a row that counts, else 0. measured,
    current (rows, n): motion and current.
    """

    first: NDArray[np.intp]
    count: int
    every: int
    position: Array
    speed: Array
    measured: Array
    current: Array | None
    weight: Array

    def rows(self) -> NDArray[np.intp]:
        """Index of the recording's sample in each row, (rows, n)."""
        return np.asarray(self.first[None, :] + self.every * np.arange(self.count)[:, None])


def simulate(
    parameters: Mapping[str, Array], effort: Array, step: float, stretches: Stretches, electrical: bool
) -> tuple[Array, Array, Array]:
    """Position, speed and current, each (rows, lanes, stretches), for parameters (lanes,) by name."""
    out = np.empty((3, stretches.count, len(parameters["inertia"]), len(stretches.first)))
    longest = MAX_WINDING_STEP_S if np.any(parameters["inductance"]) else MAX_STEP_S
    substeps = min(MAX_SUBSTEPS, max(1, int(np.ceil(step / longest - 1e-9))))
    compiled = _compiled_kernel()
    if compiled is None:
        _simulate_vectorised(parameters, effort, step, stretches, electrical, substeps, out)
    else:
        table = np.column_stack([np.asarray(parameters[name], float) for name in NEUTRAL_VALUES])
        starts = (stretches.first, stretches.position, stretches.speed)
        compiled(table, effort, step, *starts, stretches.every, substeps, electrical, out)
    return out[0], out[1], out[2]


@cache
def _compiled_kernel() -> Any:
    """The compiled kernel, None without numba."""
    if importlib.util.find_spec("numba") is None:
        return None
    import numba

    from raccoon.diagnose.recordings.axis.kernel import simulate_stretches

    return numba.njit(cache=True, error_model="numpy")(simulate_stretches)


def _simulate_vectorised(
    parameters: Mapping[str, Array],
    effort: Array,
    step: float,
    stretches: Stretches,
    electrical: bool,
    substeps: int,
    out: Array,
) -> None:
    """`simulate` with arrays over lanes and stretches, used without numba."""
    p = {name: np.asarray(value, float)[:, None] for name, value in parameters.items()}
    state = _State.start(stretches, len(p["inertia"]), p, effort, electrical)
    for row in range(stretches.count):
        out[:, row] = state.position, state.speed, state.current
        for sample in range(row * stretches.every, (row + 1) * stretches.every):
            at = np.minimum(stretches.first + sample, len(effort) - 1)
            sooner, later, share = _delayed_efforts(effort, at, step, p)
            for piece in range(substeps):
                part = np.clip(share * substeps - piece, 0.0, 1.0)
                _advance(state, (sooner, later, part), p, step / substeps, electrical)


@dataclass(slots=True)
class _State:
    position: Array
    speed: Array
    current: Array

    @classmethod
    def start(
        cls, stretches: Stretches, lanes: int, p: Mapping[str, Array], effort: Array, electrical: bool
    ) -> _State:
        shape = (lanes, len(stretches.first))
        speed = np.broadcast_to(stretches.speed, shape).copy()
        running = (stretches.first > 0)[None, :]
        before = effort[np.maximum(stretches.first - 1, 0)]
        if electrical:
            before = (before - p["back_emf"] * speed) / p["resistance"]
        current = np.broadcast_to(np.where(running, before, 0.0), shape).copy()
        return cls(np.broadcast_to(stretches.position, shape).copy(), speed, current)


def _delayed_efforts(
    effort: Array, rows: NDArray[np.intp], step: float, p: Mapping[str, Array]
) -> tuple[Array, Array, Array]:
    """The efforts that act at these samples, with latency and dead band, (lanes, stretches): the one before
    the delayed change, the one after it, and the fraction of the sample period at which it changes."""
    latency_samples = p["latency"] / step
    whole_samples = np.floor(latency_samples).astype(np.intp)
    efforts = (_effort_at(effort, rows[None, :] - whole_samples - back) for back in (1, 0))
    before, after = (_with_dead_band(each, p) for each in efforts)
    return before, after, np.asarray(latency_samples - whole_samples)


def _with_dead_band(u: Array, p: Mapping[str, Array]) -> Array:
    if p["deadband"].any():
        stretch = p["full"] / np.maximum(p["full"] - p["deadband"], 1e-9)
        moved = np.sign(u) * np.maximum(np.abs(u) - p["deadband"], 0.0) * stretch
        u = np.where(p["deadband"] > 0.0, moved, u)
    if p["dead_below"].any():
        acts = np.clip(5.0 * (np.abs(u) / np.maximum(p["dead_below"], TINY) - 0.9), 0.0, 1.0)
        u = np.where(p["dead_below"] > 0.0, u * acts, u)
    return np.asarray(u)


def _effort_at(effort: Array, rows: NDArray[np.intp]) -> Array:
    return np.asarray(np.where(rows >= 0, effort[np.maximum(rows, 0)], 0.0))


def _advance(
    state: _State, acting: tuple[Array, Array, Array], p: Mapping[str, Array], step: float, electrical: bool
) -> None:
    w = state.speed
    sooner, later, part = acting
    decay = step * p["resistance"] / np.maximum(p["inductance"], TINY)
    mean = np.zeros_like(w)
    for u, length in ((sooner, part), (later, 1.0 - part)):
        settled = (u - p["back_emf"] * w) / p["resistance"] if electrical else u
        kept = np.exp(-decay * length)
        mean = mean + settled * length + (state.current - settled) * (1.0 - kept) / decay
        state.current = settled + (state.current - settled) * kept
    force = (p["back_emf"] * mean if electrical else mean) - p["offset"]
    side = np.sign(w)
    side = np.where(side == 0.0, np.sign(force), side)
    dry = p["coulomb"] * (1.0 + p["asymmetry"] * side) + p["load"] * np.abs(force)
    if p["stiction"].any():
        dry = dry + p["stiction"] * np.exp(-((w / p["stiction_speed"]) ** 2))
    drag = p["viscous"] * (1.0 + p["viscous_asymmetry"] * side) + p["quadratic"] * np.abs(w)
    rate = np.maximum(drag / p["inertia"] * step, TINY)
    kept = np.exp(-rate)
    new = w * kept + (force - side * dry) * step / p["inertia"] * (1.0 - kept) / rate
    stops = (w * new < 0.0) | ((w == 0.0) & (np.abs(force) <= dry))
    new = np.where(stops, 0.0, new)
    state.position = state.position + 0.5 * step * (w + new)
    state.speed = new
