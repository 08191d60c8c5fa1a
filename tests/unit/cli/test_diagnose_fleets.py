"""`raccoon diagnose` with many recordings: which files they are, and under which names."""

from __future__ import annotations

import argparse
import json
import re
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from blind.generator import make
from blind.tophats import tophat
from csv_files import write_csv_file
from diagnoses import make_cause, make_diagnosis
from raccoon.cli.diagnose.files import recordings, robot_names, short_names
from raccoon.cli.diagnose.fleet import JobRunner, Progress, _without_duplicates, _without_other_robots
from raccoon.cli.diagnose.job import Answer, Job, diagnose_job, resolve_robot
from raccoon.cli.diagnose.robot_toml_changes import with_robot_toml_notes
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig, load_robot, parse_robot
from raccoon.diagnose.result import Diagnosis, ParameterResult, Unexplained, Verdict
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.columns import trace_of
from raccoon.trace.csv import write_csv
from raccoon.trace.loading import load_run
from raccoon.trace.mcap import write_mcap
from raccoon.trace.record import RecordingPort
from raccoon.trace.recording import Recording
from raccoon.trace.replay import ReplayPort
from unit.diagnose.axes import motor
from unit.trace.recordings import record

NOT_SAID = "the recording does not contain its robot: compared with"


def test_recordings_of_one_name_are_told_apart_by_their_folders(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """red/monday/run.csv was lost behind blue/monday/run.csv, and what the latter had common to all."""
    paths = [tmp_path / robot / "monday" / "run.csv" for robot in ("red", "blue")]
    for seed, path in enumerate(paths):
        path.parent.mkdir(parents=True)
        write_csv_file(path, tophat(5 + seed, factor=0.9, seconds=4.0))
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
    assert f"{link}: it is named twice, and used once" in caplog.text
    caplog.clear()
    assert recordings([tmp_path]) == [one, two]


def test_a_copy_of_a_recording_counts_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also in another form: a folder with run.jsonl.gz and the run.csv that was made of it had two recordings
    with the same cause, which was common therefore."""
    for seed, name in enumerate(("a.csv", "b.csv")):
        write_csv_file(tmp_path / name, tophat(5 + seed, factor=0.9, seconds=4.0))
    copy = tophat(5, factor=0.9, seconds=4.0)
    write_mcap(Recording({name: copy[name] for name in reversed(copy)}), tmp_path / "c.mcap")
    assert main(["diagnose", str(tmp_path), "--json", str(tmp_path / "out.json")]) == 0
    table = json.loads((tmp_path / "out.json").read_text())
    assert list(table["recordings"]) == ["a.csv", "b.csv"]
    assert table["failed"] == {"c.mcap": "its samples are those of a.csv, and are used once"}
    assert "c.mcap: no diagnosis: its samples are those of a.csv" in capsys.readouterr().out


def test_where_files_name_the_robots_the_same_samples_are_of_one() -> None:
    """A fleet's copied file was a robot of its own, which had the same cause. Of two robot.toml, that one
    recording is to be compared with, each has its answer."""
    nothing = Diagnosis(Verdict.ADEQUATE, (), (), (), Unexplained(0.0), (), 0.0, None, ())
    files = {name: Answer(nothing, name, None, "7f", RobotConfig()) for name in ("robot-1", "copy")}
    assert _without_duplicates(files, {name: name for name in files}) == {
        "robot-1": files["robot-1"],
        "copy": "its samples are those of robot-1, and are used once",
    }
    named = {
        name: Answer(nothing, name, Path(name, "robot.toml"), "7f", RobotConfig()) for name in ("red", "blue")
    }
    assert _without_duplicates(named, {name: name for name in named}) == named


@pytest.mark.parametrize(
    ("factors", "of_others"),
    [
        ({"motor.back_emf_constant": 0.67, "drive.track_width": 1.38}, True),
        ({"motor.back_emf_constant": 0.67, "drive.track_width": 1.05}, False),  # other motors
        ({"motor.back_emf_constant@left": 0.67, "motor.back_emf_constant@right": 0.67}, False),
    ],
)
def test_a_recording_of_another_robot_is_left_out_and_said(
    factors: dict[str, float], of_others: bool
) -> None:
    """A battery's ageing was not seen for one in a row of eight. Where half are so, robot.toml is wrong."""

    def answers(other: int) -> dict[str, Answer | str]:
        causes = [
            make_cause(name, {"factor": ParameterResult(value, 0.01, "", 1.0)})
            for name, value in factors.items()
        ]
        found = [make_diagnosis(*(causes if run < other else ())) for run in range(4)]
        return {f"run{n}": Answer(each, "a", None, str(n), RobotConfig()) for n, each in enumerate(found)}

    called = {f"run{run}": "a" for run in range(4)}
    every = answers(1)
    left = _without_other_robots(every, called)
    reason = (
        "it seems to be of another robot than the others (motor.back_emf_constant -33 %, "
        "drive.track_width +38 %): diagnose it with that robot's robot.toml"
    )
    assert left == {**every, "run0": reason if of_others else every["run0"]}
    assert all(isinstance(each, Answer) for each in _without_other_robots(answers(2), called).values())


def test_a_robot_toml_that_was_changed_is_no_motor_that_was_replaced() -> None:
    """A trace has its robot.toml in it: after a calibration K_E jumped to what was assumed."""
    nothing = Diagnosis(Verdict.ADEQUATE, (), (), (), Unexplained(0.0), (), 0.0, None, ("so",))
    later = parse_robot({"model": {"drive": {"track_width": 0.151}}})
    answers = {
        f"run{run}": Answer(nothing, "red", None, str(run), RobotConfig() if run < 2 else later)
        for run in range(4)
    }
    found = with_robot_toml_notes(answers, dict.fromkeys(answers, "red"))
    note, other = found["run0"].diagnosis.notes
    assert note.startswith("robot.toml changed from run2 on (model.drive.track_width)")
    assert other == "so"
    assert found["run3"].diagnosis.notes[0] == note
    apart = {name: "red" if run < 2 else "blue" for run, name in enumerate(answers)}
    assert with_robot_toml_notes(answers, apart) == answers


def test_a_copy_by_another_clock_is_a_copy() -> None:
    own = Recording(tophat(5, factor=0.9, seconds=1.0))
    later = Recording({**own.columns, "t": own.columns["t"] + 100.1})
    assert later.fingerprint() == own.fingerprint()
    other = {name: each.copy() for name, each in own.columns.items()}
    next(each for name, each in other.items() if name.startswith("analog."))[3] += 1.0
    assert Recording(other).fingerprint() != own.fingerprint()


def test_a_trace_and_the_csv_of_it_are_one_recording(tmp_path: Path) -> None:
    """The one has its robot in itself and the other robot.toml beside it, so both counted."""
    robot, traced = tmp_path / "robot.toml", tmp_path / "run.jsonl.gz"
    robot.write_text('name = "drumbot"\n[tophat.left]\nanalog = 2\n')
    columns = tophat(5, factor=0.9, seconds=4.0)
    with closing(
        RecordingPort(ReplayPort(trace_of(Recording(columns))), traced, config=load_robot(robot))
    ) as port:
        for _ in columns["t"]:
            port.read()
    write_csv(load_run(traced).recording, tmp_path / "run.csv")
    assert main(["diagnose", str(tmp_path), "--json", str(tmp_path / "out.json")]) == 0
    table = json.loads((tmp_path / "out.json").read_text())
    assert list(table["recordings"]) == ["run.csv"]
    assert table["failed"] == {"run.jsonl.gz": "its samples are those of run.csv, and are used once"}
    assert table["robots"] == {"drumbot": ["run.csv"]}


def test_each_robot_is_compared_with_the_robot_toml_beside_its_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of them were compared with the default robot, without a word."""
    columns = ("t", "motor.0.duty", "motor.1.duty")
    drive = {name: np.linspace(0.0, 0.04, 9) for name in columns}
    for place in ("red", "blue", "none"):
        (tmp_path / place).mkdir()
        write_csv_file(tmp_path / place / "run.csv", drive)
    for place in ("red", "blue"):
        (tmp_path / place / "robot.toml").write_text(f'name = "{place}"\n')
    monkeypatch.chdir(tmp_path)

    def found(place: str, named: str | None = None) -> tuple[str, str]:
        run = load_run(Path(place, "run.csv"))
        robot, _, notes = resolve_robot(run, None if named is None else Path(named))
        return robot.name, " ".join(notes)

    assert found("red") == ("red", f"{NOT_SAID} the robot.toml beside it (--robot names another)")
    assert found("blue") == ("blue", f"{NOT_SAID} the robot.toml beside it (--robot names another)")
    assert found("none") == (RobotConfig().name, f"{NOT_SAID} the default one (--robot names another)")
    assert found("none", "red/robot.toml") == ("red", "")
    Path("robot.toml").write_text('name = "here"\n')
    assert found("none") == (
        "here",
        f"{NOT_SAID} robot.toml of the current directory (--robot names another)",
    )
    assert found("red")[0] == "red"


def test_a_note_says_which_robot_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_csv_file(tmp_path / "run.csv", tophat(3, seconds=4.0))
    (tmp_path / "robot.toml").write_text("[tophat.left]\nanalog = 2\n")
    assert main(["diagnose", str(path)]) == 0
    assert f"Note: {NOT_SAID} the robot.toml beside it (--robot" in capsys.readouterr().out
    (tmp_path / "robot.toml").write_text("[tophat")
    assert main(["diagnose", str(path)]) == 2
    assert f"{tmp_path / 'robot.toml'}: " in capsys.readouterr().err


def test_a_step_is_compared_with_no_robot(tmp_path: Path) -> None:
    time = 0.01 * np.arange(300.0)
    step = {"t": time, "motor.0.duty": np.full(300, 0.5), "motor.0.bemf": np.minimum(time, 1.0)}
    (tmp_path / "robot.toml").write_text('name = "red"\n')
    assert resolve_robot(load_run(write_csv_file(tmp_path / "run.csv", step)), None)[1:] == (None, ())


def test_a_robot_toml_that_is_none_stops_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [write_csv_file(tmp_path / f"motor-{seed}.csv", motor(seed, 0.008)) for seed in (5, 6)]
    assert main(["diagnose", *map(str, paths), "--robot", str(tmp_path / "none.toml")]) == 2
    assert (
        capsys.readouterr().err == f"raccoon diagnose: {tmp_path / 'none.toml'}: no such file or directory\n"
    )


def test_an_empty_recording_that_comes_first_stops_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text("t,motor.0.duty\n")
    write_csv_file(tmp_path / "run.csv", tophat(5, factor=0.9, seconds=4.0))
    assert main(["diagnose", str(tmp_path)]) == 0
    assert "a.csv: no diagnosis: the recording is empty" in capsys.readouterr().out


def test_a_mistake_that_one_recording_meets_stops_no_other(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def mistaken(job: Job) -> Answer:
        if job.path.name == "a.csv":
            raise np.linalg.LinAlgError("SVD did not converge")
        return diagnose_job(job)

    monkeypatch.setattr("raccoon.cli.diagnose.job.diagnose_job", mistaken)
    for name in ("a.csv", "b.csv"):
        write_csv_file(tmp_path / name, tophat(5, factor=0.9, seconds=4.0))
    assert main(["diagnose", str(tmp_path), "--json", str(tmp_path / "out.json")]) == 0
    assert "a.csv: no diagnosis: LinAlgError: SVD did not converge" in capsys.readouterr().out
    assert json.loads((tmp_path / "out.json").read_text())["recordings"].keys() == {"b.csv"}
    assert "Traceback" in caplog.text


def test_a_robot_is_called_by_its_name_or_by_its_folder(caplog: pytest.LogCaptureFixture) -> None:
    red, blue = Path("red/robot.toml"), Path("blue/robot.toml")
    assert robot_names([("robot", red), ("robot", blue), ("robot", red)]) == ["red", "blue", "red"]
    assert robot_names([("one", red), ("two", None), ("robot", None)]) == ["one", "two", "robot"]
    assert not caplog.text
    with caplog.at_level("INFO", logger="raccoon"):
        assert robot_names([("one", red), ("one", blue)]) == ["one", "one"]
    assert (
        "red/robot.toml and blue/robot.toml: the robots have the same name, one, and are treated as one"
        in caplog.text
    )


def test_robots_are_told_apart_by_their_robot_toml(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two tophats of one port, of which one reads 10 % less, are not one that changed."""
    for place, factor in (("red", 1.0), ("blue", 0.9)):
        (tmp_path / place).mkdir()
        (tmp_path / place / "robot.toml").write_text("[tophat.left]\nanalog = 2\n")
        for day in range(5):
            write_csv_file(tmp_path / place / f"{day}.csv", tophat(70 + day, factor=factor, seconds=6.0))
    assert main(["diagnose", str(tmp_path), "--json", str(tmp_path / "out.json")]) == 0
    said = capsys.readouterr().out
    assert "Gain of a tophat (port 2) [tophat.gain@2]: 50 % (only robot blue), 0.89" in said
    assert "jumps" not in said
    assert set(json.loads((tmp_path / "out.json").read_text())["robots"]) == {"red", "blue"}


def test_one_robot_toml_is_not_that_of_two_robots(capsys: pytest.CaptureFixture[str]) -> None:
    """The last of them was taken for all."""
    with pytest.raises(SystemExit) as error:
        main(["diagnose", "a.csv", "--robot", "red.toml", "--robot", "blue.toml"])
    assert error.value.code == 2
    assert "--robot blue.toml: it is given twice; for several robots, put the recordings" in (
        capsys.readouterr().err
    )


def test_many_recordings_give_the_model_that_they_have_in_common(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, model, table, page = (
        tmp_path / each for each in ("robot.toml", "model.toml", "out.json", "out.html")
    )
    robot.write_text("[tophat.left]\nanalog = 2\n")
    for day, factor in enumerate((0.9, 0.91, 0.9, 1.0)):
        write_csv_file(tmp_path / f"{day}.csv", tophat(70 + day, factor=factor, seconds=6.0))
    results = ["--save-model", str(model), "--json", str(table), "--html", str(page)]
    assert main(["diagnose", str(tmp_path), *results]) == 0
    found = Parameters.from_model_file(model)
    assert found.value("tophat.gain", "factor", "2") == pytest.approx(0.9, abs=0.006)
    assert found.origins[("tophat.gain", "2")].source == "named in 3 of 4 recordings"
    assert found.provenance.recording == "4 recordings, 0.csv to 3.csv"
    foreseen = json.loads(table.read_text())["foreseen"]
    for name in ("0.csv", "1.csv", "2.csv"):
        assert foreseen[name]["after"] < 0.3 * foreseen[name]["before"]
    assert foreseen["0.csv"]["still"] == []
    assert foreseen["3.csv"]["still"] == ["tophat.gain@2"]  # the one that is sound
    assert re.search(r"  0\.csv: [\d.]+ -> [\d.]+ \([\d.]+\): nothing\n", capsys.readouterr().out)
    assert "model of the others" in page.read_text()


@pytest.mark.parametrize("several", [True, False])
def test_a_model_is_of_one_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str], several: bool) -> None:
    for place in ("red", "blue"):
        (tmp_path / place).mkdir()
        if several:
            (tmp_path / place / "robot.toml").write_text("[tophat.left]\nanalog = 2\n")
            write_csv_file(tmp_path / place / "run.csv", tophat(70, factor=0.9, seconds=4.0))
        else:
            write_csv_file(tmp_path / place / "run.csv", motor(5, 0.008))
    model = tmp_path / "model.toml"
    assert main(["diagnose", str(tmp_path), "--save-model", str(model)]) == 0
    why = (
        "the recordings are of 2 robots, blue, red"
        if several
        else "this kind of recording gives no model of a robot"
    )
    assert f"{model}: not written: {why}\n" in capsys.readouterr().out
    assert not model.exists()


def test_what_cannot_be_fitted_together_is_said_with_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = make(1, seconds=3.0).columns
    one = write_csv_file(tmp_path / "one.csv", drive)
    other = write_csv_file(tmp_path / "other.csv", tophat(3, seconds=3.0))
    same = write_csv_file(tmp_path / "same.csv", drive)
    short = write_csv_file(
        tmp_path / "short.csv", {name: each[:60] for name, each in make(2, seconds=3.0).columns.items()}
    )

    def refused(*paths: Path) -> str:
        assert main(["diagnose", "--together", *map(str, paths)]) == 2
        return capsys.readouterr().err.strip().splitlines()[-1]

    begin = "raccoon diagnose: "
    assert refused(one, other) == f"{begin}{other}: it is of tophats; only drives are diagnosed together"
    assert refused(one, same) == f"{begin}{same}: its samples are those of {one}"
    assert refused(one, short).startswith(f"{begin}{short}: the recording has 60 samples over 0.")
    trace = tmp_path / "trace.jsonl.gz"
    record(trace)
    said = f"--together: {one} is of an unnamed controller, {trace} of the controller simulator"
    assert refused(one, trace) == f"{begin}{said}"
    for place in ("red", "blue"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "robot.toml").write_text("")
    two = [write_csv_file(tmp_path / place / "run.csv", drive) for place in ("red", "blue")]
    assert refused(*two) == f"{begin}--together: the recordings are of 2 robots, red, blue"


def test_what_is_done_when_it_is_interrupted_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an hour of twenty recordings Ctrl-C lost nineteen."""
    for number in range(3):
        write_csv_file(tmp_path / f"run{number}.csv", tophat(number, held=True, seconds=4.0))

    def until_the_last(job: Job) -> Answer | str:
        if job.path.name == "run2.csv":
            raise KeyboardInterrupt
        return diagnose_job(job)

    monkeypatch.setattr("raccoon.cli.diagnose.fleet.diagnose_or_reason", until_the_last)
    out = tmp_path / "out.json"
    assert main(["diagnose", str(tmp_path), "--json", str(out)]) == 130
    found = json.loads(out.read_text())
    assert set(found["recordings"]) == {"run0.csv", "run1.csv"}
    assert found["failed"] == {"run2.csv": "interrupted before it was done"}
    assert "run2.csv: no diagnosis: interrupted" in capsys.readouterr().out


@pytest.mark.parametrize("live", [True, False])
def test_how_many_there_are_is_said_before_the_first_is_done(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, live: bool
) -> None:
    """On a controller a terminal said nothing for some minutes."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: live)
    progress = Progress(3)
    progress.show(())
    assert capsys.readouterr().err == ("0/3 recordings\r" if live else "")
    progress.show(["it is empty"])
    assert "1/3 recordings, 1 failed, 0:00 left" in capsys.readouterr().err


def test_what_was_interrupted_is_not_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """With --save-model each recording was diagnosed again after Ctrl-C, to say what the model foresees."""
    asked: list[Job] = []

    def once(job: Job) -> Answer | str:
        asked.append(job)
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.cli.diagnose.fleet.diagnose_or_reason", once)
    work = JobRunner(argparse.Namespace(workers=1, executor="processes"))
    jobs = [Job(Path(name), None, None, None, False) for name in ("run1.csv", "run2.csv")]
    for _ in range(2):
        assert work(jobs) == ["interrupted before it was done"] * 2
    assert asked == jobs[:1]


def test_nothing_is_reported_where_nothing_was_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(2):
        write_csv_file(tmp_path / f"run{number}.csv", tophat(number, held=True, seconds=4.0))

    def interrupted(job: Job) -> Answer | str:
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.cli.diagnose.fleet.diagnose_or_reason", interrupted)
    assert main(["diagnose", str(tmp_path), "--json", str(tmp_path / "out.json")]) == 130
    assert not (tmp_path / "out.json").exists()


def test_a_recording_to_judge_on_of_another_controller_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was read as if of the first one's, without a word, and what its reader left out was not said."""
    one = write_csv_file(tmp_path / "one.csv", make(1, seconds=3.0).columns)
    trace = tmp_path / "trace.jsonl.gz"
    record(trace)
    asked: list[str] = []

    def answer(*_: object, problems: tuple[str, ...], **__: object) -> Diagnosis:
        asked[:] = problems
        return Diagnosis(Verdict.ADEQUATE, (), (), (), Unexplained(0.0), (), 0.0)

    monkeypatch.setattr("raccoon.diagnose.recordings.diagnosis.diagnose_recording", answer)
    for holdout, said in ((trace, True), (one, False)):
        diagnose_job(Job(one, None, None, holdout, truth_free=False))
        told = f"--holdout {holdout}: it is of the controller simulator, but is treated as one of an"
        assert any(each.startswith(told) for each in asked) is said
