"""The demo's claims, on a few of its robots (the command runs them all)."""

import math
from pathlib import Path

import pytest

from raccoon.cli.demo.mission import DISTANCE, goal
from raccoon.cli.demo.robots import Trial, closed_loop, measure_claims, measure_times, open_loop
from raccoon.cli.demo.tophats import tophat_results
from raccoon.cli.main import main
from raccoon.model.paper import battery_speed_ratio, extreme_motor_speeds
from unit.trace.recordings import record


def test_the_simulator_shows_what_the_paper_claims() -> None:
    claims = measure_claims(seed=7)
    assert 100 * claims.battery == pytest.approx(100 * (battery_speed_ratio() - 1), abs=0.1)  # 15.9 %
    fast, slow = extreme_motor_speeds()
    assert 100 * claims.motors == pytest.approx(100 * (fast / slow - 1), abs=0.1)  # 4.2 %


def test_driving_by_time_works_only_where_it_was_tuned() -> None:
    times = measure_times(seed=7)
    tuned = open_loop(Trial(6.1, 1, 1, seed=8), times)
    assert tuned.end < 0.02 * DISTANCE
    assert open_loop(Trial(7.0, 1, 1, seed=9), times).end > 0.04 * DISTANCE  # turns overshoot, too
    assert abs(math.degrees(open_loop(Trial(6.1, 0, 2, seed=10), times).heading)) > 5.0


def test_the_library_keeps_its_promise_on_unequal_motors() -> None:
    outcome = closed_loop(Trial(7.0, 0, 2, seed=11))
    assert outcome.end < 0.01 * DISTANCE
    assert abs(math.degrees(outcome.heading)) < 1.0


def test_all_eight_light_conditions_are_calibrated() -> None:
    for result in tophat_results(seed=5):
        assert result.calibration.threshold is not None, result.condition
        assert result.wrong <= 0.01, result.condition


def test_a_file_is_no_folder_for_its_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("")
    assert main(["demo", "--out", str(file)]) == 2
    assert capsys.readouterr().err == f"raccoon demo: --out {file}: it is a file; name a folder\n"


def test_a_recording_of_others_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    match = record(tmp_path / "mission")
    before = match.read_bytes()
    assert main(["demo", "--out", str(tmp_path)]) == 2
    said = f"raccoon demo: {match}: it already exists and is not a recording of a demo; name another --out\n"
    assert capsys.readouterr().err == said
    assert match.read_bytes() == before


def test_the_goal_of_the_mission() -> None:
    end = goal()
    assert (end.x, end.y, end.heading) == pytest.approx((1.0, 0.4, 0.0))
