import os
from pathlib import Path

import numpy as np
import pytest

from raccoon.cli.diagnose.files import recordings
from raccoon.core.errors import TraceError
from raccoon.trace.csv import write_csv
from raccoon.trace.loading import find_recordings, load_run, load_runs
from raccoon.trace.record import recording_file
from raccoon.trace.recording import Recording
from unit.trace.recordings import record

METADATA = "type,diff\nngear,43.7\nencRes,64\nLi,0.2\nDi,0.084,0.084\n"


def test_kind_is_found_by_name_and_first_line(tmp_path: Path) -> None:
    trace = load_run(record(tmp_path / "run"))
    assert trace.trace is not None
    assert len(trace.recording) == 5
    write_csv(trace.recording, tmp_path / "run.csv")
    assert load_run(tmp_path / "run.csv").recording.columns.keys() == trace.recording.columns.keys()
    (tmp_path / "motor_1_x.csv").write_text("time_s,command_percent,velocity_rad_s\n0,1,0\n1,1,0\n2,1,0\n")
    assert "motor.1.speed" in load_run(tmp_path / "motor_1_x.csv").recording


@pytest.mark.parametrize("name", ["run", "run.jsonl", "run.jsonl.gz"])
def test_a_recording_is_found_by_the_name_it_was_made_under(tmp_path: Path, name: str) -> None:
    made = record(tmp_path / "run")
    assert made.name == "run.jsonl.gz"
    assert load_run(tmp_path / name).name == made.name
    assert recordings([tmp_path / name]) == [made]
    with pytest.raises(FileNotFoundError, match="other: there is no such recording"):
        recordings([tmp_path / "other"])


def test_what_is_there_is_read_though_a_packed_recording_has_its_name(tmp_path: Path) -> None:
    record(tmp_path / "run.jsonl")
    (tmp_path / "run").mkdir()
    assert recording_file(tmp_path / "run") == tmp_path / "run"


def test_a_folder_gives_its_runs_in_order_with_their_robot(tmp_path: Path) -> None:
    for session in ("b", "a"):
        (tmp_path / session).mkdir()
        (tmp_path / session / "metadata.csv").write_text(METADATA)
        (tmp_path / session / "LICENSE").write_text("not a recording")
        for run in ("run-02.csv", "run-01.csv"):
            (tmp_path / session / run).write_text("0,0,0,0,0,0\n0.05,0,0,0,1,1\n")
    runs = load_runs(tmp_path)
    assert [run.name for run in runs] == ["a/run-01", "a/run-02", "b/run-01", "b/run-02"]
    assert all(run.robot is not None and run.recording.has_truth for run in runs)


def test_bad_values_of_a_csv_are_reported_with_the_run(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t,x\n0,oops\n")
    assert "'oops'" in load_run(tmp_path / "run.csv").recording.problems[0]


def test_nothing_to_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="no recording in this folder"):
        load_runs(tmp_path)
    with pytest.raises(FileNotFoundError):
        load_runs(tmp_path / "missing.csv")
    (tmp_path / "text.csv").write_text("hello\n")
    with pytest.raises(TraceError, match="no column t"):
        load_runs(tmp_path / "text.csv")


def test_an_mcap_file_is_a_recording(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    from raccoon.trace.mcap import write_mcap

    write_mcap(Recording({"t": np.arange(3.0), "depth": np.arange(3.0)}), tmp_path / "run.mcap")
    assert len(load_run(tmp_path / "run.mcap").recording) == 3


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("README.md", "# My robot, and t\n", "it seems to be a text; recordings are traces"),
        ("program.py", "from raccoon import deg, turn\n", "it seems to be a Python program; recordings are"),
        ("robot.toml", '# name = "robot"\n', "it seems to be a robot.toml, a model or a table; recordings"),
        ("found.json", '{"verdict": "explained"}\n', "it seems to be a result in JSON; recordings are"),
        ("run.json", '{"format": "raccoon trace"}\n', "it looks like JSON Lines, not CSV: name it .jsonl"),
        ("picture.png", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\0\0\0\0\0\0\0\0\0", "it seems to be a picture"),
        ("run.txt", "hello\n", "it seems to be a text that begins with 'hello'; recordings are traces"),
        ("run.csv", "\x89PNG\r\n\x1a\n", "it seems to be a picture; recordings are"),
        ("run.jsonl.gz", "\x89PNG\r\n\x1a\n", "line 1: it seems to be a picture; recordings are"),
        ("run.csv", "hello\n", "line 1: there is no column t in the header 'hello'; t is the time in s"),
        ("a.csv", "run,seed,status,reason,x\n", "it seems to be the table of a sweep; recordings are"),
        ("run.txt", "time,x\n", "line 1: there is no column t in the header 'time,x'; t is the time in s"),
        *((f"run{ending}", "", "the file is empty") for ending in (".csv", ".jsonl.gz", ".mcap", ".mat", "")),
    ],
)
def test_what_a_file_seems_to_be_that_is_no_recording(
    name: str, content: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="latin-1")
    with pytest.raises(TraceError) as caught:
        load_run(path)
    assert str(caught.value).startswith(f"{path}: {said}")


def test_a_pipe_is_read_once_and_no_recording(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", Path("/dev/null")):
        with pytest.raises(TraceError, match=f"{path}: it is a pipe or a device; .*, so name a file"):
            load_run(path)


@pytest.mark.parametrize("name", ["run.txt", "run.md", "run"])
def test_a_csv_may_have_any_name(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("\ufefft\n0\n1\n", encoding="utf-8")
    assert len(load_run(tmp_path / name).recording) == 2


def test_a_folder_is_not_one_recording(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="it is a folder; name a recording in it"):
        load_run(tmp_path)


def test_the_table_of_a_sweep_is_no_recording_of_its_folder(tmp_path: Path) -> None:
    for name in ("run.csv", "matches.csv", "more.parquet.rows.csv"):  # the last while its matches are played
        (tmp_path / name).write_text("t\n0\n1\n")
    for name in ("matches.csv", "more.parquet"):
        (tmp_path / f"{name}.sweep.json").write_text("{}")
    (tmp_path / "old.csv").mkdir()
    assert find_recordings(tmp_path) == [tmp_path / "run.csv"]
    assert [run.name for run in load_runs(tmp_path)] == ["run.csv"]
    assert recordings([tmp_path]) == [tmp_path / "run.csv"]


def test_other_folders_of_a_folder_do_not_matter(tmp_path: Path) -> None:
    for name in ("__pycache__", ".venv", "b", "a10", "a9"):
        (tmp_path / name).mkdir()
        if name != "__pycache__":
            (tmp_path / name / "run.csv").write_text("t\n0\n1\n")
    found = [tmp_path / name / "run.csv" for name in ("a9", "a10", "b")]
    assert find_recordings(tmp_path) == recordings([tmp_path]) == found
    assert len(load_runs(tmp_path)) == 3
    (tmp_path / "link.csv").symlink_to(found[0])
    assert [run.path for run in load_runs(found[1], tmp_path, *found)] == [found[1], found[0], found[2]]
    (tmp_path / "link.csv").rename(tmp_path / "b" / "OLD.CSV")
    assert find_recordings(tmp_path / "b") == [tmp_path / "b" / "OLD.CSV", found[2]]
    assert find_recordings(tmp_path / ".venv") == [tmp_path / ".venv" / "run.csv"]


def test_a_recording_of_which_nothing_can_be_used_says_why(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    header = '{"format": "raccoon trace", "version": 1, "library": "1", "port": "Own", "seed": null}\n'
    path.write_text(header + '{"device": {"name": "own", "bemf_volts": 0.0}}\n')
    with pytest.raises(
        TraceError, match=r"run.jsonl: no row of the recording can be used: line 2.*bemf_volts"
    ):
        load_run(path)
