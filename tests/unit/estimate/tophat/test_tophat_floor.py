"""A floor that is not the same everywhere: boards and glare; and a way that nobody says."""

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.estimate.tophat import Tophat, TophatCalibration, calibrate
from raccoon.estimate.tophat.calibration import Surface
from raccoon.estimate.tophat.hypotheses import HypothesisBank
from raccoon.estimate.tophat.levels import Levels
from raccoon.estimate.tophat.tracker import LightTracker
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS, TophatReading
from raccoon.model.reflectance import light_of

RATE, WAY, LENGTH = 200.0, 0.0012, 1.2
SENSORS = TOPHAT_READINGS[::2]
LINES = (0.15, 0.75, 1.05)
Array = NDArray[np.float64]


def name(condition: TophatReading) -> str:
    return f"{condition.generation}-{condition.height}"


def drive(
    condition: TophatReading, patch: tuple[float, float, float], *, seed: int = 4, way: float = WAY
) -> tuple[TophatCalibration, Array, Array]:
    """(calibration elsewhere, counts, darkness) over lines and a floor that sends back so many times the
    light from one place to another."""
    rng = np.random.default_rng(seed)
    optics, radius = (
        reflectance.fit(condition.generation).at(condition.height),
        reflectance.spot_radius(condition.height),
    )
    position = np.arange(0.0, LENGTH, way)
    begin, end, times = patch
    dark = np.sum([reflectance.line_coverage(position, each, 0.03, radius) for each in LINES], axis=0)
    there = reflectance.line_coverage(position, 0.5 * (begin + end), end - begin, radius)
    light = optics.light(dark) * (1.0 + (times - 1.0) * there)
    light *= np.exp(0.01 * rng.standard_normal(len(dark)))
    counts = np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(dark))), 0.0, 4095.0)
    before = reflectance.line_coverage(np.arange(0.0, 0.5, WAY), 0.25, 0.03, radius)
    return calibrate(reflectance.read(rng, before, optics)), counts, np.asarray(dark)


def wrong(black: Array, dark: Array) -> float:
    """Share of wrong readings among those over one surface."""
    clear = (dark < 0.05) | (dark > 0.95)
    return float(((black > 0.5) != (dark > 0.5))[clear].mean())


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("times", [0.6, 0.75])
def test_a_darker_board_is_no_line_and_neither_is_the_floor_after_it(
    condition: TophatReading, times: float
) -> None:
    calibration, counts, dark = drive(condition, (0.3, 0.6, times))
    tophat = Tophat(calibration)
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    assert wrong(np.array(black, dtype=float), dark) == 0.0


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("width", [0.015, 0.03])
def test_the_floor_after_glare_is_white_again(condition: TophatReading, width: float) -> None:
    calibration, counts, dark = drive(condition, (0.4, 0.4 + width, 2.0))
    tophat = Tophat(calibration)
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    assert wrong(np.array(black, dtype=float), dark) < 0.01


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("seam", [(0.83, 0.68, 0.87), (0.9, 0.6, 0.6, 0.9), (0.6, 0.3, 0.6)])
def test_the_floor_after_a_seam_is_white_again(condition: TophatReading, seam: tuple[float, ...]) -> None:
    """It begins as a line does and never covers the spot. For who knows of lines alone the floor after it is
    black in more light."""
    tracker = LightTracker(
        Surface(condition.white, 0.015 * condition.white, 300), Surface(condition.black, 6.0, 9)
    )
    bank = HypothesisBank(tracker._sensor, tracker._belief()._replace(on_black=False))
    for times in (*[1.0] * 10, *seam, *[1.0] * 20):
        bank.update(4095.0 / (1.0 + times * light_of(condition.white)), WAY)
    assert bank.black < 0.01


@pytest.mark.parametrize("condition", SENSORS[:2], ids=name)
def test_the_floor_that_comes_back_after_glare_is_another_place_of_it(condition: TophatReading) -> None:
    """Which sends back 4 % more than the one before, as floors do."""
    tracker = LightTracker(
        Surface(condition.white, 0.015 * condition.white, 300), Surface(condition.black, 6.0, 9)
    )
    home = tracker._belief()._replace(on_black=False)
    more = 0.5 * tracker._sensor.black_share * 1.4 * home.light  # black knows half of it
    start = home._replace(light=2.4 * home.light, dark=home.dark + more, dark_var=home.dark_var + more * more)
    bank = HypothesisBank(tracker._sensor, start, home)
    position, radius = np.arange(-0.03, 0.03, WAY), reflectance.spot_radius(condition.height)
    for there in reflectance.edge_coverage(-position, radius):
        bank.update(4095.0 / (1.0 + home.light * (2.4 - 1.36 * there)), WAY)
    assert bank.black < 0.1


@pytest.mark.parametrize("condition", SENSORS, ids=name)
def test_a_slow_robot_of_which_nobody_says_the_way_sees_lines_and_no_light(condition: TophatReading) -> None:
    calibration, counts, dark = drive(condition, (0.3, 0.6, 1.0), way=0.5 * WAY)
    tophat = Tophat(calibration)
    black = [tophat.update(i / RATE, float(each)).black for i, each in enumerate(counts)]
    assert wrong(np.array(black, dtype=float), dark) == 0.0
    assert tophat.levels.late_changes == 0


def test_what_lasts_longer_than_any_line_is_black_or_not_with_even_odds() -> None:
    """Along a line, or inverted: it is no more than a guess."""
    tophat = Tophat(calibrate(np.repeat([300.0, 2000.0, 300.0], 60) + np.tile([-3.0, 0.0, 3.0], 60)))
    readings = [
        tophat.update(i / RATE, each, None, WAY) for i, each in enumerate([300.0] * 30 + [2000.0] * 200)
    ]
    assert readings[100].darkness > 0.99
    assert readings[-1].black
    assert readings[-1].darkness == 0.5


def test_what_is_said_while_it_is_weighed_is_what_the_stories_say() -> None:
    """A level between the two surfaces that comes and stays: the levels alone would be sure of it."""
    tophat = Tophat(calibrate(np.repeat([300.0, 2000.0, 300.0], 60) + np.tile([-3.0, 0.0, 3.0], 60)))
    said = [tophat.update(i / RATE, 300.0, None, WAY).darkness for i in range(100)]
    assert max(said) < 0.01
    weighed = []
    for i in range(100, 160):
        reading = tophat.update(i / RATE, 600.0, None, WAY)
        if tophat.levels.bank_probability is not None:
            weighed.append((reading.darkness, tophat.levels.bank_probability))
    assert weighed
    assert all(darkness == story for darkness, story in weighed)


def test_the_noise_of_black_shrinks_where_its_light_does() -> None:
    """2 % of its light is 15 counts of 600 in the sun, and 5 of 3900 indoors."""
    levels = Levels(Surface(400.0, 7.0, 100), Surface(600.0, 15.0, 100))
    levels.light, levels.dark = 0.2, 0.05
    levels._refresh()
    assert levels.black == pytest.approx(3900.0)
    assert levels._dark_noise**0.5 < 8.0
