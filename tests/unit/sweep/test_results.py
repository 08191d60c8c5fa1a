"""The file of a sweep: what is written is safe, and goes on only where it belongs."""

import builtins
import math
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from raccoon.core.errors import ConfigError
from raccoon.sweep.results import Results, read_results

COLUMNS = ("run", "seed", "status", "reason", "x")
ABOUT = {"program": "p.py", "seed": 3, "end": None}
ENDINGS = ["csv", "parquet"]


def row(run: int, **other: Any) -> dict[str, Any]:
    return {"run": run, "seed": 2**62 + run, "status": "ok", "reason": "", "x": 0.1 * run, **other}


def begun(path: Path, about: dict[str, Any]) -> None:
    """A sweep that was ended after its first match."""
    results = Results(path, COLUMNS, about)
    results.add(row(0))
    results.close()


@pytest.fixture(params=ENDINGS)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == "parquet":
        pytest.importorskip("pyarrow")
    return tmp_path / f"results.{request.param}"


def test_what_is_written_is_read_again_to_the_last_bit(path: Path) -> None:
    """Nor does the order in which the matches end show in the finished file."""
    rows = [row(0, reason='he said "no", twice'), row(1, x=1e-300 / 3), row(2, reason="ä;\n b")]
    files = []
    for order in ((0, 1, 2), (2, 0, 1)):
        path.unlink(missing_ok=True)
        results = Results(path, COLUMNS, ABOUT)
        for run in order:
            results.add(rows[run])
        results.finish()
        results.close()
        files.append(path.read_bytes())
    assert files[0] == files[1]
    found = read_results(path)
    assert [each["run"] for each in found] == [0, 1, 2]
    assert found[:2] == rows[:2]
    assert sorted(each.name for each in path.parent.iterdir()) == [path.name, f"{path.name}.sweep.json"]


def test_nan_stays_nan(path: Path) -> None:
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0, x=math.nan))
    results.finish()
    results.close()
    assert math.isnan(read_results(path)[0]["x"])


def test_a_sweep_that_ended_before_its_first_match_leaves_nothing_in_the_way(path: Path) -> None:
    for about in (ABOUT, {**ABOUT, "program": "corrected.py"}):
        results = Results(path, COLUMNS, about)
        results.close()
        results.close()
        assert list(path.parent.iterdir()) == []


def test_a_sweep_that_was_killed_before_its_first_match_gives_its_name_to_another(path: Path) -> None:
    killed = Results(path, COLUMNS, ABOUT)
    with pytest.raises(ConfigError, match="another sweep is writing it"):
        Results(path, ("run", "seed"), {**ABOUT, "program": "corrected.py"})
    killed._file.close()  # as the system does it
    results = Results(path, (*COLUMNS, "y"), {**ABOUT, "program": "corrected.py"})
    assert results.about["program"] == "corrected.py"
    results.add(row(0, y=1.5))
    results.finish()
    results.close()
    assert read_results(path) == [row(0, y=1.5)]


def test_it_goes_on_where_it_was_left_and_with_more_runs(path: Path) -> None:
    for runs in ((3, 0), (1,), (2, 4)):
        results = Results(path, COLUMNS, ABOUT)
        for run in runs:
            results.add(row(run))
        if runs == (1,):
            results.finish()
        results.close()
    results = Results(path, COLUMNS, ABOUT)
    assert sorted(results.rows) == [0, 1, 2, 3, 4]
    results.finish()
    results.close()
    assert read_results(path) == [row(run) for run in range(5)]


def test_a_table_shows_the_rows_while_they_come(path: Path) -> None:
    """So a program that is killed loses none of them."""
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    results.add(row(1))
    assert read_results(path) == [row(0), row(1)]
    results.close()


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_a_torn_last_line_is_cut_off(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "results.csv"
    results = Results(path, COLUMNS, ABOUT)
    for run in range(3):
        results.add(row(run))
    results.close()
    path.write_bytes(path.read_bytes()[:-cut])
    results = Results(path, COLUMNS, ABOUT)
    assert sorted(results.rows) == [0, 1]
    results.add(row(2))
    results.close()
    assert read_results(path) == [row(run) for run in range(3)]


def test_a_row_that_is_torn_within_a_letter_is_cut_off(tmp_path: Path) -> None:
    """A power cut knows nothing of letters: the table was refused, and with it all matches before."""
    path = tmp_path / "results.csv"
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    results.add(row(1, reason="zu spät"))
    results.close()
    data = path.read_bytes()
    path.write_bytes(data[: data.index("ä".encode()) + 1])
    assert read_results(path) == [row(0)]
    results = Results(path, COLUMNS, ABOUT)
    assert sorted(results.rows) == [0]
    results.close()


def test_no_run_counts_twice(path: Path) -> None:
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    with pytest.raises(ValueError, match="run 0 is in"):
        results.add(row(0))
    results.close()


def test_a_row_that_is_there_twice_or_holds_no_number_is_named(tmp_path: Path) -> None:
    path = tmp_path / "results.csv"
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    results.close()
    text = path.read_text()
    path.write_text(text + text.split("\n")[1] + "\n")
    with pytest.raises(ConfigError, match=r"results\.csv: row 3: run 0 occurs twice"):
        Results(path, COLUMNS, ABOUT)
    path.write_text(text + "1,5,ok,,1.2.3\n")
    with pytest.raises(ConfigError, match=r"results\.csv: row 3: could not convert .*1\.2\.3"):
        Results(path, COLUMNS, ABOUT)


def test_another_sweep_does_not_go_on_in_it(path: Path) -> None:
    begun(path, ABOUT)
    with pytest.raises(ConfigError, match="another seed: 3, and not 4"):
        Results(path, COLUMNS, {**ABOUT, "seed": 4})


def test_the_goal_is_that_of_the_first_time(path: Path) -> None:
    begun(path, {**ABOUT, "end": [1.0, 2.0, 3.0]})
    results = Results(path, COLUMNS, {**ABOUT, "end": [1.0, 2.0, 3.5]})
    assert results.about["end"] == [1.0, 2.0, 3.0]
    results.close()


@pytest.mark.parametrize("ends", [(None, [1.0, 2.0, 3.0]), ([1.0, 2.0, 3.0], None)])
def test_a_sweep_whose_ends_count_does_not_go_on_in_one_whose_ends_do_not(
    path: Path, ends: tuple[list[float] | None, list[float] | None]
) -> None:
    """With --any-end the table went on as it was begun, and where a match ended counted."""
    before, now = ends
    begun(path, {**ABOUT, "end": before})
    counts = "counts" if before else "does not count"
    with pytest.raises(ConfigError, match=f"the end of a match {counts}; choose another file"):
        Results(path, COLUMNS, {**ABOUT, "end": now})


def test_a_file_of_something_else_is_left_alone(path: Path) -> None:
    path.write_text("my notes")
    with pytest.raises(ConfigError, match="is not the result of a sweep"):
        Results(path, COLUMNS, ABOUT)
    assert path.read_text() == "my notes"


def test_a_spreadsheet_may_have_saved_it(tmp_path: Path) -> None:
    path = tmp_path / "results.csv"
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    results.close()
    before = read_results(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_results(path) == before
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(1))
    results.finish()
    results.close()
    assert [each["run"] for each in read_results(path)] == [0, 1]


@pytest.mark.parametrize("damaged", ["results.csv", "results.csv.sweep.json"])
@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"[]", b"{"])
def test_a_damaged_file_is_named(tmp_path: Path, damaged: str, content: bytes) -> None:
    path = tmp_path / "results.csv"
    results = Results(path, COLUMNS, ABOUT)
    results.add(row(0))
    results.close()
    (tmp_path / damaged).write_bytes(content + b"\n")
    with pytest.raises(ConfigError, match=re.escape(damaged)):
        Results(path, COLUMNS, ABOUT)


def test_two_sweeps_do_not_write_one_file(path: Path) -> None:
    first = Results(path, COLUMNS, ABOUT)
    with pytest.raises(ConfigError, match="another sweep is writing it"):
        Results(path, COLUMNS, ABOUT)
    first.close()


def test_other_endings_and_other_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"endings \.csv and \.parquet"):
        Results(tmp_path / "results.xls", COLUMNS, ABOUT)
    begun(tmp_path / "results.csv", ABOUT)
    with pytest.raises(ConfigError, match="its columns are not those"):
        Results(tmp_path / "results.csv", (*COLUMNS, "y"), ABOUT)


def test_a_disk_that_is_full_at_the_end_keeps_nobody_from_going_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    results = Results(tmp_path / "results.parquet", COLUMNS, ABOUT)
    for run in range(6):  # the last one is not in the table yet
        results.add(row(run))
    with monkeypatch.context() as patched:
        patched.setattr("raccoon.sweep.results.write_atomically", full)
        with pytest.raises(OSError, match="No space left"):
            results.close()
    again = Results(tmp_path / "results.parquet", COLUMNS, ABOUT)  # which is locked by nobody
    assert sorted(again.rows) == [0, 1, 2, 3, 4, 5]
    again.close()


def test_without_pyarrow_parquet_alone_is_refused_before_anything_is_played(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = builtins.__import__

    def absent(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.split(".")[0] == "pyarrow":
            raise ImportError(name)
        return found(name, *args, **kwargs)

    for name in [name for name in sys.modules if name.split(".")[0] == "pyarrow"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(ConfigError, match="Parquet needs pyarrow"):
        Results(tmp_path / "results.parquet", COLUMNS, ABOUT)
    assert list(tmp_path.iterdir()) == []
    begun(tmp_path / "results.csv", ABOUT)
