"""What is said of many recordings: of each kind by its own, of each number what is true."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from blind.generator import make
from blind.tophats import tophat
from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.diagnose.fleet.common_model import common_model
from raccoon.diagnose.fleet.summary import fleet_of
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.reports import html_fleet
from raccoon.diagnose.reports.fleet_text import findings_text, fleet_report, note_lines
from raccoon.diagnose.reports.html_fleet import save_fleet_html
from raccoon.diagnose.result import Diagnosis, ParameterResult, SensorFault, Verdict

ROBOT = RobotConfig()


def of_tophat(seed: int, factor: float = 1.0) -> Diagnosis:
    return diagnose_recording(tophat(seed, factor=factor, seconds=10.0), ROBOT)


@pytest.fixture(scope="module")
def changed() -> dict[str, Diagnosis]:
    """A tophat that reads 10 % less from the fifth recording on."""
    return {f"t{i}.csv": of_tophat(300 + i, 0.9 if i >= 5 else 1.0) for i in range(1, 9)}


@pytest.fixture(scope="module")
def drive() -> Diagnosis:
    return diagnose_recording(make(4, seconds=6.0).columns, ROBOT)


def test_a_tophat_that_changed_is_said_with_when(changed: dict[str, Diagnosis]) -> None:
    fleet = fleet_of(changed)
    ((before, after),) = (each.pieces for each in fleet.causes[0].series.courses)
    assert (before.end, after.start) == pytest.approx((1.0, 0.9), abs=0.003)
    text = fleet_report(fleet)
    assert re.search(r"Gain of a tophat \(port 2\) jumps from 1 to [\d.]+ with t5\.csv", text)
    assert re.search(r"analog\.2 over white in counts jumps from 12[67]\d to 114\d with t5\.csv", text)
    assert "in the order of the recordings above" in text


def test_a_mount_that_came_loose_is_said_with_when() -> None:
    """What is not known of the law of its light is the same in every recording."""
    heights, robot = [0.012] * 4 + [0.015] * 4, parse_robot({"tophat": {"front": {"analog": 2}}})
    found = [
        diagnose_recording(tophat(300 + row, height=height, seconds=10.0), robot)
        for row, height in enumerate(heights)
    ]
    fleet = fleet_of({f"t{row}.csv": each for row, each in enumerate(found)})
    said = fleet_report(fleet)
    assert re.search(
        r"Height of a tophat \(port 2\) in m jumps from 0.012\d* to 0.01[45]\d* with t4.csv "
        r"\(its mount slipped\?\)",
        said,
    )
    common = common_model(fleet)
    assert common is not None
    assert common.value("tophat.height", "height", "2") == pytest.approx(0.0148, abs=0.0005)
    assert common.origins["tophat.height", "2"].std["height"] > 0.0014  # four of them know it no better


def test_a_number_that_jumped_is_not_said_to_be_between(changed: dict[str, Diagnosis]) -> None:
    """1206 +- 94 counts were measured in no recording: 1270 before, 1143 after, a few counts each."""
    fleet = fleet_of(changed)
    white = next(each for each in fleet.numbers if each.name.endswith("white"))
    assert white.series.spread < 6.0
    assert re.search(r"analog\.2 over white +12[67]\d -> 114\d \+- ", fleet_report(fleet))


def test_recordings_speak_of_what_they_are_of(drive: Diagnosis, tmp_path: Path) -> None:
    """A tophat said nothing against a battery, and a drive nothing against a tophat; nor one of two ports."""
    weak = of_tophat(14, 0.9)
    moved = {name.replace("2", "3"): each for name, each in tophat(15, seconds=10.0).items()}
    other = diagnose_recording(moved, ROBOT)
    fleet = fleet_of({"drive": drive, "sound": of_tophat(13), "weak": weak, "port 3": other})
    (gain,) = fleet.causes
    assert (gain.name, gain.share, gain.telling) == ("tophat.gain@2", 0.5, 2)
    assert (
        "Gain of a tophat (port 2) [tophat.gain@2]: 50 % of 2 that can tell (only weak), 0.9"
        in fleet_report(fleet)
    )
    save_fleet_html(fleet, tmp_path / "fleet.html")
    assert '<td class="number">1 of 2</td>' in (tmp_path / "fleet.html").read_text()
    (gain,) = fleet_of({"drive": drive, "weak": weak}).causes
    assert not gain.common  # one of one


def test_a_real_drive_speaks_of_every_cause_of_drives(drive: Diagnosis) -> None:
    hidden = replace(of_tophat(14, 0.9).causes[0], id="imu.gyro_scale", where=None)
    with_cause = replace(drive, causes=(hidden,), verdict=Verdict.EXPLAINED)
    (found,) = fleet_of({"one": drive, "two": with_cause}).causes
    assert (found.share, found.telling) == (0.5, 2)


def test_a_recording_that_cannot_tell_says_why(drive: Diagnosis) -> None:
    columns = make(5, seconds=6.0).columns
    still = {name: 0.0 * each if "duty" in name else each for name, each in columns.items()}
    less = {name: each for name, each in columns.items() if "duty" not in name}
    fleet = {"drive": drive}
    fleet |= {name: diagnose_recording(each, ROBOT) for name, each in (("still", still), ("less", less))}
    fleet["lost"] = replace(
        drive, verdict=Verdict.UNKNOWN, unexplained=replace(drive.unexplained, depends_on=("time",))
    )
    text = fleet_report(fleet_of(fleet))
    assert "drive: adequate: -\n" in text
    assert "still: not identifiable: the commands never change" in text
    assert "less: not identifiable: motor.0.duty, motor.1.duty, truth.x are missing" in text
    assert "lost: unknown: something that depends on time" in text


def test_few_recordings_say_that_no_change_is_looked_for(changed: dict[str, Diagnosis]) -> None:
    few = {name: changed[name] for name in ("t1.csv", "t5.csv", "t6.csv")}
    assert "what changed and when, at least 5 recordings" in fleet_report(fleet_of(few))
    assert "looked for in" not in fleet_report(fleet_of(changed))


def test_a_note_of_many_recordings_is_said_once(drive: Diagnosis) -> None:
    fleet = {f"run{i}": replace(drive, notes=("it is so", f"from {i}.5 s on"), causes=()) for i in range(7)}
    assert note_lines(fleet) == [
        "it is so (all)",
        "from 0.5 s on (run0; with other numbers: run1, run2, run3, run4 and 2 more)",
    ]
    many = {"one": replace(drive, notes=tuple(f"note {chr(97 + i)}" for i in range(12)))}
    assert "and 4 more notes: --json writes all of them" in fleet_report(fleet_of(many))


def test_a_cause_that_does_not_matter_is_told_so_in_the_line_of_its_recording() -> None:
    """ "adequate: a late gyro" read as a contradiction."""
    late = {"seconds": ParameterResult(0.0019, 0.003, "s", 0.0)}
    found = make_diagnosis(
        make_cause("imu.latency", late, "It is late."), make_cause("drive.track_width", said="It is so.")
    )
    assert findings_text(found) == "a late gyro (too small to matter), track width"


def test_the_digits_of_a_name_are_no_number_of_a_note(drive: Diagnosis) -> None:
    """Another channel, port, file or day is another note; only an amount may differ."""

    def of(*notes: str) -> list[str]:
        return note_lines(
            {name: replace(drive, notes=(each,)) for name, each in zip("ab", notes, strict=True)}
        )

    for one, other in (
        ("analog.2 is saturated", "analog.3 is saturated"),
        ("light at tophat 2: shade it", "light at tophat 3: shade it"),
        ("motor 0 turns against its command", "motor 1 turns against its command"),
        ("shorter than 2026-11-24/run 3.csv", "shorter than 2026-11-25/run 3.csv"),
        ("from 2026-11-24 on", "from 2026-11-25 on"),
        ("from run 3.csv on", "from run 4.csv on"),
        ("as week/3/robot.toml says", "as week/4/robot.toml says"),
    ):
        assert of(one, other) == [f"{one} (a)", f"{other} (b)"]
    for one, other in (
        ("motor.0.bemf is -0.016 V off", "motor.0.bemf is 0.2 V off"),
        ("about 3 (0.5 s), or 1e-05", "about 12 (10 s), or 2.5e+06"),
        ("the lag is 2.4 ms: 5.", "the lag is 12 ms: 50."),
    ):
        assert of(one, other) == [f"{one} (a; with other numbers: b)"]


def test_many_recordings_are_not_all_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of sixty with long names the headline alone was three pages."""
    monkeypatch.setattr(html_fleet, "figure_to_base64_png", lambda _: "AAAA")
    sound, faulty = of_tophat(1), of_tophat(2, factor=0.9)
    names = [f"the-afternoon-in-the-gym-with-the-new-battery-run-{row}.csv" for row in range(30)]
    fleet = fleet_of({name: faulty if row % 2 else sound for row, name in enumerate(names)})
    save_fleet_html(fleet, tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert "Gain of a tophat (port 2): 15 of 30 recordings." in page
    said = fleet_report(fleet)
    assert "run-7.csv and 11 more), " in said
    assert max(map(len, said.splitlines())) < 600
    assert max(map(len, page.splitlines())) < 3000


def test_names_of_files_are_no_formulas(tmp_path: Path) -> None:
    """Two $ in a name were a formula of the picture, and an error in it ended the command without a page."""
    names = ("a$^$b.csv", "<b>\u65e5\u672c.csv", "c\udce4.csv")
    save_fleet_html(fleet_of({name: of_tophat(2, factor=0.9) for name in names}), tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text("utf-8")
    assert "a$^$b.csv" in page
    assert "&lt;b&gt;\u65e5\u672c.csv" in page
    assert "<b>" not in page


def test_what_is_wrong_with_a_channel_is_said_beside_its_name_once() -> None:
    faults = (
        SensorFault("motor.0.speed", "filtered", "a filter"),
        SensorFault("motor.1.speed", "stale", "old"),
        SensorFault("motor.0.speed", "repeats", "too fast"),
    )
    assert findings_text(replace(make_diagnosis(), sensor_faults=faults)) == (
        "-; motor.0.speed: filtered, repeats; motor.1.speed: stale"
    )
