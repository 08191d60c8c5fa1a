"""A calibration of the tophats is compared with the robot's own last one, put into use and stored."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from raccoon import Robot, load_tophats
from raccoon.estimate.tophat import TophatCalibration, calibrate
from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
from raccoon.robot.calibration.calibration_shelf import CalibrationShelf
from robots import CONFIG
from standing_port import StandingPort

LOW, HIGH = (180.0, 2930.0), (1830.0, 3810.0)
"""White and black of an old sensor at 7 and at 23 mm."""
MOVED = "tophat left sits higher or lower than at its last calibration"
EXCHANGED = (
    "tophats left and right each read what the other one read at its last calibration: are their plugs "
    "exchanged?"
)


@cache
def made(levels: tuple[float, float]) -> TophatCalibration:
    white, black = levels
    return calibrate([white + n % 7 for n in range(200)] + [black + n % 7 for n in range(100)])


def both(left: tuple[float, float], right: tuple[float, float]) -> dict[str, TophatCalibration]:
    return {"left": made(left), "right": made(right)}


def add(
    store: TophatStore,
    found: Mapping[str, TophatCalibration],
    robot: str = CONFIG.name,
    set_name: str = "hall",
) -> None:
    store.add(*(StoredCalibration(name, set_name, "2026-01-01", each, robot) for name, each in found.items()))


@pytest.mark.parametrize(
    ("levels", "remarks"),
    [
        ({"left": LOW, "right": HIGH}, []),
        ({"left": HIGH, "right": HIGH}, [MOVED]),
        ({"left": HIGH, "right": LOW}, [EXCHANGED]),
        ({"left": HIGH}, [MOVED]),
    ],
)
def test_what_changed_since_the_robot_s_last_calibration_of_this_set_is_said(
    tmp_path: Path, levels: dict[str, tuple[float, float]], remarks: list[str]
) -> None:
    """Newer ones of another robot and of another set do not count."""
    found = {name: made(each) for name, each in levels.items()}
    store = TophatStore(tmp_path / "tophats.json")
    for pair in ((HIGH, LOW), (LOW, HIGH)):  # the newer one counts
        add(store, both(*pair))
    add(store, both(HIGH, LOW), robot="another")
    add(store, both(HIGH, LOW), set_name="home")
    robot = Robot(StandingPort(), CONFIG)
    CalibrationShelf(robot, store.path, "hall").take(found)
    assert list(robot.drive.remarks.values()) == remarks
    assert {name: robot.tophat(name).calibration for name in found} == found
    newest = store.history()[-len(found) :]
    assert {each.sensor: each.calibration for each in newest} == found
    assert {(each.robot, each.set_name) for each in newest} == {(CONFIG.name, "hall")}


def test_another_robot_s_calibration_in_use_is_no_last_one(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    add(store, both(HIGH, HIGH), robot="another")
    robot = Robot(StandingPort(), CONFIG)
    load_tophats(robot, store.path, "hall")
    said = len(robot.drive.remarks)
    for again, remarks in ((both(LOW, LOW), []), (both(HIGH, LOW), [MOVED])):  # then its own one counts
        CalibrationShelf(robot, store.path, "hall").take(again)
        assert list(robot.drive.remarks.values())[said:] == remarks


def test_a_calibration_in_use_counts_before_a_stored_one(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    add(store, both(HIGH, HIGH))
    robot = Robot(StandingPort(), CONFIG)
    robot.tophat("left").calibrate(made(LOW))
    CalibrationShelf(robot, store.path, "hall").take(both(LOW, HIGH))
    assert not robot.drive.remarks
