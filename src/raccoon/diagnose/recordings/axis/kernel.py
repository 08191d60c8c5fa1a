"""The equations of `model`, one sample after the other, for numba. One function, so that numba's cache,
which looks at this file alone, cannot be stale."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def run(
    table: Array, effort: Array, step: float, first: NDArray[np.intp], position: Array, speed: Array,
    every: int, pieces: int, electrical: bool, out: Array,
) -> None:  # fmt: skip
    """Fill out (3, rows, lanes, stretches), a row for every `every` samples. table (lanes, 17): the numbers
    in the order of `NEUTRAL`."""
    h = step / pieces
    for lane in range(table.shape[0]):
        p = table[lane]
        resistance, inductance, back_emf, inertia, coulomb = p[0], p[1], p[2], p[3], p[4]
        viscous, offset, asymmetry, viscous_asymmetry, stiction = p[5], p[6], p[7], p[8], p[9]
        stiction_speed, quadratic, load, latency, deadband = p[10], p[11], p[12], p[13], p[14]
        dead_below, full = p[15], p[16]
        decay = h * resistance / max(inductance, 1e-12)
        kept_current = math.exp(-decay)
        late = latency / step
        whole = math.floor(late)
        share = late - whole
        # Drag is the same for all speeds of a sign but for its quadratic part: an exponential for each piece
        # would take most of the time.
        even = quadratic == 0.0
        rate_forward = max(viscous * (1.0 + viscous_asymmetry) / inertia * h, 1e-12)
        rate_backward = max(viscous * (1.0 - viscous_asymmetry) / inertia * h, 1e-12)
        kept_forward, kept_backward = math.exp(-rate_forward), math.exp(-rate_backward)
        for column in range(len(first)):
            x, w, i = position[column], speed[column], 0.0
            start = first[column]
            if start > 0:
                i = (effort[start - 1] - back_emf * w) / resistance if electrical else effort[start - 1]
            for row in range(out.shape[1]):
                out[0, row, lane, column] = x
                out[1, row, lane, column] = w
                out[2, row, lane, column] = i
                for sample in range(row * every, row * every + every):
                    place = min(start + sample, len(effort) - 1) - int(whole)
                    later = effort[place] if place >= 0 else 0.0
                    sooner = effort[place - 1] if place >= 1 else 0.0
                    if deadband > 0.0:
                        stretch = full / max(full - deadband, 1e-9)
                        later = math.copysign(max(abs(later) - deadband, 0.0) * stretch, later)
                        sooner = math.copysign(max(abs(sooner) - deadband, 0.0) * stretch, sooner)
                    if dead_below > 0.0:
                        later *= min(max(5.0 * (abs(later) / dead_below - 0.9), 0.0), 1.0)
                        sooner *= min(max(5.0 * (abs(sooner) / dead_below - 0.9), 0.0), 1.0)
                    for piece in range(pieces):
                        # The part of the piece before the late effort changes, and its rest, both exact.
                        part = min(max(share * pieces - piece, 0.0), 1.0)
                        mean = 0.0
                        if part > 0.0:
                            settled = (sooner - back_emf * w) / resistance if electrical else sooner
                            kept = kept_current if part == 1.0 else math.exp(-decay * part)
                            mean += settled * part + (i - settled) * (1.0 - kept) / decay
                            i = settled + (i - settled) * kept
                        if part < 1.0:
                            settled = (later - back_emf * w) / resistance if electrical else later
                            kept = kept_current if part == 0.0 else math.exp(-decay * (1.0 - part))
                            mean += settled * (1.0 - part) + (i - settled) * (1.0 - kept) / decay
                            i = settled + (i - settled) * kept
                        force = (back_emf * mean if electrical else mean) - offset
                        side = np.sign(w) if w != 0.0 else np.sign(force)
                        dry = coulomb * (1.0 + asymmetry * side) + load * abs(force)
                        if stiction > 0.0:
                            dry += stiction * math.exp(-((w / stiction_speed) ** 2))
                        if even and side == 1.0:
                            rate, kept = rate_forward, kept_forward
                        elif even and side == -1.0:
                            rate, kept = rate_backward, kept_backward
                        else:
                            drag = viscous * (1.0 + viscous_asymmetry * side) + quadratic * abs(w)
                            rate = max(drag / inertia * h, 1e-12)
                            kept = math.exp(-rate)
                        new = w * kept + (force - side * dry) * h / inertia * (1.0 - kept) / rate
                        if w * new < 0.0 or (w == 0.0 and abs(force) <= dry):
                            new = 0.0
                        x += 0.5 * h * (w + new)
                        w = new
