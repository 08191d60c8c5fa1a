"""More friction, friction by direction and a slope are one torque to a drive one way."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.select import one_way_drives, rivals
from raccoon.diagnose.select.one_way_drives import ONE_WAY_EQUIVALENTS, one_way_direction, one_way_equivalents
from raccoon.diagnose.select.rivals import _rival_starts
from raccoon.diagnose.select.set_scoring import SetScorer
from raccoon.diagnose.select.state import Search


def driven(*readings: tuple[float, float]) -> Any:
    """Features of two wheels that read from one number to another."""
    measured = np.stack([np.linspace(low, high, 200) for low, high in readings], axis=1)
    return SimpleNamespace(roles=("bemf_left", "bemf_right"), measured=measured)


@pytest.mark.parametrize(
    ("readings", "way"),
    [
        ([(-2.0, 900.0), (0.0, 700.0)], 1),
        ([(-900.0, 3.0), (-700.0, 0.0)], -1),
        ([(-300.0, 900.0), (0.0, 700.0)], 0),
        ([(-900.0, 3.0), (0.0, 700.0)], 0),
    ],
)
def test_the_way_of_a_drive_is_that_of_both_wheels(readings: list[tuple[float, float]], way: int) -> None:
    assert one_way_direction(driven(*readings)) == way


def held_back(problem: Problem, point: Point, way: int) -> float:
    """N m against a robot that drives that way."""
    there = problem.settings(point)
    friction = there["friction.coulomb", "left", "torque"]
    lean = there["friction.direction_dependent", "left", "asymmetry"]
    return friction * (1.0 + way * lean) - way * there["drive.slope", None, "along_x"]


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("name", ONE_WAY_EQUIVALENTS)
def test_each_of_them_is_as_much_torque_as_the_one_in_whose_place_it_stands(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, name: str, way: int
) -> None:
    monkeypatch.setattr(one_way_drives, "one_way_direction", lambda _: way)
    u = np.zeros(problem.causes[name].size)
    u[0] = 0.3
    point = problem.nominal().with_cause(name, u)
    found = dict(one_way_equivalents(problem, point, name))
    assert set(found) == set(ONE_WAY_EQUIVALENTS) - {name}
    torque = held_back(problem, point, way)
    assert abs(torque - held_back(problem, problem.nominal(), way)) > 0.005
    for other in found.values():
        assert held_back(problem, other, way) == pytest.approx(torque, abs=1e-4)


@pytest.mark.parametrize("name", ONE_WAY_EQUIVALENTS)
def test_what_a_model_to_start_from_has_of_them_stays(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """A table that is known to pull by 0.02 N m was counted as if it were what is found now."""
    monkeypatch.setattr(one_way_drives, "one_way_direction", lambda _: 1)
    slope = {("drive.slope", None, "along_x"): 0.02}
    lean = {("friction.direction_dependent", side, "asymmetry"): 0.1 for side in ("left", "right")}
    known = replace(problem, neutral=dict(problem.neutral) | slope | lean)
    u = np.zeros(known.causes[name].size)
    u[0] = 0.3
    point = known.nominal().with_cause(name, u)
    for other in dict(one_way_equivalents(known, point, name)).values():
        assert held_back(known, other, 1) == pytest.approx(held_back(known, point, 1), abs=1e-4)


def test_a_drive_both_ways_tells_them_apart(problem: Problem) -> None:
    point = problem.nominal().with_cause("drive.slope", np.array([0.3, 0.0]))
    assert one_way_direction(problem.features) == 0
    assert list(one_way_equivalents(problem, point, "drive.slope")) == []


def test_they_are_tried_in_each_others_place(searching: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    """Though straight lines lead from none to another."""
    monkeypatch.setattr(one_way_drives, "one_way_direction", lambda _: 1)
    monkeypatch.setattr(rivals, "find_similar_causes", lambda *_: {})
    monkeypatch.setattr(rivals, "_cheapest_replacements", lambda *_: {})
    assert {rival for _, rival, _ in _rival_starts(searching)} == set(ONE_WAY_EQUIVALENTS) - {"drive.slope"}


@pytest.fixture
def searching(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> Search:
    """A slope that was named."""
    point = problem.nominal().with_cause("drive.slope", np.array([-0.5, 0.0]))
    monkeypatch.setattr(SetScorer, "of", lambda _: None)
    return cast(Search, SimpleNamespace(problem=problem, fit=SimpleNamespace(point=point), rivals={}))


@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_what_no_reading_shows_is_no_rival(problem: Problem, size: float) -> None:
    """Without a gyro a wheel's radius has next to no column, as like to any other as none is."""
    name, other = "drive.slope", "drive.wheel_radius@left"
    whole = np.array([[1.0, 0.0, size], [0.0, 1.0, 0.0], [size, 0.0, size**2]])
    group = SimpleNamespace(name=other, one_sided=False, start=(), points=((1.0,),))
    table = SimpleNamespace(
        gram=SimpleNamespace(matrix=whole), active={name: slice(0, 2)}, inactive=[(group, [2])]
    )
    point = problem.nominal().with_cause(name, np.array([0.8, 0.0]))
    search: Any = SimpleNamespace(problem=problem, table=table, fit=SimpleNamespace(point=point))
    found = rivals.find_similar_causes(search, name, 0.45, 4)
    assert set(found) == ({other} if size == 1.0 else set())
