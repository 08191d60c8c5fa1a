"""`raccoon diagnose` with many recordings: which files they are, and under which names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from csv_files import written
from raccoon.cli.diagnose_files import recordings, short_names
from raccoon.cli.main import main
from unit.diagnose.axes import motor


def test_recordings_of_one_name_are_told_apart_by_their_folders(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """red/monday/run.csv was lost behind blue/monday/run.csv, and what the latter had common to all."""
    paths = [tmp_path / robot / "monday" / "run.csv" for robot in ("red", "blue")]
    for seed, path in enumerate(paths):
        path.parent.mkdir(parents=True)
        written(path, motor(5 + seed, 0.008))
    assert main(["diagnose", *map(str, paths), "--json", str(tmp_path / "out.json")]) == 0
    assert set(json.loads((tmp_path / "out.json").read_text())["recordings"]) == {
        "red/monday/run.csv",
        "blue/monday/run.csv",
    }
    assert "red/monday/run.csv: " in capsys.readouterr().out


def test_names_are_as_short_as_they_can_be() -> None:
    assert short_names([Path("a/run1.csv"), Path("b/run2.csv")]) == ["run1.csv", "run2.csv"]
    assert short_names([Path("a/run.csv"), Path("b/run.csv")]) == ["a/run.csv", "b/run.csv"]


def test_a_file_that_is_named_twice_counts_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    one, two, link = (tmp_path / each for each in ("one.csv", "two.csv", "three.csv"))
    one.write_text("")
    two.write_text("")
    link.symlink_to(one)
    with caplog.at_level("INFO", logger="raccoon"):
        assert recordings([one, tmp_path]) == [one, two]
    assert f"{link}: it is named twice, and taken once" in caplog.text
    caplog.clear()
    assert recordings([tmp_path]) == [one, two]
