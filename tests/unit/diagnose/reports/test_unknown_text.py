"""What no cause describes: its size, and where a team is told to look."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.fit.linear_model import linearise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.reports.unknown_text import covariate_text, question_about, shape_text, waves_per_turn
from raccoon.diagnose.result import Shape
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX


def _shape(depends_on: str, curve: str) -> Shape:
    over = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    values = {"five": np.sin(5.0 * over), "one": np.sin(over), "rub": 1.0 * (np.cos(over) > 0.5)}[curve]
    return Shape(depends_on, "torque forward", "N m", over, "rad", 0.03 * values, np.full(48, 0.002))


@pytest.mark.parametrize(("curve", "times"), [("five", 5), ("one", 0), ("rub", 0)])
def test_what_comes_several_times_in_a_turn_is_counted(curve: str, times: int) -> None:
    assert waves_per_turn(_shape("wheel angle left", curve)) == times
    assert waves_per_turn(_shape("heading", curve)) == 0


def test_a_motor_that_cogs_is_said_with_how_often_and_where_to_look() -> None:
    said = shape_text(_shape("wheel angle right", "five"))
    assert said.startswith(
        "torque forward varies by 0.0600 +- 0.0028 N m over the angle of the right wheel, 5 times in a turn"
    )
    assert said.endswith("does the right motor cog: is a tooth of its gear, or its shaft, damaged?")


def test_a_wheel_that_rubs_is_said_where_it_is_most() -> None:
    said = shape_text(_shape("wheel angle left (friction)", "rub"))
    assert "highest at 0 rad: does the left wheel rub" in said
    assert covariate_text(_shape("wheel angle left (friction)", "rub")) == "angle of the left wheel"


@pytest.mark.parametrize(("moment", "told"), [(3.2, "3.2"), (12.1, "12"), (123.4, "123")])
def test_a_load_that_was_taken_is_said_with_its_time(moment: float, told: str) -> None:
    over = np.linspace(moment - 2.35, moment + 2.35, 48)
    values = np.where(over > moment, 0.03, 0.0)
    load = Shape("time (friction)", "friction of each wheel", "N m", over, "s", values, np.full(48, 0.002))
    said = shape_text(load)
    assert (
        f"over the time, most of it at about {told} s: was something picked up, put down or lost then?"
        in said
    )


def test_every_probe_has_a_question_that_a_team_can_answer(problem: Problem) -> None:
    linear = linearise(problem, problem.nominal(), list(problem.causes), sizes=1)
    names = [each.name.removeprefix(UNKNOWN_PREFIX) for each in make_probe_function(problem)(linear)]
    assert len(names) > 10
    for name in names:
        assert question_about(name).endswith("?"), name


def test_what_a_team_added_of_its_own_is_asked_nothing_about() -> None:
    assert question_about("temperature") == ""
