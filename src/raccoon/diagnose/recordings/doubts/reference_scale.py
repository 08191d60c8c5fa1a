"""A reference whose lengths are wrong by a factor, such as a camera's: one fault, which looks like two.

Where its ways are s times as long as the true ones, the wheels seem to be s times as large, and s times as
far apart. A robot.toml whose lengths are all wrong by as much looks the same, and is the rarer of the two.
"""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.diagnose.recordings.doubts.one_fault import ALIKE, LEAST
from raccoon.diagnose.result import Diagnosis

TRACK, RADIUS = "drive.track_width", "drive.wheel_radius"
BY_REFERENCE = "track width by the reference"


def with_reference_scale(found: Diagnosis) -> Diagnosis:
    """A diagnosis that says where a wrong scale of the reference alone would make track and radius."""
    lengths = {each.name: each for each in found.causes if each.name in (TRACK, RADIUS)}
    if len(lengths) < 2 or BY_REFERENCE not in found.identified:
        return found
    track, radius = (lengths[name].parameters["factor"] for name in (TRACK, RADIUS))
    shift = math.log(track.value / track.nominal)
    off = math.log(radius.value / radius.nominal) - shift
    std = math.hypot(track.std / track.value, radius.std / radius.value)
    if abs(shift) < LEAST or abs(off) > ALIKE * std:
        return found
    way = "long" if shift > 0.0 else "short"
    size = f"{100.0 * abs(math.expm1(shift)):.1f} % too {way}"
    said = (
        f"If truth.x and truth.y are {size}, that alone makes {TRACK} and {RADIUS}: measure a way with a "
        "tape first."
    )
    causes = tuple(
        replace(each, explanation=f"{each.explanation} {said}") if each.name in lengths else each
        for each in found.causes
    )
    return replace(found, causes=causes)
