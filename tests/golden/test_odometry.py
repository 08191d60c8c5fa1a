"""What the odometry said of two drives when its figures were measured: a change must be meant.

RACCOON_GOLDEN=write writes the file anew. Tolerance 1e-6: kernels of linear algebra differ in their last
bits, and nothing here is chaotic.
"""

import json
import os
from pathlib import Path

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.estimate.drive.odometry import Odometry

FILE = Path(__file__).with_name("odometry.json")
DRIVES: dict[str, tuple[list[Segment], Errors]] = {
    "square with real faults": (
        [(1.5, 0.0, 0.0)] + [(2.0, 0.18, 0.0), (1.2, 0.0, 1.4), (0.8, 0.0, 0.0)] * 3,
        Errors(offset_counts=(31.5, -54.9), scale=(1.02, 0.98), gyro_bias=0.003, gyro_drift=1e-6),
    ),
    "slip of the right wheel": (
        [(1.5, 0.0, 0.0), (3.0, 0.18, 0.0), (1.0, 0.0, 0.0)],
        Errors(slip=(2.5, 3.0, "right", 0.5)),
    ),
}


def said(name: str) -> list[list[float]]:
    """Every half second: pose, motion, bias and their deviations."""
    segments, errors = DRIVES[name]
    odometry, rows = Odometry(RobotConfig()), []
    for number, (inputs, command) in enumerate(drive(segments, errors, seed=3)):
        e = odometry.update(inputs, command)
        if number % 100 == 99:
            row = (e.x, e.y, e.heading, e.velocity, e.turn_rate, e.gyro_bias, e.distance)
            rows.append([round(value, 9) for value in (*row, e.x_std, e.y_std, e.heading_std)])
    return rows


@pytest.mark.parametrize("name", DRIVES)
def test_odometry_says_what_it_said(name: str) -> None:
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    for row, before in zip(said(name), kept[name], strict=True):
        assert row == pytest.approx(before, rel=1e-6, abs=1e-8)


if __name__ == "__main__" and os.environ.get("RACCOON_GOLDEN") == "write":
    FILE.write_text(json.dumps({name: said(name) for name in DRIVES}, indent=0) + "\n", encoding="utf-8")
