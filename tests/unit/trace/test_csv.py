import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from raccoon.core.errors import TraceError
from raccoon.trace import csv as trace_csv
from raccoon.trace.columns import recording_of
from raccoon.trace.csv import read_csv, write_csv
from raccoon.trace.file_hints import unnamed
from raccoon.trace.format import Event, read_trace
from raccoon.trace.problems import without_repeats
from raccoon.trace.recording import Recording
from unit.trace.recordings import record

FLOATS = st.floats(allow_infinity=False, width=64)


def write(path: Path, text: str) -> Path:
    path.write_bytes(text.encode())
    return path


@settings(max_examples=40, deadline=None)
@given(values=st.lists(FLOATS, min_size=1, max_size=20))
def test_every_float_comes_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, values: list[float]
) -> None:
    path = tmp_path_factory.mktemp("csv") / "run.csv"
    write_csv(Recording({"t": np.arange(float(len(values))), "depth": np.array(values)}), path)
    back = read_csv(path)["depth"]
    canonical = np.where(np.isnan(values), np.nan, values)  # NaN is blank: its payload is not kept
    assert back.tobytes() == canonical.tobytes()


def test_a_trace_survives_the_trip_with_remarks(tmp_path: Path) -> None:
    recording = recording_of(read_trace(record(tmp_path / "run")))
    recording.events = [Event(1, 'said "go", then\nwent'), Event(3, "a"), Event(3, "b")]
    write_csv(recording, tmp_path / "run.csv")
    back = read_csv(tmp_path / "run.csv")
    assert back.columns.keys() == recording.columns.keys()
    for name, column in recording.columns.items():
        np.testing.assert_array_equal(back[name], column, err_msg=name)
    assert back.events == [Event(1, 'said "go", then\nwent'), Event(3, "a; b")]


def test_columns_stand_in_the_order_of_the_format(tmp_path: Path) -> None:
    names = ("zeta", "truth.x", "analog.10", "analog.2", "imu.gyro.z", "motor.1.bemf", "motor.0.duty")
    columns = {name: np.array([0.0]) for name in (*names, "battery.voltage", "t")}
    write_csv(Recording(columns, [Event(0, "go")]), tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text().splitlines()[0] == (
        "t,motor.0.duty,motor.1.bemf,battery.voltage,imu.gyro.z,analog.2,analog.10,truth.x,zeta,event"
    )


def test_surface_is_black_or_white(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t,truth.surface.0\n0,black\n1,white\n2,\n3,1\n")
    recording = read_csv(path)
    np.testing.assert_array_equal(recording["truth.surface.0"], [1.0, 0.0, math.nan, 1.0])
    write_csv(recording, path)
    assert path.read_text() == "t,truth.surface.0\n0,black\n1,white\n2,\n3,black\n"


def test_foreign_habits_are_understood(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", '\ufefft, depth ,"imu.gyro.z"\r\n0,1e-3, 5 \r\n\r\n0,,+7.5\r\n')
    recording = read_csv(path)
    np.testing.assert_array_equal(recording["depth"], [0.001, math.nan])
    np.testing.assert_array_equal(recording["imu.gyro.z"], [5.0, 7.5])


BAD = [
    ("t,x\n0,abc\n", "line 2, column x: 'abc': allowed are finite numbers and blank"),
    ("t,x\n0,nan\n", "line 2, column x: 'nan'"),
    ("t,x\n0,1e999\n", "line 2, column x: '1e999'"),
    ("t,x\n0,1_000\n", "line 2, column x: '1_000'"),
    ("t,x\n0,1,2\n", "line 2, 3 values where the header names 2 columns"),
    ("t,x\n0\n", "line 2, 1 values where"),
    ("t,x\n1,1\n0.5,1\n", "line 3, column t: '0.5': allowed are numbers that do not go back"),
    ("t,x\n,1\n", "line 2, column t: ''"),
    ("t,x\n0,1\nsoon,1\n", "line 3, column t: 'soon': allowed are finite numbers"),
    ("t\n2026-11-29T09:10:00Z\n", "allowed are finite numbers; it looks like a date or a time of day"),
    ("t\n09:10:00.5\n", "allowed are finite numbers; it looks like a date or a time of day"),
    (
        't,battery.voltage\n0,"6,8"\n',
        "and blank; where commas separate the columns, write a half as",
    ),
    ("t,motor.0.duty\n0,1.5\n", "line 2, column motor.0.duty: '1.5': allowed are numbers from -1 to 1"),
    ("t,digital.3\n0,2\n", "line 2, column digital.3: '2': allowed are 0, 1"),
    ("t,truth.surface.1\n0,grey\n", "line 2, column truth.surface.1: 'grey': allowed are black, white"),
    ('t,event\n0,"never closed\n', "line 2, unexpected end of data"),
]


@pytest.mark.parametrize(("text", "message"), BAD)
def test_a_bad_value_is_refused_with_line_column_and_value(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(TraceError) as caught:
        read_csv(write(tmp_path / "run.csv", text))
    assert message in str(caught.value)


@pytest.mark.parametrize(("text", "message"), BAD)
def test_or_it_is_reported(tmp_path: Path, text: str, message: str) -> None:
    (problem,) = read_csv(write(tmp_path / "run.csv", text), strict=False).problems
    assert message in problem


def test_a_file_whose_rows_go_back_is_not_left_with_one_of_them(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t,x\n3,1\n2,1\n1,1\n")
    with pytest.raises(TraceError, match=r"t goes back in 2 lines of 3; line 3, column t: '2': allowed are"):
        read_csv(path, strict=False)


@pytest.mark.parametrize(
    ("before", "now", "said"),
    [
        (4294.966, 0.003, "wrap around at 4294.967296"),  # micros() in s
        (4294966296.0, 1704.0, "wrap around at 4294967296"),
        (65.531, 0.002, "wrap around at 65.536"),
        (40.0, 0.0, "a second recording"),
        (4294.966, 2000.0, "a second recording"),
        (39.59, 39.58, "rows in order"),  # upside down, shuffled, or of a clock that was set
    ],
)
def test_why_a_time_goes_back_and_on_from_there_is_said(
    tmp_path: Path, before: float, now: float, said: str
) -> None:
    rows = [str(before - 0.001), str(before), *(str(now + 0.001 * row) for row in range(3))]
    path = write(tmp_path / "run.csv", "t\n" + "\n".join(rows) + "\n")
    with pytest.raises(TraceError, match=f"it goes back from .* there: .*{said}"):
        read_csv(path, strict=False)


def test_one_wild_time_costs_its_own_line_and_the_next(tmp_path: Path) -> None:
    """All after it went back, and nothing but what was before it was left."""
    rows = ["0,0", "1,1", "1e9,2,oops", "2,3", "3,4", "4,5"]
    text = "t,x,event\n" + "".join(f"{row}{'' if row.count(',') > 1 else ','}\n" for row in rows)
    found = read_csv(write(tmp_path / "run.csv", text), strict=False)
    assert found["x"].tolist() == [0.0, 1.0, 4.0, 5.0]
    assert found.events == []
    assert "time continues from before the outlier '1e+09', so that line is left out" in found.problems[1]


def test_wild_times_are_said_once(tmp_path: Path) -> None:
    """Of stamps with jitter a report had a note for each."""
    times = (time for each in range(0, 50, 5) for time in (each, each + 1, each + 100, each + 2, each + 3))
    text = "t,x\n" + "".join(f"{time},0\n" for time in times)
    found = read_csv(write(tmp_path / "run.csv", text), strict=False)
    assert len(found["t"]) == 30
    assert len(without_repeats(found.problems)) == 2


def test_of_lines_out_of_order_the_late_ones_are_left_out(tmp_path: Path) -> None:
    text = "t,x\n" + "".join(f"{time},{time}\n" for time in (0, 1, 3, 2, 4, 5))
    assert read_csv(write(tmp_path / "run.csv", text), strict=False)["t"].tolist() == [0, 1, 3, 4, 5]


def test_a_bad_value_is_blank_and_a_bad_row_is_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t,x,y,event\n0,1,2,\n1,oops,3,a\n2,4\n0.5,5,6,b\n3,7,8,c\n")
    recording = read_csv(path, strict=False)
    np.testing.assert_array_equal(recording["t"], [0.0, 1.0, 3.0])
    np.testing.assert_array_equal(recording["x"], [1.0, math.nan, 7.0])
    np.testing.assert_array_equal(recording["y"], [2.0, 3.0, 8.0])
    assert recording.events == [Event(1, "a"), Event(2, "c")]
    assert [problem.split(",")[0] for problem in recording.problems] == ["line 3", "line 4", "line 5"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column t"),
        ("a,b\n1,2\n", "no column t in the header 'a,b'"),
        ("a,time_ms\n1,2\n", "t is the time in s: if 'time_ms' is the time, rename it t"),
        ("T;a\n1;2\n", "t is the time in s: if 'T' is the time, rename it t"),
        ("0,-0.5,1e-3\n", "t is the time in s, and the first line must hold the names of the columns"),
        ("t,x,x\n", "'x' occurs twice"),
        ("t x\n0 1\n", "separated by commas, semicolons or tabs, not by spaces"),
        ("%time,field.x\n0,1\n", "if '%time' is the time, rename it t"),
        ("/clock/sec,x\n0,1\n", "if '/clock/sec' is the time, rename it t"),
        ("t\n" + "x" * (1 << 20), "line is longer"),
        ("t,x\n" + "0,bad\n" * 1002, "more than 1000 bad values; the first: line 2"),
    ],
)
@pytest.mark.parametrize("strict", [True, False])
def test_a_file_that_is_no_recording_is_refused(
    tmp_path: Path, text: str, message: str, strict: bool
) -> None:
    if strict and "bad" in message:
        message = "line 2"
    with pytest.raises(TraceError, match=message):
        read_csv(write(tmp_path / "run.csv", text), strict=strict)


def test_a_first_line_of_excel_says_what_parts_the_columns(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "sep=;\nt;x\n0,5;1\n1,0;oops\n")
    recording = read_csv(path, strict=False)
    np.testing.assert_array_equal(recording["t"], [0.5, 1.0])
    assert recording.problems == ["line 4, column x: 'oops': allowed are finite numbers and blank"]
    with pytest.raises(TraceError, match="line 2: there is no column t in the header 'a,b'"):
        read_csv(write(path, "sep=,\na,b\n"))


@pytest.mark.parametrize(
    "text",
    [
        "# recorded on the table, at noon\n# 3 V\nt,x\n0,1\n2,3\n",
        "% exported\nt;x\n0;1\n2;3\n",
        "# t x\n#t,x\n0,1\n2,3\n",  # as NumPy writes a header
        ",t,x\n0,0,1\n1,2,3\n",  # the numbers of rows, as pandas writes them
        "t,x,\n0,1,\n2,3,\n",
        "t,x\n0,1,\n2,3, \n",
        "t,x\ns,m\n0,1\n2,3\n",
        "t,x\n0,1\nt,x\n2,3\n",
    ],
)
def test_what_other_programs_write_around_numbers_is_understood(tmp_path: Path, text: str) -> None:
    found = read_csv(write(tmp_path / "run.csv", text), strict=False)
    assert {name: each.tolist() for name, each in found.columns.items()} == {"t": [0, 2], "x": [1, 3]}
    assert len(found.problems) <= 1


def test_words_for_nothing_are_blanks_and_said_once_a_column(tmp_path: Path) -> None:
    """MATLAB and pandas write NaN: of a gyro at 50 Hz there were more than 1000 bad values."""
    rows = "".join(f"{row},{'NaN' if row % 4 else row},{'n/a' if row == 7 else 0}\n" for row in range(2000))
    found = read_csv(write(tmp_path / "run.csv", f"t,imu.gyro.z,x\n{rows}"), strict=False)
    assert np.isfinite(found["imu.gyro.z"]).sum() == 500
    assert found.problems == [
        "line 3, column imu.gyro.z: 'NaN' means no value and is read as blank, "
        "and likewise in 1499 more lines",
        "line 9, column x: 'n/a' means no value and is read as blank",
    ]


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("motor_0_duty", "motor.0.duty"),  # as MATLAB makes names of its own
        ("motor[1] bemf", "motor.1.bemf"),
        ("/imu/gyro/z", "imu.gyro.z"),
        ("Battery Voltage [V]", "battery.voltage"),
        ("truth_surface_2", "truth.surface.2"),
        ("servo_3_pulse_us", "servo.3.pulse_us"),
        ("analog5", "analog.5"),
        ("motor.0.bmf", "motor.0.bemf"),
        ("imu.gyr.z", "imu.gyro.z"),
    ],
)
def test_a_name_with_something_else_between_its_parts_is_said(tmp_path: Path, name: str, known: str) -> None:
    (said,) = read_csv(write(tmp_path / "run.csv", f"t,{name}\n0,0\n")).problems
    assert said.endswith(f" should be {known}")


def test_a_name_with_a_unit_or_capital_letters_is_said(tmp_path: Path) -> None:
    names = ["t", "motor.0.duty [-1..1]", "Battery.Voltage", "analog.0", "ANALOG.0", "motor.0.wish", "x (m)"]
    path = write(tmp_path / "run.csv", ",".join(names) + "\n0,0,0,0,0,0,0\n")
    assert read_csv(path).problems == [
        "columns with other names are not used: 'motor.0.duty [-1..1]' should be motor.0.duty, "
        "'Battery.Voltage' should be battery.voltage"
    ]


def test_names_of_somebody_else_are_said_where_a_drive_lacks_a_column() -> None:
    """Not those of the format, nor where nothing is missing."""
    whole = ["t", "event", "motor.0.duty", "motor.0.position", "imu.gyro.z", "battery.voltage", "state"]
    assert unnamed(whole) == ""
    said = unnamed(["gyro" if each == "imu.gyro.z" else each for each in whole])
    assert said.startswith("no column is named imu.gyro.z (")
    assert "among 'gyro', 'state'; " in said
    assert unnamed(["t", "motor.0.duty", "estimate.drive.0"]) == ""  # what is missing is nowhere


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (gzip.compress(b"t,x\n0,1\n", mtime=0), "the file is compressed: unpack it first"),
        (b"PK\x03\x04" + bytes(100), "the file is compressed"),
        ("t,x\n0,1\n".encode("utf-16"), "UTF-16: save it as UTF-8"),
        ("t,motor.0.bemf,motor.1.bemf\n".encode("utf-16-le"), "UTF-16: save it as UTF-8"),
        (b'{"format":"raccoon trace","version":1}\n', "name it .jsonl"),
        ("t,motor.0.bemf,motor.1.bemf\n".encode("utf-16-be"), "UTF-16: save it as UTF-8"),
        (b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\0\x3e\0\x01" + bytes(99), "it is not text"),
        (bytes(range(128, 256)), "it is not text"),
        (b"t\0x\n", "it is not text"),
        (b"time;x\n0,5;1\n", "line 1: there is no column t in the header 'time;x'"),
        (b"t;x\n0,5;1\n1,0;1.234\n", "line 3: '1.234' has another decimal mark than the numbers before"),
    ],
)
def test_what_is_no_csv_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(TraceError) as caught:
        read_csv(path, strict=False)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert str(caught.value).isascii()  # none of the bytes is shown


@pytest.mark.parametrize(
    "text",
    [
        't;imu.gyro.z;truth.surface.0;event\n0,5;-1,5e-3;black;"a; b"\n1,0;;white;\n',
        '"t";"imu.gyro.z";"truth.surface.0";"event"\r\n"0,5";"-1,5E-03";"black";"a; b"\n"1";"";"white";""\n',
        "t\timu.gyro.z\ttruth.surface.0\tevent\n0.5\t-0.0015\tblack\ta; b\n1.0\t\twhite\t\n",
        '\ufefft;imu.gyro.z;truth.surface.0;event\n.5;-.0015;black;"a; b"\n1;;white;\n',
    ],
    ids=["semicolons", "quoted", "tabs", "points"],
)
def test_what_spreadsheets_of_other_countries_write_is_read(tmp_path: Path, text: str) -> None:
    recording = read_csv(write(tmp_path / "run.csv", text))
    np.testing.assert_array_equal(recording["t"], [0.5, 1.0])
    np.testing.assert_array_equal(recording["imu.gyro.z"], [-0.0015, np.nan])
    np.testing.assert_array_equal(recording["truth.surface.0"], [1.0, 0.0])
    assert [(each.tick, each.text) for each in recording.events] == [(0, "a; b")]


def test_a_last_line_without_an_end_may_be_cut_off(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t,x\n0,12\n1,1")
    recording = read_csv(path, strict=False)
    np.testing.assert_array_equal(recording["x"], [12.0])
    assert recording.problems == [
        "line 3, the line has no line break: the file may be cut off there, so the line is left out"
    ]
    np.testing.assert_array_equal(read_csv(path)["x"], [12.0, 1.0])


def test_bytes_that_are_no_text_are_reported(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_bytes(b"t,x\n0,\xff\xfe\n1,\x00\n")
    assert len(read_csv(tmp_path / "run.csv", strict=False).problems) == 2


def test_size_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "run.csv", "t,x\n0,1\n1,2\n2,3\n")
    monkeypatch.setattr(trace_csv, "MAX_CELLS", 4)
    with pytest.raises(TraceError, match="more than 4 values"):
        read_csv(path)
    monkeypatch.setattr(trace_csv, "MAX_BYTES", 10)
    with pytest.raises(TraceError, match="more than 10 bytes"):
        read_csv(path)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t\n0\n")
    with pytest.raises(TraceError, match=r"column x, row 1: inf"):
        write_csv(Recording({"t": np.arange(2.0), "x": np.array([0.0, np.inf])}), path)
    assert [each.name for each in tmp_path.iterdir()] == ["run.csv"]
    assert path.read_text() == "t\n0\n"


def test_a_link_to_a_recording_stays_one(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t\n0\n")
    (tmp_path / "last.csv").symlink_to(path)
    write_csv(Recording({"t": np.arange(2.0)}), tmp_path / "last.csv")
    assert (tmp_path / "last.csv").is_symlink()
    assert path.read_text() == "t\n0\n1\n"


@pytest.mark.parametrize("text", ["10 %\r100 %", "a\r\nb", "a\nb", "\r", 'say "no"\r, twice'])
def test_a_remark_comes_back_with_the_ends_of_its_lines(tmp_path: Path, text: str) -> None:
    """A line of progress that a program noted parted its row in two, and the file was refused."""
    path = tmp_path / "run.csv"
    write_csv(Recording({"t": np.array([0.0, 0.1])}, [Event(0, text)]), path)
    assert read_csv(path).events == [Event(0, text)]


def test_a_remark_may_name_a_file_whose_name_is_no_text(tmp_path: Path) -> None:
    write_csv(Recording({"t": np.arange(2.0)}, [Event(0, "b\udce4d.py")]), tmp_path / "run.csv")
    assert read_csv(tmp_path / "run.csv").events == [Event(0, "b\\udce4d.py")]


@pytest.mark.parametrize(
    ("largest", "said"),
    [
        (100.0, "it looks like percent"),
        (1.5, "it looks like fractions of something smaller"),
        (380.0, "it looks like a Wombat's PWM"),
    ],
)
@pytest.mark.parametrize("lines", [300, 3000])
def test_commands_in_another_unit_are_refused(largest: float, said: str, lines: int, tmp_path: Path) -> None:
    """Those of a short recording were blank, and the robot then not driven; all larger ones were percent."""
    path = tmp_path / "run.csv"
    rows = [f"{0.01 * row},{largest * np.sin(0.05 * row):.4f}" for row in range(lines)]
    path.write_text("\n".join(["t,motor.0.duty", *rows]) + "\n")
    with pytest.raises(TraceError, match=said):
        read_csv(path, strict=False)


def test_a_few_commands_that_are_none_are_blank(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{0.01 * row},{90.0 if row % 100 == 7 else 0.9}" for row in range(600)]
    path.write_text("\n".join(["t,motor.0.duty", *rows]) + "\n")
    recording = read_csv(path, strict=False)
    assert len(recording.problems) == np.isnan(recording["motor.0.duty"]).sum() == 6


def test_a_cell_of_spaces_is_blank(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("t, battery.voltage\n0, 7.1\n0.1, \n")
    recording = read_csv(tmp_path / "run.csv")
    assert recording["battery.voltage"][0] == 7.1
    assert np.isnan(recording["battery.voltage"][1])


def test_words_in_columns_of_others_are_said_once_a_column(tmp_path: Path) -> None:
    rows = "".join(f"{each / 100},{each % 2},idle v1.2,{'7' if each else '-'}\n" for each in range(1500))
    path = write(tmp_path / "run.csv", "t,motor.0.duty,state,loop\n" + rows)
    found = read_csv(path, strict=False)
    assert set(found.columns) == {"t", "motor.0.duty", "loop"}
    assert np.isnan(found["loop"][0])
    assert (found["loop"][1:] == 7.0).all()
    loop, state = found.problems
    assert loop == "line 2, column loop: '-': allowed are finite numbers and blank"
    assert state.startswith(
        "column state holds no numbers in 1500 lines, left out; line 2, column state: 'idle"
    )
    with pytest.raises(TraceError, match=r"column state: 'idle v1\.2'"):
        read_csv(path)


def test_words_of_others_have_no_decimal_mark(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", "t;battery.voltage;state\n0;6,5;v1.2\n0,1;6,6;v1.2\n")
    assert read_csv(path, strict=False)["battery.voltage"].tolist() == [6.5, 6.6]


@pytest.mark.parametrize(
    "spoilt",
    ['0.2,7,"wall" hit', '0.2,7,"wall', "0.2,7," + 140_000 * "x"],
    ids=["closed within a value", "never closed", "too long"],
)
def test_a_quotation_mark_out_of_place_costs_its_own_line(tmp_path: Path, spoilt: str) -> None:
    rows = [f"{0.1 * row:.1f},{row}," for row in range(6)]
    text = "\n".join(["t,depth,event", *rows[:2], spoilt, '0.2,2,"two\nlines"', *rows[3:]]) + "\n"
    path = write(tmp_path / "run.csv", text)
    found = read_csv(path, strict=False)
    assert found["depth"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert found.events == [Event(2, "two\nlines")]
    (problem,) = found.problems
    assert problem.startswith("line 4, ")
    with pytest.raises(TraceError, match="line 4, "):
        read_csv(path)


def test_a_quotation_mark_that_nothing_closes_takes_no_other_line_along(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", 't,depth,event\n0,0,\n0.1,1,"wall\n0.2,2,\n0.3,3,\n')
    found = read_csv(path, strict=False)
    assert found["depth"].tolist() == [0.0, 2.0, 3.0]
    assert found.problems == ["line 3, unexpected end of data: is a quotation mark out of place?"]
