"""What is seen of a recording's commands before anything is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import contest, exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.excitation import is_driven, swing_period
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.magnitudes import slope
from raccoon.diagnose.drives.units import only_free_driving
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.experiment.manoeuvres import MANOEUVRES, manoeuvre

RATE = 200.0


def test_what_never_changes_goes_together_with_nothing() -> None:
    """It had a slope, with a warning of NumPy's."""
    ramp = np.arange(100.0)
    for one, two in ((ramp, np.full(100, 3.0)), (np.full(100, 3.0), ramp)):
        assert slope(one, two) is None
    assert slope(ramp, 2.0 * ramp) == pytest.approx(2.0)


def steered(turns: np.ndarray, forward: float = 0.4) -> Log:
    """A drive that steers by turns (n,) at 200 Hz, with a rest and a turn on the spot in it."""
    duty = np.stack([forward - turns, forward + turns], axis=1)
    duty[1000:1200] = 0.0
    duty[1200:1300] = [-0.3, 0.3]
    return planned_log(duty)


def bang_bang(frequency: float, wanders: float, seconds: float = 20.0) -> np.ndarray:
    """To one side and the other, as often as frequency says, each swing longer or shorter by that part."""
    rng = np.random.default_rng(3)
    turns: list[float] = []
    side = 1.0
    while len(turns) < seconds * RATE:
        length = 0.5 / frequency * (1.0 + wanders * rng.standard_normal())
        turns += [0.2 * side] * max(round(length * RATE), 1)
        side = -side
    return np.array(turns[: int(seconds * RATE)])


@pytest.mark.parametrize("frequency", [5.0, 7.0, 10.0])
def test_a_line_that_is_followed_by_bang_bang_is_a_swing(frequency: float) -> None:
    assert 1.0 / swing_period(steered(bang_bang(frequency, 0.15))) == pytest.approx(frequency, rel=0.1)


def test_a_recorder_that_is_late_now_and_then_sees_the_same_swing() -> None:
    log = steered(bang_bang(7.0, 0.15))
    late = np.abs(np.random.default_rng(1).normal(0.0, 3e-4, len(log.time)))
    assert swing_period(replace(log, time=log.time + late)) == pytest.approx(swing_period(log), rel=0.02)


def test_what_a_clock_swings_and_what_is_slow_are_no_swings() -> None:
    assert swing_period(steered(bang_bang(7.0, 0.0))) == 0.0  # on purpose: it says all about a robot
    assert swing_period(steered(bang_bang(2.5, 0.15))) == 0.0
    assert swing_period(steered(np.zeros(4000))) == 0.0
    assert swing_period(planned_log(np.zeros((4000, 2)))) == 0.0


@pytest.mark.parametrize("name", list(MANOEUVRES))
def test_no_manoeuvre_swings(name: str) -> None:
    assert swing_period(planned_log(manoeuvre(name))) == 0.0


@pytest.mark.parametrize("drive", [exciting, contest])
def test_neither_an_exciting_drive_nor_a_contest_swings(drive: object) -> None:
    assert callable(drive)
    for seed in range(5):
        assert swing_period(planned_log(drive(np.random.default_rng(seed), 30.0))) == 0.0


@pytest.mark.parametrize(
    ("duty", "counts", "told"),
    [(0.4, 60.0, True), (0.4, 16.0, False), (0.0, 60.0, False), (0.04, 60.0, False)],
)
def test_a_drive_moves_where_commands_change_and_a_wheel_answers(
    duty: float, counts: float, told: bool
) -> None:
    """By more than its readings scatter."""
    step = (np.arange(400) >= 200).astype(float)
    log = planned_log(np.stack([duty * step, 0.0 * step], axis=1))
    channels = [replace(each, values=0.0 * each.values, floor=2.0) for each in log.channels]
    channels = [
        replace(each, values=counts * step) if each.role.startswith("bemf") else each for each in channels
    ]
    assert is_driven(replace(log, channels=tuple(channels))) is told


def test_a_time_in_microseconds_is_not_looked_through_for_months(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty seconds of one were gigabytes of bins of 50 ms, before anybody said what it is."""
    for name in ("find_held_spans", "find_stalls"):
        asked = f"raccoon.diagnose.drives.units.{name}"
        monkeypatch.setattr(asked, lambda *_: pytest.fail("looked through"))
    monkeypatch.setattr("raccoon.diagnose.drives.units._always_small", lambda *_: False)
    log = steered(np.zeros(2000))
    log = replace(log, time=1e6 * log.time)
    assert only_free_driving(log, RobotConfig()) is log
