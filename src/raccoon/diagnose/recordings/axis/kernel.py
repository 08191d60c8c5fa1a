"""The equations of `model`, sample by sample, for numba. It is one function, so that numba's cache, which
depends on this file alone, cannot be stale."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def simulate_stretches(
    table: Array, effort: Array, step: float, first: NDArray[np.intp], position: Array, speed: Array,
    every: int, pieces: int, electrical: bool, out: Array,
) -> None:  # fmt: skip
    """Fill `out` (3, rows, lanes, stretches) with position, speed and current, a row for every `every`
    samples. table (lanes, 17): the parameters in the order of `NEUTRAL_VALUES`."""
    h = step / pieces
    lanes = table.shape[0]
    # Apart from its quadratic part, drag depends only on the sign of the speed, so its exponentials are
    # computed once: one for each step would take most of the time.
    rates, keeps = np.empty((2, lanes)), np.empty((5, lanes))
    decays, shares = np.empty((2, lanes))
    for lane in range(lanes):
        p = table[lane]
        rates[0, lane] = max(p[5] * (1.0 + p[8]) / p[3] * h, 1e-12)
        rates[1, lane] = max(p[5] * (1.0 - p[8]) / p[3] * h, 1e-12)
        keeps[0, lane], keeps[1, lane] = math.exp(-rates[0, lane]), math.exp(-rates[1, lane])
        decays[lane] = h * p[0] / max(p[1], 1e-12)
        keeps[2, lane] = math.exp(-decays[lane])
        shares[lane] = (p[13] / step - math.floor(p[13] / step)) * pieces
        part = shares[lane] - math.floor(shares[lane])
        keeps[3, lane], keeps[4, lane] = (
            math.exp(-decays[lane] * part),
            math.exp(-decays[lane] * (1.0 - part)),
        )
    x, w, i, sooner, later = np.empty((5, lanes))
    for column in range(len(first)):
        start = first[column]
        for lane in range(lanes):
            x[lane], w[lane], i[lane] = position[column], speed[column], 0.0
            if start > 0:
                p = table[lane]
                before = effort[start - 1]
                i[lane] = (before - p[2] * w[lane]) / p[0] if electrical else before
        for row in range(out.shape[1]):
            out[0, row, :, column] = x
            out[1, row, :, column] = w
            out[2, row, :, column] = i
            for sample in range(row * every, row * every + every):
                for lane in range(lanes):
                    latency, deadband, dead_below, full = table[lane, 13:]
                    place = min(start + sample, len(effort) - 1) - math.floor(latency / step)
                    after = effort[place] if place >= 0 else 0.0
                    before = effort[place - 1] if place >= 1 else 0.0
                    if deadband > 0.0:
                        stretch = full / max(full - deadband, 1e-9)
                        after = math.copysign(max(abs(after) - deadband, 0.0) * stretch, after)
                        before = math.copysign(max(abs(before) - deadband, 0.0) * stretch, before)
                    if dead_below > 0.0:
                        after *= min(max(5.0 * (abs(after) / dead_below - 0.9), 0.0), 1.0)
                        before *= min(max(5.0 * (abs(before) / dead_below - 0.9), 0.0), 1.0)
                    sooner[lane], later[lane] = before, after
                for piece in range(pieces):
                    # Lanes innermost: the next lane's divisions overlap with the last one's.
                    for lane in range(lanes):
                        p = table[lane]
                        resistance, back_emf, inertia, coulomb, viscous = p[0], p[2], p[3], p[4], p[5]
                        offset, asymmetry, viscous_asymmetry, stiction = p[6], p[7], p[8], p[9]
                        stiction_speed, quadratic, load = p[10], p[11], p[12]
                        v, current, decay = w[lane], i[lane], decays[lane]
                        # The parts of the step before and after the delayed effort changes, both exact.
                        part = min(max(shares[lane] - piece, 0.0), 1.0)
                        mean = 0.0
                        if part > 0.0:
                            settled = (
                                (sooner[lane] - back_emf * v) / resistance if electrical else sooner[lane]
                            )
                            kept = keeps[2, lane] if part == 1.0 else keeps[3, lane]
                            mean += settled * part + (current - settled) * (1.0 - kept) / decay
                            current = settled + (current - settled) * kept
                        if part < 1.0:
                            settled = (later[lane] - back_emf * v) / resistance if electrical else later[lane]
                            kept = keeps[2, lane] if part == 0.0 else keeps[4, lane]
                            mean += settled * (1.0 - part) + (current - settled) * (1.0 - kept) / decay
                            current = settled + (current - settled) * kept
                        force = (back_emf * mean if electrical else mean) - offset
                        side = np.sign(v) if v != 0.0 else np.sign(force)
                        dry = coulomb * (1.0 + asymmetry * side) + load * abs(force)
                        if stiction > 0.0:
                            dry += stiction * math.exp(-((v / stiction_speed) ** 2))
                        if quadratic == 0.0 and side != 0.0:
                            backward = 1 if side < 0.0 else 0
                            rate, kept = rates[backward, lane], keeps[backward, lane]
                        else:
                            drag = viscous * (1.0 + viscous_asymmetry * side) + quadratic * abs(v)
                            rate = max(drag / inertia * h, 1e-12)
                            kept = math.exp(-rate)
                        new = v * kept + (force - side * dry) * h / inertia * (1.0 - kept) / rate
                        if v * new < 0.0 or (v == 0.0 and abs(force) <= dry):
                            new = 0.0
                        x[lane] += 0.5 * h * (v + new)
                        w[lane], i[lane] = new, current
