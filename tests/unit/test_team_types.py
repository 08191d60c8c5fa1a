"""What a type checker, and with it an editor, knows of a team's program. mypy reads this file, too."""

from typing import Any, assert_type

from raccoon import Action, MotionResult, mission, parallel, race, seq, servo, straight, turn, wait


def test_the_results_of_motions_are_known() -> None:
    assert_type(seq(straight(0.1), turn(1.0)), Action[list[MotionResult]])
    assert_type(mission(straight(0.1), turn(1.0)), Action[list[MotionResult]])
    assert_type(parallel(straight(0.1)), Action[list[MotionResult]])
    assert_type(race(straight(0.1)), Action[tuple[int, MotionResult]])


def test_the_results_of_others_are_whatever_they_are() -> None:
    assert_type(seq(wait(1.0), straight(0.1)), Action[list[Any]])
    assert_type(mission(wait(1.0), straight(0.1)), Action[list[Any]])
    assert_type(parallel(servo("claw", "open"), straight(0.1)), Action[list[Any]])
    assert_type(race(straight(0.1), wait(1.0)), Action[tuple[int, Any]])


def test_actions_of_a_list_are_put_together() -> None:
    actions: list[Action[object]] = [straight(0.1), wait(1.0), servo("claw", "open")]
    assert_type(seq(*actions), Action[list[Any]])
