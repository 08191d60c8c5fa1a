"""A forgotten `run` is said with its line, and what is kept for later or never comes to its turn is not."""

import inspect
import logging

import pytest

from raccoon import after_time, deg, do, open_robot, race, repeat, seq, straight, turn, wait
from robots import CONFIG, simulated_port


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raccoon.robot.actions.must_run._checked_places", set())


def test_an_action_that_a_line_makes_and_nothing_does_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    begin = inspect.currentframe().f_lineno  # type: ignore[union-attr]
    for _ in range(3):
        turn(deg(90.0))
    seq(
        straight(0.1),
        turn(deg(5.0)).until(after_time(1.0)),
    )
    said = [each.getMessage() for each in caplog.records]
    assert len(said) == 2
    assert f"test_undone.py, line {begin + 2}: 'turn 90 deg' is created but never run" in said[0]
    assert f"test_undone.py, line {begin + 3}: 'seq(straight 0.1 m, turn 5 deg until" in said[1]


def test_what_is_done_or_kept_or_never_comes_to_its_turn_is_not(caplog: pytest.LogCaptureFixture) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot, caplog.at_level(logging.WARNING):
        kept = {"there": straight(0.02), "back": straight(-0.02)}
        robot.run(kept["there"])
        robot.run(race(wait(0.02), seq(wait(1.0), turn(1.0))))
        robot.run(wait(0.01).timeout_or(1.0, turn(1.0)))
        chosen = {"left": turn(0.1), "right": turn(-0.1)}["left"]
        robot.run({"left": turn(0.1), "right": turn(-0.1)}["left"])
        robot.run(chosen)
        robot.run(
            seq(
                repeat(straight(0.02)).until(after_time(0.02)),
                do(lambda _: wait(0.01)),
            ).then(lambda _: wait(0.01))
        )
        with pytest.raises(RuntimeError, match="at the same time"):
            robot.run(race(straight(0.1), turn(1.0)))
        kept.clear()
    assert not caplog.records
