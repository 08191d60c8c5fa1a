"""Numbers of robot.toml that a drive bends far and that are named as no cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raccoon.diagnose.findings.deviations import MIN_STDS, deviation_notes, large_deviations
from raccoon.diagnose.fit.problem import Point, Problem
from unit.diagnose.searches import search_at


def bent(problem: Problem, name: str, side: str | None, deviations: float) -> Point:
    """The nominal point but for a number of robot.toml, as many of its deviations off."""
    base = np.zeros(len(problem.base))
    places = [(each.name, each.settings[0][1] if len(each.settings) == 1 else None) for each in problem.base]
    base[places.index((name, side))] = deviations
    return Point(base)


@pytest.mark.parametrize(
    ("name", "side", "id_", "said"),
    [
        ("drive.inertia_straight", None, "drive.inertia", "robot.toml's drive.inertia_straight is 3.2 of"),
        (
            "motor.back_emf_constant.factor",
            "left",
            "motor.back_emf_constant",
            "constant at the left is 3.2 of",
        ),
        ("battery.open_circuit_voltage.voltage", None, "battery.open_circuit_voltage", " V)"),
    ],
)
def test_a_number_far_from_what_robot_toml_says_is_told(
    problem: Problem, name: str, side: str | None, id_: str, said: str
) -> None:
    one = replace(problem, causes={"drive.slope": problem.causes["drive.slope"]})
    search = search_at(one, bent(problem, name, side, -MIN_STDS - 0.2))
    assert [each for each, _ in large_deviations(search)] == [id_]
    (note,) = deviation_notes(search)
    assert said in note
    assert "off (the drive says -" in note  # which way: not robot.toml, the robot has less
    assert deviation_notes(search_at(one, bent(problem, name, side, MIN_STDS - 0.2))) == ()


def test_both_wheels_are_told(problem: Problem) -> None:
    one = replace(problem, causes={"drive.slope": problem.causes["drive.slope"]})
    both = sum(bent(problem, "drive.wheel_radius.factor", side, 3.3).base for side in ("left", "right"))
    left, right = deviation_notes(search_at(one, Point(np.asarray(both))))
    assert "at the left" in left
    assert "at the right" in right


def test_what_no_cause_describes_bends_them_all(problem: Problem) -> None:
    """Seven numbers of one robot were to be measured, each in a sentence, and none of them was wrong."""
    one = replace(problem, causes={"drive.slope": problem.causes["drive.slope"]})
    both = sum(bent(problem, "drive.wheel_radius.factor", side, 3.3).base for side in ("left", "right"))
    (note,) = deviation_notes(search_at(one, Point(np.asarray(both))), unknown=True)
    assert note.startswith("drive.wheel_radius of robot.toml end")
    assert "measure" not in note


def test_what_is_named_is_not_told_again(problem: Problem) -> None:
    one = replace(problem, causes={"drive.inertia": problem.causes["drive.inertia"]})
    point = bent(problem, "drive.inertia_straight", None, 3.3)
    assert deviation_notes(search_at(one, point))
    assert deviation_notes(search_at(one, point.with_cause("drive.inertia", np.array([0.5])))) == ()


def test_habits_of_gears_are_no_number_for_a_team_to_measure(problem: Problem) -> None:
    one = replace(problem, causes={"drive.slope": problem.causes["drive.slope"]})
    assert deviation_notes(search_at(one, bent(problem, "actuation.latency.seconds", None, 3.3))) == ()
