"""A reference, such as a camera, with a wrong length scale: one fault that looks like two causes.

If its distances are s times the true ones, the wheels appear s times as large and s times as far apart. A
robot.toml whose lengths are all wrong by this factor looks the same, but is rarer.
"""

from __future__ import annotations

import math
from dataclasses import replace

from raccoon.diagnose.recordings.plausibility.common_fault import MAX_SIGMAS_APART, MIN_RELATIVE_ERROR
from raccoon.diagnose.result import Diagnosis

TRACK_WIDTH, WHEEL_RADIUS = "drive.track_width", "drive.wheel_radius"
TRACK_BY_REFERENCE = "track width by the reference"


def explain_by_reference_scale(found: Diagnosis) -> Diagnosis:
    """The diagnosis, with a hint if a wrong scale of the reference alone explains track width and radius."""
    lengths = {each.name: each for each in found.causes if each.name in (TRACK_WIDTH, WHEEL_RADIUS)}
    if len(lengths) < 2 or TRACK_BY_REFERENCE not in found.identified:
        return found
    track, radius = (lengths[name].parameters["factor"] for name in (TRACK_WIDTH, WHEEL_RADIUS))
    log_scale = math.log(track.value / track.nominal)
    difference = math.log(radius.value / radius.nominal) - log_scale
    std = math.hypot(track.std / track.value, radius.std / radius.value)
    if abs(log_scale) < MIN_RELATIVE_ERROR or abs(difference) > MAX_SIGMAS_APART * std:
        return found
    direction = "long" if log_scale > 0.0 else "short"
    size = f"{100.0 * abs(math.expm1(log_scale)):.1f} % too {direction}"
    hint = (
        f"If truth.x and truth.y are {size}, that alone explains {TRACK_WIDTH} and {WHEEL_RADIUS}: measure a "
        "distance with a tape first."
    )
    causes = tuple(
        replace(each, explanation=f"{each.explanation} {hint}") if each.name in lengths else each
        for each in found.causes
    )
    return replace(found, causes=causes)
