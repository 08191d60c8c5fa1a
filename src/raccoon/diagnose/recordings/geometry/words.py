"""What is said of a wheel's radius or the track width."""

from __future__ import annotations

import numpy as np

from raccoon.core.config import DriveModel
from raccoon.diagnose.recordings.geometry.fit import Candidate, Errors
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult


def geometry_cause(
    without: Errors, part: Candidate, errors: tuple[Errors, Errors, Errors], rank: int, drive: DriveModel
) -> CauseResult:
    """The cause with its sentence. without: errors where it alone is left out. errors: before, after and the
    floor."""
    before, after, floor = errors
    track = part.id.endswith("track_width")
    number = (drive.track_width if track else drive.wheel_radius).value * part.factor
    value = f"{'track_width' if track else 'wheel_radius'} = {number:.5f} (m)"

    wheels = "both wheels" if part.where is None else f"the {part.where} wheel"
    what = {
        "drive.track_width": "The wheels touch the floor",
        "drive.wheel_radius": f"The radius of {wheels} is",
    }[part.id]
    percent = abs(part.factor - 1.0) * 100.0
    more, less = ("further apart", "closer together") if part.id.endswith("width") else ("larger", "smaller")
    sentence = (
        f"{what} {percent:.2f} % {more if part.factor > 1.0 else less} than configured: put {value} into "
        "robot.toml."
    )
    removable = max(before.position - after.position, 1e-300)
    unit = max(floor.position, 1e-12)
    return CauseResult(
        part.id,
        part.where,
        rank,
        {"factor": ParameterResult(part.factor, part.std, "", 1.0)},
        Gain(
            without.position / unit,
            after.position / unit,
            float(np.clip((without.position - after.position) / removable, 0.0, 1.0)),
        ),
        0.99,
        (),
        sentence,
    )
