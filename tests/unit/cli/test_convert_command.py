import argparse
from pathlib import Path

import numpy as np
import pytest

from raccoon.cli import convert
from raccoon.core.errors import ConfigError, TraceError
from raccoon.trace.csv import read_csv
from raccoon.trace.loading import load_run
from unit.trace.recordings import record


def run(*argv: object) -> int:
    parser = argparse.ArgumentParser()
    convert.configure(parser)
    return convert.run(parser.parse_args([str(each) for each in argv]))


def test_a_trace_becomes_csv_and_mcap_with_equal_columns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mcap")
    trace = record(tmp_path / "run")
    assert run(trace, tmp_path / "run.csv") == 0
    assert run(tmp_path / "run.csv", tmp_path / "run.mcap") == 0
    original = load_run(trace).recording
    for path in (tmp_path / "run.csv", tmp_path / "run.mcap"):
        back = load_run(path).recording
        assert back.columns.keys() == original.columns.keys()
        for name, column in original.columns.items():
            np.testing.assert_array_equal(back[name], column, err_msg=name)
    assert f"wrote {tmp_path / 'run.mcap'}: 5 rows of" in capsys.readouterr().out


def test_what_is_left_out_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.csv").write_text("t,x\n0,1\n1,oops\n")
    run(tmp_path / "bad.csv", tmp_path / "good.csv")
    assert "note: line 3, column x: 'oops'" in capsys.readouterr().out
    assert read_csv(tmp_path / "good.csv").problems == []


def test_what_is_left_out_in_many_lines_is_said_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a gyro that is inf now and then it was 90 lines."""
    lines = "".join(f"{row},{'inf' if row % 2 else row}\n" for row in range(40))
    (tmp_path / "bad.csv").write_text(f"t,imu.gyro.z\n{lines}")
    run(tmp_path / "bad.csv", tmp_path / "good.csv")
    (note,) = [each for each in capsys.readouterr().out.splitlines() if each.startswith("note")]
    assert note.startswith("note: line 3, column imu.gyro.z: 'inf'")
    assert note.endswith("so are 19 more")


def test_an_existing_target_is_kept_unless_asked(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t\n0\n")
    (tmp_path / "b.csv").write_text("precious")
    with pytest.raises(ConfigError, match="exists and is left as it is"):
        run(tmp_path / "a.csv", tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == "precious"
    run(tmp_path / "a.csv", tmp_path / "b.csv", "--overwrite")
    assert (tmp_path / "b.csv").read_text() == "t\n0\n"


def test_bad_arguments_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"run\.xls: allowed are the endings \.csv, \.mcap"):
        run(tmp_path / "a.csv", tmp_path / "run.xls")
    with pytest.raises(FileNotFoundError):
        run(tmp_path / "a.csv", tmp_path / "b.csv")
    (tmp_path / "a.csv").write_text("x\n")
    with pytest.raises(TraceError, match="no column t"):
        run(tmp_path / "a.csv", tmp_path / "b.csv")


def test_a_recording_is_not_converted_onto_itself(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,motor.0.duty\n0,percent\n")
    with pytest.raises(ConfigError, match="this command reads it; choose another name"):
        run(path, path, "--overwrite")
    assert path.read_text() == "t,motor.0.duty\n0,percent\n"
