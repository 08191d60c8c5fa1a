"""Whether several recordings can be fitted together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from blind.generator import make
from diagnoses import make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.recordings import diagnosis as recordings
from raccoon.diagnose.recordings.drive import Drive, _without_faults_in_others
from raccoon.diagnose.recordings.firmware.identity import FirmwareIdentity
from raccoon.diagnose.recordings.joint_checks import check_joint_recordings
from raccoon.diagnose.result import Diagnosis

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def drive() -> Columns:
    return dict(make(4, seconds=3.0).columns)


def test_a_recording_with_a_sample_written_twice_is_the_same_still(drive: Columns) -> None:
    twice = {name: np.insert(each, 100, each[100]) for name, each in drive.items()}
    with pytest.raises(TraceError, match="recording 2: its samples are those of recording 1"):
        recordings.diagnose_recording(drive, ROBOT, more=[twice])


def test_recordings_that_share_no_column_are_not_the_same(drive: Columns) -> None:
    other = {"t": drive["t"], "motor.2.duty": drive["motor.0.duty"]}
    check_joint_recordings([drive, other], ROBOT)


def test_one_that_is_empty_is_said_by_its_number(drive: Columns) -> None:
    with pytest.raises(TraceError, match=r"^recording 2: the recording is empty"):
        check_joint_recordings([drive, {"t": np.zeros(0)}], ROBOT)


def test_an_uneven_time_of_another_recording_is_said_as_of_the_first(drive: Columns) -> None:
    rows = np.arange(len(drive["t"]))
    late = {**drive, "t": 0.005 * rows + np.random.default_rng(1).uniform(-0.002, 0.002, len(rows))}
    three = Drive(late, ROBOT, FirmwareIdentity(SI_WORDS), holdout=late, more=[late])
    _, said = _without_faults_in_others(three)
    assert [each.partition(": steps")[0] for each in said] == [
        "the other recording: t is uneven",
        "recording 2: t is uneven",
    ]


@pytest.mark.parametrize("which", ["the first", "holdout", "more"])
def test_truth_free_uses_no_reference_of_any_recording(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those beside the first kept theirs."""
    asked: list[Mapping[str, np.ndarray]] = []

    def driven(drive: Drive) -> Diagnosis:
        assert drive.holdout is not None
        asked.extend((drive.columns, drive.holdout, *drive.more))
        return make_diagnosis()

    monkeypatch.setattr(recordings, "diagnose_drive", driven)
    drives = {
        name: dict(make(seed, seconds=3.0).columns)
        for seed, name in enumerate(("the first", "holdout", "more"), start=4)
    }
    bare = [{name for name in each if not name.startswith("truth.")} for each in drives.values()]
    for name, each in drives.items():
        drives[name] = {column: it for column, it in each.items() if column in bare[0] or name == which}
    drives[which]["truth.x"] = drives[which]["t"]
    first, holdout, more = drives.values()
    found = recordings.diagnose_recording(first, ROBOT, holdout=holdout, more=[more], truth_free=True)
    assert [set(each) for each in asked] == bare
    assert recordings.NO_TRUTH not in found.notes
