from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from csv_files import write_csv_file
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import Verdict
from raccoon.trace.loading import Run, load_runs
from shared_data import data_path

Columns = dict[str, np.ndarray]
ROBOT = parse_robot(
    {
        "motor": {str(port): {"radians_per_tick": {"value": 0.002, "std": 0.0}} for port in (0, 1)},
        "model": {"drive": {"wheel_radius": 0.04, "track_width": 0.2}},
    }
)  # fmt: skip


def driven(
    seed: int, radius: float = 1.0, track: float = 1.0, both_ways: bool = True, heading_noise: float = 1e-6
) -> Columns:
    """A drive of straights and quarter turns at 20 Hz, seen by a reference with 0.5 mm of noise."""
    rng = np.random.default_rng(seed)
    forward, turn = [], []
    for piece in range(8):
        side = -1.0 if both_ways and piece % 2 else 1.0
        forward += [0.2] * 40 + [0.0] * 20
        turn += [0.0] * 40 + [side * math.pi / 2] * 20
    v, w = np.array(forward), np.array(turn)
    time = 0.05 * np.arange(len(v) + 1)
    heading = np.concatenate([[0.0], np.cumsum(0.05 * w)])
    middle = heading[:-1] + 0.025 * w
    x = np.concatenate([[0.0], np.cumsum(0.05 * v * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(0.05 * v * np.sin(middle))])
    columns: Columns = {"t": time}
    for port, side in ((0, -1.0), (1, 1.0)):
        way = np.concatenate([[0.0], np.cumsum(0.05 * (v + side * w * 0.1 * track))])
        columns[f"motor.{port}.position"] = np.round(way / (0.04 * radius * 0.002))
    noise = 5e-4 * rng.standard_normal((3, len(time)))
    return {
        **columns,
        "truth.x": x + noise[0],
        "truth.y": y + noise[1],
        "truth.heading": heading + heading_noise / 5e-4 * noise[2],
    }


def test_radius_and_track_are_found_on_runs_that_were_not_fitted() -> None:
    runs = [driven(seed, radius=0.98, track=1.02) for seed in range(4)]
    found = diagnose_geometry(runs, ROBOT)
    factors = {each.name: each.parameters["factor"].value for each in found.causes}
    assert factors["drive.wheel_radius"] == pytest.approx(0.98, abs=0.002)
    assert factors["drive.track_width"] == pytest.approx(1.02, abs=0.003)
    assert found.channels[0].rmse_after < 0.1 * found.channels[0].rmse_before
    assert found.model is not None
    assert found.model.value("drive.track_width", "factor") == factors["drive.track_width"]
    assert "not identifiable" in next(each.reason for each in found.rejected if each.id == "friction.*")


def test_what_is_to_be_put_into_robot_toml_makes_it_right_there() -> None:
    """Which of its tables is said as well, as of other numbers."""
    runs = [driven(seed, radius=0.98, track=1.02) for seed in range(2)]
    said = " ".join(each.explanation for each in diagnose_geometry(runs, ROBOT).causes)
    lines = re.findall(r"put (\w+) = ([\d.]+) \(m\) into \[model\.drive\] of robot\.toml\.", said)
    assert {name for name, _ in lines} == {"wheel_radius", "track_width"}
    edited = parse_robot({"model": {"drive": {name: float(value) for name, value in lines}}})
    found = diagnose_geometry(runs, replace(ROBOT, model=edited.model))
    assert found.verdict is Verdict.ADEQUATE


@pytest.mark.parametrize("calibrated", [True, False])
def test_a_counter_that_goes_by_k_e_tells_no_wheel_from_its_motor(calibrated: bool) -> None:
    """A wheel whose magnet had lost 6 % was 6 % larger with a probability of 0.99, and robot.toml was to have
    its radius for both."""
    runs = [driven(seed) for seed in range(2)]
    for each in runs:
        each["motor.0.position"] = np.round(0.94 * each["motor.0.position"])
    k_e = BEMF_VOLTS_PER_COUNT / 0.002
    lengths = {"wheel_radius": 0.04, "track_width": 0.2}
    plain = parse_robot({"model": {"drive": lengths, "motor": {"back_emf_constant": k_e}}})
    found = diagnose_geometry(runs, ROBOT if calibrated else plain)
    (cause,) = found.causes
    assert cause.name == "drive.wheel_radius@left"
    assert cause.parameters["factor"].value == pytest.approx(1 / 0.94, abs=0.002)
    text = terminal_report(found)
    if calibrated:
        assert (cause.confounded_with, cause.probability) == ((), 0.99)
        assert "put radians_per_tick = 0.00212" in text
    else:
        assert (cause.confounded_with, cause.probability) == (("motor.back_emf_constant@left",), 0.5)
        assert "calibrate its radians per tick" in text
        assert "measure the wheels with a ruler" in text


@pytest.mark.parametrize("seed", range(0, 6, 2))
def test_a_reference_that_is_sure_of_a_heading_to_some_tenths_of_a_degree_makes_no_wheel(seed: int) -> None:
    runs = [driven(seed + other, heading_noise=0.006) for other in (0, 1)]
    found = diagnose_geometry(runs, ROBOT)
    assert (found.verdict, found.causes) == (Verdict.ADEQUATE, ())
    off = [abs(each.value - each.nominal) / each.std for each in found.identified.values()]
    assert max(off) < 3.0


@pytest.mark.parametrize("count", [1, 2])
def test_wheels_that_creep_a_little_make_no_number_too_sure(count: int) -> None:
    """By 1 % of their way, each half second anew: numbers were off by up to 17 of their deviations."""
    off = []
    for seed in range(4):
        rng, runs = np.random.default_rng(seed), []
        for each in range(count):
            run = driven(10 * seed + each, heading_noise=0.006)
            for port in (0, 1):
                ticks = run[f"motor.{port}.position"]
                creep = 1.0 + 0.01 * np.repeat(rng.standard_normal(len(ticks) // 10 + 1), 10)[: len(ticks)]
                run[f"motor.{port}.position"] = np.cumsum(np.diff(ticks, prepend=ticks[0]) * creep)
            runs.append(run)
        found = diagnose_geometry(runs, ROBOT)
        assert not found.causes
        off += [(each.value - each.nominal) / each.std for each in found.identified.values()]
    assert np.abs(off).max() < 3.5


def test_runs_that_differ_make_the_number_less_sure() -> None:
    alike, other = ([driven(1), driven(2), driven(3, radius=radius)] for radius in (1.0, 1.02))
    stds = [diagnose_geometry(each, ROBOT).identified["wheel_radius@left"].std for each in (alike, other)]
    assert stds[1] > 0.008 * 0.04 > 5.0 * stds[0]


def test_a_reference_that_is_blank_in_most_rows_and_lost_for_a_while_tells_the_same() -> None:
    runs = [driven(seed, radius=1.02, track=0.97) for seed in range(4)]
    whole = diagnose_geometry(runs, ROBOT)
    rows = np.arange(len(runs[0]["t"]))
    blank = (rows % 3 != 1) | ((rows > 200) & (rows < 240))
    sparse = [
        {
            name: np.where(blank, np.nan, each) if name.startswith("truth") else each
            for name, each in run.items()
        }
        for run in runs
    ]
    found = diagnose_geometry(sparse, ROBOT)
    assert found.verdict == whole.verdict == Verdict.EXPLAINED
    assert [each.name for each in found.causes] == [each.name for each in whole.causes]
    for name, each in found.identified.items():
        assert each.value == pytest.approx(whole.identified[name].value, rel=0.002)
    (curve,) = found.curves
    assert len(curve.time) == 2 * int((~blank).sum())
    assert np.isfinite(curve.after).all()
    assert diagnose_geometry(sparse[:1], ROBOT).verdict == Verdict.EXPLAINED


def test_a_robot_as_configured_is_adequate() -> None:
    found = diagnose_geometry([driven(seed) for seed in range(4)], ROBOT)
    assert found.verdict is Verdict.ADEQUATE
    assert found.causes == ()


def test_one_turning_direction_is_refused_with_what_to_drive() -> None:
    found = diagnose_recording(driven(3, track=1.02, both_ways=False), ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert any("one turning direction" in each.reason for each in found.rejected)
    assert found.suggested_manoeuvres


def test_without_commands_and_reference_the_missing_channels_are_named() -> None:
    columns = {name: each for name, each in driven(3).items() if not name.startswith("truth")}
    found = diagnose_recording(columns, RobotConfig())
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "motor.0.duty" in found.rejected[0].reason
    assert "truth.x" in found.rejected[0].reason


def test_truth_free_takes_the_reference_away() -> None:
    assert diagnose_recording(driven(3), ROBOT, truth_free=True).channels == ()


def held(columns: Columns, after: float) -> Columns:
    """The same wheels, but from then on a wall holds the robot for two seconds."""
    time = columns["t"]
    stays = (time[1:] > after) & (time[1:] < after + 2.0)
    moved = {
        name: columns[name][0]
        + np.concatenate([[0.0], np.cumsum(np.where(stays, 0.0, np.diff(columns[name])))])
        for name in ("truth.x", "truth.y")
    }
    return {**columns, **moved}


def test_a_path_that_leaves_its_wheels_is_not_adequate() -> None:
    """33 mm beside 2 of the runs that were fitted was called nothing that matters."""
    columns = held(driven(3), after=21.0)
    found = diagnose_recording(columns, ROBOT)
    assert found.channels[0].rmse_after > 10.0 * found.channels[0].noise_floor
    assert (found.verdict, found.causes) == (Verdict.UNKNOWN, ())
    (note,) = (each for each in found.notes if "deviates from the path of its wheels by" in each)
    assert 20.0 < float(note.split()[1]) < 22.0
    off = [driven(seed, radius=0.98) for seed in range(4)]
    found = diagnose_geometry([*off, off[0], held(off[1], after=15.0)], ROBOT)
    assert found.verdict is Verdict.PARTLY
    assert [each.name for each in found.causes] == ["drive.wheel_radius"]


def test_wheels_of_another_robot_are_a_diagnosis_and_a_question() -> None:
    found = diagnose_geometry([driven(seed, radius=0.45) for seed in range(4)], ROBOT)
    (cause,) = found.causes
    assert cause.parameters["factor"].value == pytest.approx(0.45, abs=0.002)
    assert "drive.wheel_radius is off by -55 %: is this robot.toml of this robot?" in found.notes
    assert found.model is not None
    assert found.model.value("drive.wheel_radius", "factor", "left") == 0.5


def test_runs_are_counted_as_they_are() -> None:
    (note,) = diagnose_recording(driven(3), ROBOT).notes
    assert note == "the first 70 % of the run was fitted, the rest was held out"
    (note,) = diagnose_recording(driven(3), ROBOT, holdout=driven(4)).notes
    assert note == "1 run fitted, 1 other held out"
    (note,) = diagnose_geometry([driven(seed) for seed in range(4)], ROBOT).notes
    assert note == "2 runs fitted, 2 others held out"


def odd(run: Run) -> bool:
    return int(run.name.rpartition("-")[2]) % 2 == 1


def test_real_runs_fitted_on_odd_ones_hold_on_even_ones() -> None:
    runs = load_runs(data_path("optiodom"))
    robot = runs[0].robot
    assert robot is not None
    found = diagnose_geometry(
        [each.recording.columns for each in runs if odd(each)],
        robot,
        holdout=[each.recording.columns for each in runs if not odd(each)],
    )
    assert {each.id for each in found.causes} == {"drive.wheel_radius", "drive.track_width"}
    assert found.channels[0].rmse_after <= 8.1e-3
    assert found.channels[0].rmse_before > 0.02
    one_way = diagnose_recording(runs[0].recording.columns, robot)
    assert one_way.verdict is Verdict.NOT_IDENTIFIABLE


def test_runs_of_two_robots_are_not_pooled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They would have one track width."""
    for place, seed in (("red", 3), ("blue", 4)):
        (tmp_path / place).mkdir()
        write_csv_file(tmp_path / place / f"run{seed}.csv", driven(seed))
    assert main(["diagnose", str(tmp_path)]) == 0
    assert "run3.csv" not in capsys.readouterr().out
    for place in ("red", "blue"):
        (tmp_path / place / "robot.toml").write_text(f'name = "{place}"\n')
    assert main(["diagnose", str(tmp_path)]) == 0
    assert "run3.csv (red): " in capsys.readouterr().out


def session(folder: Path, columns: Columns, gear: float, track: float) -> None:
    """An OptiOdom session of one run, of a robot with 64 counts a revolution of its motor."""
    folder.mkdir()
    (folder / "metadata.csv").write_text(f"type,diff\nngear,{gear}\nencRes,64\nLi,{track}\nDi,0.08,0.08\n")
    ticks = [np.diff(columns[f"motor.{port}.position"], prepend=0.0) for port in (1, 0)]
    poses = [columns[name] for name in ("t", "truth.x", "truth.y", "truth.heading")]
    rows = (",".join(f"{each:.9g}" for each in row) for row in zip(*poses, *ticks, strict=True))
    (folder / "run-01.csv").write_text("\n".join(rows) + "\n")


def test_runs_whose_ticks_are_worth_something_else_are_not_pooled(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those of another gear were read with the first one's. (Another nominal track is a ruler's doing.)"""
    gear, one = 2.0 * math.pi / (0.002 * 64), driven(3)
    session(tmp_path / "one", one, gear, 0.2)
    session(tmp_path / "same", driven(4), gear, 0.205)
    assert main(["diagnose", str(tmp_path)]) == 0
    assert "run-01.csv: " not in capsys.readouterr().out
    other = {name: each * (2.0 if "position" in name else 1.0) for name, each in driven(5).items()}
    session(tmp_path / "geared", other, 2.0 * gear, 0.2)
    assert main(["diagnose", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "geared/run-01.csv: adequate: -" in said


@pytest.mark.parametrize(
    ("columns", "factor"),
    [(("truth.x", "truth.y"), 0.0), (("truth.x", "truth.y"), 10.0), (("motor.0.position",), 1 / 6.2832)],
)
def test_lengths_that_no_robot_has_are_no_cause(columns: tuple[str, ...], factor: float) -> None:
    """They ended at the bounds of what is tried, with a probability of 0.99."""
    run = driven(1)
    strange = {**run, **{name: factor * run[name] for name in columns}}
    found = diagnose_geometry([strange], ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert not found.causes
    assert any("times as large as in robot.toml, or more" in each for each in found.notes)


ROW = 200
"""Of `damaged`."""


def damaged(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Columns:
    """A drive of which one column is not as it was driven."""
    columns = driven(1)
    return {**columns, name: change(columns[name])}


def from_row(by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: values + np.where(np.arange(len(values)) >= ROW, by, 0.0)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("motor.0.position", lambda values: 0.0 * values, "motor.0 never turns although the robot does"),
        ("motor.1.position", lambda values: -values, "motor.1 turns against what the reference says"),
        ("motor.0.position", from_row(-20000.0), "motor.0.position jumps by -"),
        ("motor.0.position", lambda values: 1e290 * values, "motor.0.position reaches"),
        ("truth.y", from_row(0.6), "truth.y jumps by 0.6"),
    ],
)
def test_columns_that_no_robot_drives_are_said_by_name(
    name: str, change: Callable[[np.ndarray], np.ndarray], said: str
) -> None:
    """A wheel without a counter was "told to inf % only", counters of 1e294 were a ValueError."""
    found = diagnose_recording(damaged(name, change), ROBOT)
    assert (found.verdict, found.unexplained.share) == (Verdict.NOT_IDENTIFIABLE, 0.0)
    assert found.rejected[0].reason.startswith(f"not identifiable: {said}")


@pytest.mark.parametrize("name", ["motor.0.position", "truth.x"])
def test_single_wild_values_are_left_out(name: str) -> None:
    """One of 1e300 was a ValueError."""
    wild = damaged(name, lambda values: np.where(np.isin(np.arange(len(values)), (ROW, 300)), 1e300, values))
    found = diagnose_recording(wild, ROBOT)
    assert (found.verdict, found.unexplained.share) == (Verdict.ADEQUATE, 0.0)
    (fault,) = found.sensor_faults
    assert (fault.channel, fault.fault) == (name, "impossible")
    assert "2 impossible values such as 1e+300" in fault.text


@pytest.mark.parametrize("value", [30000.0, 1e300])
def test_a_wild_back_emf_is_left_out_as_well(value: float) -> None:
    """One of 30000 counts made wheels and track of another size."""
    columns = driven(1)
    for port in (0, 1):
        ticks = columns.pop(f"motor.{port}.position")
        columns[f"motor.{port}.bemf"] = np.gradient(ticks, columns["t"])
    columns["motor.0.bemf"][ROW] = value
    found = diagnose_recording(columns, ROBOT)
    assert [(each.channel, each.fault) for each in found.sensor_faults] == [("motor.0.bemf", "impossible")]
    assert np.abs([each.value / each.nominal - 1.0 for each in found.identified.values()]).max() < 0.02


def test_a_run_that_cannot_be_used_does_not_stop_the_pool(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One empty file among twenty left each of the others by itself, one in degrees stopped all without its
    name."""
    for seed in range(4):
        run = driven(seed, radius=0.98)
        if seed == 3:
            run["truth.heading"] = np.degrees(run["truth.heading"])
        write_csv_file(tmp_path / f"run{seed}.csv", run)
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "robot.toml").write_text(
        "[motor.0]\nradians_per_tick = 0.002\n[motor.1]\nradians_per_tick = 0.002\n"
        "[model.drive]\nwheel_radius = 0.04\ntrack_width = 0.2\n"
    )
    assert main(["diagnose", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "2 runs fitted, 1 other held out" in said
    assert "2.00 % smaller" in said
    assert "Note: empty.csv is left out: the file is empty." in said
    assert "Note: run3.csv is left out: truth.heading turns " in said


def test_a_copy_of_a_run_is_left_out_and_judges_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, seed in (("a", 0), ("b", 1), ("c", 0)):
        write_csv_file(tmp_path / f"{name}.csv", driven(seed, track=1.02))
    runs = [str(tmp_path / f"{name}.csv") for name in "abc"]
    (tmp_path / "robot.toml").write_text(ROBOT_TOML)
    assert main(["diagnose", *runs]) == 0
    assert "c.csv is left out: its samples are those of a.csv, and are used once" in capsys.readouterr().out
    assert main(["diagnose", runs[1], runs[2], "--holdout", runs[0]]) == 2
    assert "a.csv: its samples are those of the recording that is diagnosed" in capsys.readouterr().err


ROBOT_TOML = """
[motor.0]
radians_per_tick = { value = 0.002, std = 0.0 }
[motor.1]
radians_per_tick = { value = 0.002, std = 0.0 }
[model.drive]
wheel_radius = 0.04
track_width = 0.2
"""
