"""Which drives are advised next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from diagnoses import make_cause
from raccoon.diagnose.findings.suggestions import suggest_manoeuvres
from raccoon.diagnose.result import ParameterResult


def suggested(late: float) -> tuple[str, ...]:
    """What is advised after a drive whose gyro, or whose wheels' slip, is so late (s)."""
    cause = make_cause(
        "imu.latency",
        {"seconds": ParameterResult(late, 0.001, "s", 0.0)},
        confounded_with=("drive.wheel_slip",),
    )
    rival, own = SimpleNamespace(name="drive.wheel_slip", together=False), SimpleNamespace(own=None)
    problem = SimpleNamespace(causes={"imu.latency": own, "drive.wheel_slip": own})
    search: Any = SimpleNamespace(rivals={"imu.latency": [rival]}, problem=problem)
    log: Any = SimpleNamespace(channel=lambda _: own)
    return suggest_manoeuvres(search, (cause,), log, {})


def test_no_drive_is_advised_for_what_does_not_matter() -> None:
    """Of a lag of 2 ms the report says to change nothing, and yet it advised the drive just made."""
    assert suggested(0.002) == ()
    assert suggested(0.012)[0].startswith("raccoon excite --cause imu.latency --rival drive.wheel_slip")
