"""Recordings and robots as programs hand them in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, RaccoonError, TraceError
from raccoon.diagnose.recordings import diagnosis as recordings_diagnosis
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.result import Verdict
from raccoon.trace.loading import Run
from raccoon.trace.recording import Recording

TIME = [0.005 * row for row in range(600)]
STILL: dict[str, Any] = {
    "t": TIME,
    **dict.fromkeys(("motor.0.duty", "motor.1.duty", "motor.0.bemf", "motor.1.bemf"), [0] * 600),
}
RECORDING = Recording({name: np.array(each, float) for name, each in STILL.items()})


def test_lists_and_whole_numbers_are_columns() -> None:
    assert diagnose_recording(STILL, RobotConfig()).verdict is Verdict.NOT_IDENTIFIABLE
    words: dict[str, Any] = {**STILL, "mode": ["a"] * 600}
    with pytest.raises(TraceError, match=r"column mode: .*'a'"):
        diagnose_recording(words, RobotConfig())
    with pytest.raises(TraceError, match=r"column mode: .*'a'"):
        Recording(words)


def test_the_seconds_are_those_of_everything_that_was_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five drives together took 229 s: a second search was given up, and the report told the 102 s of the
    first."""
    clock = iter((100.0, 329.0))
    monkeypatch.setattr(recordings_diagnosis, "perf_counter", lambda: next(clock))
    assert diagnose_recording(STILL, RobotConfig()).seconds == 229.0


@pytest.mark.parametrize(
    ("given", "robot", "error", "said"),
    [
        (RECORDING, RobotConfig(), TraceError, "not a Recording: give its columns"),
        (Run("run.csv", RECORDING), RobotConfig(), TraceError, "not a Run: give its recording.columns"),
        (RECORDING.columns, None, ConfigError, "robot is None: it must be a RobotConfig"),
        (RECORDING.columns, "robot.toml", ConfigError, "robot is 'robot.toml': it must be a RobotConfig"),
    ],
)
def test_something_else_is_refused_by_name(
    given: Any, robot: Any, error: type[RaccoonError], said: str
) -> None:
    """It was an AttributeError of something inside; a CSV has no robot, so None comes easily."""
    with pytest.raises(error, match=said):
        diagnose_recording(given, robot)
