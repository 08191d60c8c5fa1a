"""`raccoon simulate`: a program for the robot runs on the simulated one as it is."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from raccoon.cli.main import main
from raccoon.trace.loading import load_run

OPENS = """
from raccoon import open_robot, straight
from strategy import far

if __name__ == "__main__":
    with open_robot("robot.toml") as robot:
        robot.run(straight(far))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A team's folder on another computer than the robot's, for whose Wombat its robot.toml is."""
    monkeypatch.chdir(tmp_path)
    team = tmp_path / "team"
    team.mkdir()
    (team / "robot.toml").write_text('[controller]\nport = "wombat"\n')
    (team / "strategy.py").write_text("far = 0.05\n")
    monkeypatch.delitem(sys.modules, "strategy", raising=False)
    return team


def test_it_runs_on_the_simulated_robot_and_says_where_that_is(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = folder / "match.py"
    program.write_text(OPENS)
    table = folder / "table.toml"
    table.write_text("area = { low = [0, 0], high = [4, 4] }\n")
    path, argv = list(sys.path), list(sys.argv)
    where = ["--table", str(table), "--start", "2", "1", "90", "--seed", "3", "--record", "run"]
    assert main(["simulate", str(program), *where]) == 0
    assert (sys.path, sys.argv) == (path, argv)
    (said,) = capsys.readouterr().out.splitlines()
    place = r"x 0.0(5\d|49) m, y -?0.00\d m, heading -?\d.\d deg"
    assert re.fullmatch(rf"simulated \d.\d\d s: it is at {place}; it believes {place}", said), said
    trace = load_run(Path("run.jsonl.gz")).recording
    assert trace.columns["truth.x"][-1] == pytest.approx(2.0, abs=0.01)
    assert trace.columns["truth.y"][-1] == pytest.approx(1.05, abs=0.01)


def test_a_mission_without_a_robot_of_its_own_gets_one(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = folder / "mission.py"
    program.write_text(
        "import pickle\nfrom raccoon import straight\nclass Far(float):\n    unit: str\n"
        "assert Far.__annotations__ == {'unit': str}\n"
        "def mission(robot):\n"
        "    return straight(pickle.loads(pickle.dumps(Far(0.02))))\n"
    )
    (folder / "robot.toml").rename("robot.toml")
    before = sys.modules["__main__"]
    assert main(["simulate", str(program)]) == 0
    assert "it is at x 0.02" in capsys.readouterr().out
    assert sys.modules["__main__"] is before


@pytest.mark.parametrize(
    ("text", "status", "said"),
    [
        ("import strategy\n", 1, r"opened no robot, and has no mission\(robot\)"),
        (
            "from raccoon import mission\ndef main(): ...\n",
            1,
            r"has no mission\(robot\); it defines main\(\), but does not call it\n$",
        ),
        ("1 +\n", 1, "SyntaxError"),
        (
            OPENS + "        1 / 0\n",
            1,
            r'File ".*match.py", line 8, in <module>\n.*\n(.*\^.*\n)?ZeroDivision',
        ),
        (
            OPENS + "        robot.run(straight(500))\n",
            1,
            r"line 8, in <module>\n.*\n(.*\^.*\n)?ValueError: distance is 500: .*\n\(lines of .*--traceback",
        ),
        (OPENS + "        straght(1)\n", 1, "NameError: .* Did you mean: 'straight'"),
        (OPENS + "        turn(1)\n", 1, "NameError: .*\nIt takes: from raccoon import turn\n"),
        (
            OPENS + "        straight(1, sped=2)\n",
            1,
            r"straight\(\) takes .* \(did you mean speed\?\)",
        ),
        (OPENS + "        raise SystemExit(7)\n", 7, ""),
    ],
)
def test_what_is_wrong_with_a_program_is_the_programs(
    folder: Path, text: str, status: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The motors are off, and a traceback begins in the program."""
    program = folder / "match.py"
    program.write_text(text)
    if status == 7:
        with pytest.raises(SystemExit, match="7"):
            main(["simulate", str(program)])
    else:
        assert main(["simulate", str(program)]) == status
    captured = capsys.readouterr()
    assert re.search(said, captured.err), captured.err
    assert "src/raccoon" not in captured.err
    assert ("it is at x 0.05" in captured.out) is (OPENS in text)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["matsch.py"], "matsch.py: there is no such program (did you mean match.py?)"),
        (["robot.toml"], "a program is a Python file"),
        (["match.py", "--seed", "-1"], "--seed -1: allowed are whole numbers from 0"),
        (["match.py", "--start", "nan", "0", "0"], "--start nan 0 0: allowed are"),
        (
            ["match.py", "--start", "9", "0", "0"],
            "simulate: start is x 9 m, y 0 m, 0 deg: it is off the table",
        ),
        (["match.py", "--start", "2", "0", "0"], "in a wall or an object of the table botball"),
        (["match.py", "--table", "none.toml"], "none.toml: no such file"),
        (["match.py", "--model", "none.toml"], "none.toml: no such file"),
    ],
)
def test_bad_words_are_named(
    folder: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("match.py").write_text(OPENS)
    (folder / "robot.toml").rename("robot.toml")
    (folder / "strategy.py").rename("strategy.py")
    assert main(["simulate", *words]) == 2
    assert said in capsys.readouterr().err
