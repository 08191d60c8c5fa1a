"""`raccoon compare-mitigations` on a few robots."""

import logging
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from children import default_signals
from raccoon.cli.compare_mitigations.claims import claims
from raccoon.cli.compare_mitigations.measure import (
    MANOEUVRES,
    METHODS,
    Cells,
    End,
    Ends,
    group_by_cell,
    interleaved,
    measure_robot,
)
from raccoon.cli.compare_mitigations.measure import measure_all as measured_robots
from raccoon.cli.compare_mitigations.results import stored, writer
from raccoon.cli.compare_mitigations.robots import (
    BATTERY,
    CONDITIONS,
    DRAWN,
    MATCH,
    PAIRINGS,
    PAPER,
    REPLACED,
    trial,
)
from raccoon.cli.compare_mitigations.table import draw, markdown
from raccoon.cli.compare_mitigations.timed import TimedDrive, TunedTimes, after, leg, quarter_turn, tune
from raccoon.cli.compare_mitigations.vehicles import simulated_vehicle
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError

CONFIG = RobotConfig()
COMPARED = ("voltage scaling, 100 %", "voltage scaling, 80 %", "back-EMF + IMU fusion")


@pytest.fixture(scope="module")
def ends() -> dict[str, Ends]:
    """One robot on another battery, without a mitigation and with three; only without any it drives squares,
    too."""
    squares = measure_robot(BATTERY, 0, 1, ["none"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("raccoon.cli.compare_mitigations.measure.MANOEUVRES", ("1 m", "turn 90"))
        return measure_robot(BATTERY, 0, 1, COMPARED) | squares


def test_on_another_battery_the_paper_s_ranking_comes_out(ends: dict[str, Ends]) -> None:
    cells: Cells = {
        (method, BATTERY, name): [end] for method, its in ends.items() for name, end in its.items()
    }
    metre = {
        method: cells[(method, BATTERY, "1 m")][0].distance for method, _, name in cells if name == "1 m"
    }
    assert metre["none"] > 0.05  # 15 cm become 17.4 cm from 6.1 to 7.0 V; this one's battery is in between
    assert metre["voltage scaling, 100 %"] == pytest.approx(metre["none"], abs=0.002)
    assert metre["voltage scaling, 80 %"] < 0.01
    assert metre["back-EMF + IMU fusion"] < 0.003
    held = {claim.text: claim.held for claim in claims(cells)}
    assert held["Scaling works at 80 %"] is True
    assert held["Static k is lost when a motor is replaced"] is None


def test_every_mitigation_meets_the_same_robots() -> None:
    for condition in CONDITIONS:
        one, again, other = (trial(condition, number, 3, CONFIG) for number in (0, 0, 1))
        assert one == again
        assert one.seed != other.seed


def test_a_robot_s_drawn_motors_are_the_same_in_every_column() -> None:
    def left_motor(condition: str) -> float:
        return trial(condition, 12, 3, CONFIG).run.value("motor.back_emf_constant", "factor", "left")

    assert left_motor(DRAWN) == left_motor(MATCH) == left_motor(REPLACED)
    assert left_motor(DRAWN) != left_motor(PAPER)


def test_the_paper_s_pairings_all_come() -> None:
    def motors(number: int) -> tuple[float, float]:
        run = trial(PAPER, number, 3, CONFIG).run
        return tuple(run.value("motor.back_emf_constant", "factor", side) for side in ("left", "right"))  # type: ignore[return-value]

    assert len({motors(number) for number in range(9)}) == len(PAIRINGS) == 9
    assert CONDITIONS[PAPER].robots % 9 == 0
    assert CONDITIONS[DRAWN].robots == 200
    assert CONDITIONS[MATCH].robots == 9 + 50


def test_the_batteries_cover_the_whole_range_evenly() -> None:
    voltages = sorted(
        trial(BATTERY, number, 3, CONFIG).run.value("battery.open_circuit_voltage", "voltage")
        for number in range(20)
    )
    assert voltages[0] < 6.16
    assert voltages[-1] > 6.94
    assert max(b - a for a, b in pairwise(voltages)) < 0.09


def test_a_blind_program_ends_where_it_does_tick_by_tick() -> None:
    each, way = trial(MATCH, 3, 1, CONFIG), TimedDrive()
    ends = []
    for blind in (True, False):
        robot = simulated_vehicle(each.run, CONFIG, 5, blind=blind)
        robot.stand(0.2)
        leg(robot, way, 1.0, 1.0, after(1.7), None)
        quarter_turn(robot, way, TunedTimes(0.0, 0.0, 0.83))
        ends.append((robot.truth.x, robot.truth.y, robot.truth.heading, robot.time))
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_times_are_tuned_by_the_tape_that_calibrates() -> None:
    each = trial(DRAWN, 0, 1, CONFIG)
    true = tune(TimedDrive(), each.tuned, CONFIG, (0.0, 0.0))
    read = tune(TimedDrive(), each.tuned, CONFIG, (0.002, 0.002))
    assert (read.run_up + read.metre) / (true.run_up + true.metre) == pytest.approx(0.998, abs=5e-4)


def test_what_is_left_of_a_metre_is_the_tape(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raccoon.cli.compare_mitigations.measure.MANOEUVRES", ("1 m",))
    ends = measure_robot(DRAWN, 1, 1, ["back-EMF + IMU fusion"], tape_std=0.0)
    assert ends["back-EMF + IMU fusion"]["1 m"].distance < 0.0005


def test_tables_and_picture(ends: dict[str, Ends], tmp_path: Path) -> None:
    cells = {(method, BATTERY, name): [end] for method in METHODS for name, end in ends["none"].items()}
    text = markdown(cells, {BATTERY: 1})
    assert all(f"## {name}" in text for name in MANOEUVRES)
    assert all(f"| {method} |" in text for method in METHODS)
    draw(cells, (BATTERY,), tmp_path / "table.svg")
    assert (tmp_path / "table.svg").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--condition", "moonlight"], "allowed are battery 6.1-7.0 V, battery sags"),
        (["--robots", "0"], "--robots 0: allowed are whole numbers from 1"),
        (["--robots", "5", "--quick"], "--robots 5: --quick means 2; leave one of them out"),
        (["--workers", "-1"], "--workers -1: allowed are whole numbers from 0"),
        (["--plot", "map.bmp"], "--plot map.bmp: allowed are the endings .svg, .png, .pdf"),
        (["--tape", "1"], "--tape 1: allowed are numbers from 0 to 0.1 (m)"),
    ],
)
def test_what_is_not_allowed_is_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare-mitigations", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_the_command_prints_and_writes_one_column(
    ends: dict[str, Ends],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def known(condition: str, number: int, seed: int, tape_std: float) -> dict[str, Ends]:
        assert (condition, number) == (BATTERY, 0)
        logging.getLogger("raccoon").warning(
            "was a motor changed?"
        )  # of a simulated robot: nobody's business
        return {method: ends["none"] | ends.get(method, {}) for method in METHODS}

    monkeypatch.setattr("raccoon.cli.compare_mitigations.measure.measure_robot", known)
    out = tmp_path / "table.md"
    column = ["--condition", BATTERY, "--robots", "1", "--markdown", str(out)]
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert main(["compare-mitigations", *column]) == 0
    assert "Robots a column: battery 6.1-7.0 V 1." in out.read_text("utf-8")
    told = capsys.readouterr()
    assert "| fresh battery |" in told.out
    assert "1 robots driven, of 1 in the table" in told.err
    assert caplog.text == ""


def test_work_that_was_stopped_goes_on_where_it_was(tmp_path: Path) -> None:
    file, robots = tmp_path / "results.jsonl", {BATTERY: 2, DRAWN: 1}
    ends = {"none": {"1 m": End(0.001, 0.002, 0.003, 5.0)}}
    add = writer(file, 1, 0.001)
    for number in range(2):
        add((BATTERY, number), ends)
    with file.open("a") as unfinished:
        unfinished.write('{"condition": "cut o')
    add((DRAWN, 0), ends)
    known = stored(file, 1, 0.001)
    assert (
        measured_robots(robots, 1, 1, known=known)
        == known
        == {
            (BATTERY, 0): ends,
            (BATTERY, 1): ends,
            (DRAWN, 0): ends,
        }
    )
    assert len(group_by_cell(known)["none", BATTERY, "1 m"]) == 2
    with pytest.raises(ConfigError, match=r"has results of --seed 1 --tape 0\.001"):
        stored(file, 2, 0.001)


@pytest.mark.parametrize("content", [b"\xff\n", b"3\n", b'{"seed": 1}\n', b"from raccoon import turn\n"])
def test_a_file_of_something_else_is_no_file_of_results(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "results.jsonl"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"results\.jsonl: not a file of results"):
        stored(file, 1, 0.001)


def test_a_part_of_the_work_is_a_part_of_every_column() -> None:
    order = interleaved({"a": 4, "b": 2})
    assert order == [("a", 0), ("b", 0), ("a", 1), ("a", 2), ("b", 1), ("a", 3)]


INTERRUPTED = """
import time

from raccoon.cli.compare_mitigations import measure


def measured(*_, **__):
    time.sleep(0.1)
    return {}


# In every process, each of which reads this.
measure.measure_robot = measured

if __name__ == "__main__":
    measure.measure_all(
        {"battery 6.1-7.0 V": 2400}, 1, 2, done=lambda _robot, _ends: print("one", flush=True)
    )
"""


def test_no_process_outlives_one_that_is_interrupted(tmp_path: Path) -> None:
    (tmp_path / "table.py").write_text(INTERRUPTED)
    with default_signals(signal.SIGINT):
        command = [sys.executable, str(tmp_path / "table.py")]
        table = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert table.stdout is not None
    assert table.stdout.readline() == "one\n"
    table.send_signal(signal.SIGINT)
    table.communicate(timeout=30)  # the output ends when the last process has ended that holds it
