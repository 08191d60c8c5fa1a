"""The diagnosis of a recording with neither commands nor a reference."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.holdout import missing_phrase
from raccoon.diagnose.result import Diagnosis, Rejected, Unexplained, Verdict

Columns = Mapping[str, NDArray[np.float64]]


def diagnose_without_comparison(columns: Columns, robot: RobotConfig) -> Diagnosis:
    """The diagnosis that nothing is identifiable, with the names of the missing columns."""
    begin = time.perf_counter()
    ports = (robot.drive.left, robot.drive.right)
    missing = [f"motor.{port}.duty" for port in ports if f"motor.{port}.duty" not in columns]
    if "truth.x" not in columns:
        missing.append("truth.x")
    reason = (
        f"not identifiable: {missing_phrase(missing)}: without commands the drive cannot be simulated, and "
        "without a reference there is nothing to compare the wheels with"
    )
    groups = ("battery.*", "motor.*", "friction.*", "drive.*", "actuation.*")
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        (),
        (),
        tuple(Rejected(each, reason) for each in groups),
        Unexplained(0.0),
        ("record with the commands (raccoon's own recordings have them), or with a reference system",),
        time.perf_counter() - begin,
        None,
        (reason,),
    )
