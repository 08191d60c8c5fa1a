from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.readings import Outputs
from raccoon.diagnose.experiment.advice import DECISIVE_EVIDENCE, DrivePlan, estimate_reach, rank_manoeuvres
from raccoon.diagnose.experiment.manoeuvres import MANOEUVRES, RATE, manoeuvre
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

ROBOT = RobotConfig()


@pytest.fixture(scope="module", autouse=True)
def _planned_once() -> Iterator[None]:
    """Each manoeuvre of the one robot is planned once for all tests: a plan is never changed."""
    made = DrivePlan.of

    @cache
    def of(name: str) -> DrivePlan:
        return made(ROBOT, manoeuvre(name))

    def planned(robot: RobotConfig, duty: NDArray[np.float64]) -> DrivePlan:
        assert robot is ROBOT
        return of(next(name for name in MANOEUVRES if np.array_equal(manoeuvre(name), duty)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DrivePlan, "of", planned)
        yield


@pytest.mark.parametrize("name", sorted(MANOEUVRES))
def test_a_manoeuvre_is_a_legal_command(name: str) -> None:
    duty = manoeuvre(name)
    assert duty.shape[1] == 2
    assert np.abs(duty).max() <= 1.0


def test_standing_still_is_never_advised() -> None:
    """It would show the battery's voltage, but of a robot that does not move no diagnosis is made."""
    drives = [each.manoeuvre for each in rank_manoeuvres(ROBOT, "battery.open_circuit_voltage")]
    assert "still" in MANOEUVRES
    assert drives
    assert "still" not in drives


def test_backlash_is_told_from_gyro_latency_by_turning() -> None:
    best = rank_manoeuvres(ROBOT, "drive.backlash", ["imu.latency"])[0]
    assert best.manoeuvre in ("spin", "steps", "creep")


def test_twins_cannot_be_told_apart_by_any_drive() -> None:
    alone = rank_manoeuvres(ROBOT, "imu.gyro_scale")[0].evidence
    against = rank_manoeuvres(ROBOT, "imu.gyro_scale", ["drive.track_width"])[0].evidence
    assert against < 0.2 * alone


def test_a_slope_is_shown_by_a_drive_that_meets_it_from_all_sides() -> None:
    """Back and forth shows its part along the drive only; what lies across would stay unseen."""
    slope = {each.manoeuvre: each.evidence for each in rank_manoeuvres(ROBOT, "drive.slope")}
    assert slope["circles"] > DECISIVE_EVIDENCE
    assert slope["back and forth"] < 1.0


def plan_of(groups: list[tuple[ColumnGroup, NDArray[np.float64]]], seed: int = 3) -> DrivePlan:
    """A plan of some whitened columns, beside one base number, one other cause and nothing restless."""
    random = np.random.default_rng(seed)
    other, own = random.normal(size=(2, 1, groups[0][1].shape[1]))
    columns = (*groups, (ColumnGroup("imu.gyro_bias", np.empty((1, 0, 0))), other))
    return DrivePlan(columns, own, own[:0])


def test_where_a_slope_points_changes_nothing_of_what_a_drive_is_said_to_show() -> None:
    """One across the drive showed nothing, and one half across half as much as one along it: it points where
    it shows least, and not along one of the two axes of the start."""
    along, across = np.random.default_rng(4).normal(size=(2, 1200))
    pair = np.stack([along, 0.2 * across])
    turns = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (0.0, 0.4, math.pi / 4)]
    group = ColumnGroup("drive.slope", np.empty((2, 0, 0)))
    evidence = [plan_of([(group, turn @ pair)]).evidence("drive.slope")[0] for turn in turns]
    assert evidence == pytest.approx([evidence[0]] * 3, rel=1e-9)
    assert evidence[0] == pytest.approx(0.04 * 1200, rel=0.15)


def test_the_shapes_that_a_cause_is_tried_in_are_not_taken_for_parts_of_it() -> None:
    """Stiction was said to show from four times the size on: of its three shapes only what makes them differ
    counted."""
    shape, others = (
        np.random.default_rng(5).normal(size=1200),
        np.random.default_rng(6).normal(size=(3, 1200)),
    )
    name = "friction.stiction"
    groups = [
        (ColumnGroup(name, np.empty((1, 0, 0)), (0.7, float(place))), (shape + 0.1 * other)[None])
        for place, other in enumerate(others)
    ]
    together = plan_of(groups).visible_sizes()[name]
    assert together in {plan_of([each]).visible_sizes()[name] for each in groups}


def test_what_another_cause_imitates_in_a_drive_is_no_evidence() -> None:
    """Straight on, friction that differs by direction is a constant torque, as a slope is."""
    uneven = {
        each.manoeuvre: each.evidence for each in rank_manoeuvres(ROBOT, "friction.direction_dependent")
    }
    assert uneven["straight"] < 0.2 * uneven["creep"]


def test_the_area_is_minded() -> None:
    assert all(each.reach <= 0.3 for each in rank_manoeuvres(ROBOT, "friction.viscous", within=0.3))


@pytest.mark.parametrize(
    ("name", "effects"),
    [
        ("checkup", (("motor.back_emf_constant", "left", 0.96),)),
        ("checkup", (("friction.direction_dependent", "left", -0.2),)),
        ("checkup", (("battery.open_circuit_voltage", None, 7.0), ("drive.wheel_radius", "right", 1.02))),
        ("spin", (("friction.direction_dependent", None, 0.2),)),
        ("straight", (("battery.open_circuit_voltage", None, 7.0), ("friction.coulomb", None, 0.16))),
    ],
)
def test_no_usual_robot_leaves_the_room_that_is_asked_for(
    name: str, effects: tuple[tuple[str, str | None, float], ...]
) -> None:
    robot = Parameters.from_robot(ROBOT).with_chain(Chain.firmware())
    for id_, where, value in effects:
        robot = robot.with_effect(id_, where, **{effect(id_).parameters[0].name: value})
    port, farthest = SimPort(robot, World.empty(), robot=ROBOT), 0.0
    for left, right in manoeuvre(name):
        truth = port.read().truth
        assert truth is not None
        farthest = max(farthest, math.hypot(truth.x, truth.y))
        port.write(Outputs(duty=(left, right, 0.0, 0.0)))
    port.close()
    assert farthest <= estimate_reach(ROBOT, manoeuvre(name))


def test_the_checkup_needs_little_room_and_shows_something_of_everything() -> None:
    duty = manoeuvre("checkup")
    assert estimate_reach(ROBOT, duty) < 0.8
    assert len(duty) / RATE == pytest.approx(40.0, abs=0.5)
    shown = DrivePlan.of(ROBOT, duty).visible_sizes()
    assert set(shown) == {each.id for each in drive_causes()}
    assert [id_ for id_, size in shown.items() if not size or "usual" in size] == []
    page = " ".join((Path(__file__).parents[4] / "docs" / "diagnosis.md").read_text("utf-8").split())
    for name, id_ in (
        ("K_E", "motor.back_emf_constant"),
        ("backlash", "drive.backlash"),
        ("a late gyro", "imu.latency"),
        ("the gyro's scale", "imu.gyro_scale"),
    ):
        size = shown[id_].removeprefix("from about ").removesuffix(" on").replace("0.0012 s", "1.2 ms")
        assert f"{name} from {size}" in page


def test_what_a_drive_cannot_show_is_said_before_it_is_driven() -> None:
    shown = DrivePlan.of(ROBOT, manoeuvre("straight")).visible_sizes()
    assert shown["imu.gyro_scale"] == ""  # it never turns
    assert shown["friction.stiction"].endswith("more than is usual")  # it never creeps
    assert shown["drive.turn_scrub"] == ""  # but for rounding
    assert shown["friction.coulomb"].startswith("from about 0.0")


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(ConfigError, match="moon phase"):
        rank_manoeuvres(ROBOT, "moon phase")
    with pytest.raises(ConfigError, match="pirouette"):
        manoeuvre("pirouette")


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("tophat.gain@0", "no drive shows it; hold the tophats over black and over white"),
        ("drive.track_width@left", "has no side; name drive.track_width"),
        ("drive.wheel_eccentricity", "it has a side; name drive.wheel_eccentricity@left or"),
        ("bemf.scale@2", "it has a side; name bemf.scale, bemf.scale@left or bemf.scale@right"),
        ("moon", "there is none of that name; see raccoon effects"),
        ("bemf.scael@left", r"there is none of that name \(did you mean bemf.scale@left\?\); see"),
    ],
)
def test_a_name_that_no_drive_shows_is_refused_with_the_reason(name: str, why: str) -> None:
    for asked in ((name, ()), ("drive.inertia", [name])):
        with pytest.raises(ConfigError, match=why):
            rank_manoeuvres(ROBOT, *asked)


def test_a_cause_is_no_rival_of_itself() -> None:
    with pytest.raises(ConfigError, match=r"rival 'imu.latency': it is the cause itself"):
        rank_manoeuvres(ROBOT, "imu.latency", ["drive.backlash", "imu.latency"])
