"""What changed at one moment of a drive."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import Diagnoser
from raccoon.diagnose.drives.log import Log, StepChange
from raccoon.diagnose.result import Shape, Unexplained
from raccoon.diagnose.search_outcome import SearchOutcome
from raccoon.diagnose.unknown.step_change import change_probes, find_step_change

TIME = np.asarray(0.02 * np.arange(1500), np.float64)
RNG = np.random.default_rng(4)
NOISE = 0.01 * RNG.standard_normal(len(TIME))
WHEELS = {side: np.repeat(RNG.uniform(-12.0, 12.0, 50), 30) for side in ("left", "right")}
PUSHES = np.random.default_rng(7).standard_normal(len(TIME))
PUSHED = 0.02 * np.convolve(PUSHES, np.exp(-np.arange(100) / 20.0))[: len(TIME)]
HERE = TIME > 17.3


@pytest.mark.parametrize(
    ("of", "left"),
    [
        ("gyro", 0.02 * HERE),
        ("gyro", 0.02 * HERE - 0.001 * (TIME - 15.0)),  # beside a drift that a search took it for
        ("left", -0.04 * 0.21 * WHEELS["left"] * HERE),
        ("right", 0.02 * 0.21 * WHEELS["right"] * HERE),
    ],
)
def test_a_step_is_found_with_its_moment(of: str, left: NDArray[np.float64]) -> None:
    """A zero that jumped by 0.02 rad/s was a drift, a wheel 4 % larger from a moment on nothing at all."""
    found = find_step_change(TIME, left + NOISE, WHEELS)
    assert found is not None
    assert found.of == of
    assert found.at == pytest.approx(17.3, abs=0.1)


@pytest.mark.parametrize(
    "left",
    [
        0.0 * TIME,
        0.001 * TIME,  # a drift
        0.02 * np.exp(-TIME / 6.0),  # a gyro that warms up
        0.3 * ((TIME > 9.0) & (TIME < 9.4)),  # a wheel that slipped on a pipe
        0.04 * 0.21 * WHEELS["right"],  # another wheel all the time
        0.01 * np.sin(0.4 * TIME),
        PUSHED,  # by a floor that does so for half a second
    ],
)
def test_what_is_no_step_is_none(left: NDArray[np.float64]) -> None:
    assert find_step_change(TIME, left + NOISE, WHEELS) is None


def test_where_nothing_is_left_there_is_no_step() -> None:
    """A simulation without noise of the same equations leaves nothing of the gyro."""
    assert find_step_change(TIME, np.zeros(len(TIME)), WHEELS) is None


def test_short_means_make_no_step_of_what_wanders() -> None:
    """Of a floor's pushes for half a second, in means of 5 ms: two of five sound robots with wheel loops."""
    time = np.asarray(0.005 * np.arange(6000), np.float64)
    course = np.exp(-np.arange(1000) / 100.0)
    course *= 0.006 / np.sqrt((course**2).sum())
    for seed in range(7, 12):
        rng = np.random.default_rng(seed)
        wheels = {side: np.repeat(rng.uniform(-12.0, 12.0, 50), 120) for side in ("left", "right")}
        wander = np.convolve(rng.standard_normal(len(time)), course)[: len(time)]
        noise = 0.012 * rng.standard_normal(len(time))
        assert find_step_change(time, wander + noise, wheels) is None
        found = find_step_change(time, 0.06 * (time > 17.3) + wander + noise, wheels)
        assert found is not None
        assert found.at == pytest.approx(17.3, abs=0.1)


def test_the_response_to_a_wheel_that_grew_is_what_it_turns_the_robot_by_from_then_on() -> None:
    robot = RobotConfig()
    features = SimpleNamespace(time=TIME, measured=np.zeros((len(TIME), 2)), roles=("battery", "gyro"))
    settings = {
        ("drive.wheel_radius", "left", "factor"): 1.0,
        ("drive.track_width", None, "factor"): 1.0,
        ("imu.gyro_scale", None, "factor"): 1.0,
    }
    problem: Any = SimpleNamespace(change=StepChange(17.3, "left"), features=features, robot=robot)
    wheels = np.column_stack([WHEELS["left"], WHEELS["right"]])
    (probe,) = change_probes(problem, settings, wheels)
    drive = robot.model.drive
    turns = -0.01 * drive.wheel_radius.value / drive.track_width.value * WHEELS["left"]
    assert probe.columns[0, :, 1] == pytest.approx(np.where(TIME >= 17.3, turns, 0.0))
    assert not probe.columns[0, :, 0].any()
    assert (probe.name, probe.unit) == ("unknown: time (left wheel)", "%")


@pytest.mark.parametrize(("grown", "told"), [(3.9, True), (0.02, False), (None, False)])
def test_what_changed_is_beside_all_that_is_sought_again(
    monkeypatch: pytest.MonkeyPatch, grown: float | None, told: bool
) -> None:
    """A wheel that grew by so many percent, with a standard deviation of 0.02; None where nothing is told."""
    logs: list[Log] = []
    one = np.ones(1)

    def once(_: Diagnoser, log: Log, __: None) -> SearchOutcome:
        logs.append(log)
        shapes: tuple[Shape, ...] = ()
        if grown is not None and log.change:
            over, values, stds = (np.concatenate([0.0 * one, each * one]) for each in (17.3, grown, 0.02))
            shapes = (Shape("time (right wheel)", "radius", "%", over, "s", values, stds),)
        depends_on = tuple(each.depends_on for each in shapes)
        said: Any = SimpleNamespace(
            causes=(), channels=(), shapes=shapes, unexplained=Unexplained(0.0, depends_on), asked=len(logs)
        )
        return SearchOutcome(said, (), None if log.change else StepChange(17.3, "right"))

    monkeypatch.setattr(Diagnoser, "search_once", once)
    log = Log(TIME, np.zeros((len(TIME), 2)), ())
    found: Any = Diagnoser(RobotConfig(), (), None, None, 0.0)._with_step_change(log, None)
    assert [each.change for each in logs] == [None, StepChange(17.3, "right")]
    assert found.diagnosis.asked == (2 if told else 1)
