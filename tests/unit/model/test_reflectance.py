import csv

import numpy as np
import pytest

from raccoon.core.errors import ConfigError
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS, TophatReading, tophat_reading
from raccoon.model.reflectance import (
    AMBIENT,
    FULL_SCALE,
    GENERATIONS,
    NEAR_HEIGHT,
    SensorModel,
    drive_over_line,
    fit,
    light_of,
)
from shared_data import data_path


@pytest.mark.parametrize("reading", TOPHAT_READINGS)
def test_reproduces_the_sixteen_readings_of_the_paper(reading: TophatReading) -> None:
    ambient = AMBIENT[reading.light]
    for darkness, measured in ((0.0, reading.white), (1.0, reading.black)):
        modelled = reflectance.counts(darkness, reading.generation, reading.height, ambient)
        assert modelled == pytest.approx(measured, abs=1.0)


def test_it_is_a_fit_and_no_table() -> None:
    """The paper prints whole tens; 0 everywhere would be a table."""
    off = []
    for each in TOPHAT_READINGS:
        light = AMBIENT[each.light]
        off += [reflectance.counts(0.0, each.generation, each.height, light) - each.white]
        off += [reflectance.counts(1.0, each.generation, each.height, light) - each.black]
    assert 0.1 < np.abs(off).max() < 1.0


@pytest.mark.parametrize("generation", GENERATIONS)
def test_more_light_never_raises_a_reading(generation: str) -> None:
    darkness = np.linspace(0.0, 1.0, 21)
    for height in (0.004, 0.007, 0.015, 0.023, 0.03):
        by_ambient = [reflectance.counts(darkness, generation, height, a) for a in (0.0, 0.1, 0.5, 1.0, 2.0)]
        assert np.all(np.diff(by_ambient, axis=0) < 0.0)
        assert np.all(np.diff(by_ambient, axis=1) > 0.0)


@pytest.mark.parametrize("generation", GENERATIONS)
def test_readings_stay_in_the_converter(generation: str) -> None:
    for height in (0.002, 0.06):
        for ambient in (0.0, 100.0):
            read = reflectance.counts(np.array([0.0, 1.0]), generation, height, ambient)
            assert np.all((read > 0.0) & (read < FULL_SCALE))


def test_all_light_of_a_brighter_sensor_is_as_much_brighter() -> None:
    """What the floor returns, what never saw the floor, and the sun."""
    model = fit("new")
    for dark, ambient in ((0.0, 0.0), (1.0, 0.0), (0.4, 0.7)):
        usual, brighter = (model.at(0.01, gain=gain).light(dark, ambient) for gain in (1.0, 1.3))
        assert brighter == pytest.approx(1.3 * usual)


def test_light_is_the_inverse_of_counts() -> None:
    optics = fit("old").at(0.01)
    assert light_of(optics.counts(0.3, 0.2)) == pytest.approx(optics.light(0.3, 0.2))


@pytest.mark.parametrize("height", [0.0, 0.001, 0.1, float("nan")])
def test_impossible_height_is_refused(height: float) -> None:
    with pytest.raises(ConfigError, match="height"):
        reflectance.counts(0.0, "old", height)


def test_unknown_generation_and_gain_are_refused() -> None:
    with pytest.raises(ConfigError, match="generation"):
        reflectance.counts(0.0, "EE-SB5", 0.007)
    with pytest.raises(ConfigError, match="gain"):
        fit("old").at(0.007, gain=0.0)


def test_disc_over_an_edge() -> None:
    covered = reflectance.edge_coverage(np.array([0.01, 0.002, 0.0, -0.002, -0.01]), 0.004)
    assert covered[0] == 0.0
    assert covered[2] == pytest.approx(0.5)
    assert covered[4] == 1.0
    assert covered[1] + covered[3] == pytest.approx(1.0)


def test_line_narrower_than_the_spot_never_covers_it() -> None:
    covered = reflectance.line_coverage(np.linspace(-0.05, 0.05, 201), 0.0, 0.004, 0.005)
    assert covered.max() == covered[100]
    assert 0.4 < covered.max() < 0.6
    assert covered.sum() * 0.0005 == pytest.approx(0.004, rel=0.01)  # a moving spot sees the line's width


def test_drive_sees_the_line_once_and_repeats_with_its_seed() -> None:
    condition = tophat_reading("old", 0.007, "normal")
    samples, darkness = drive_over_line(np.random.default_rng(5), condition)
    again, _ = drive_over_line(np.random.default_rng(5), condition)
    assert len(samples) == 500
    assert np.array_equal(samples, again)
    assert np.mean(darkness) == pytest.approx(0.015 / 0.6, rel=0.05)
    assert samples[darkness == 0.0].mean() == pytest.approx(condition.white, rel=0.02)
    assert samples[darkness == 1.0].mean() == pytest.approx(condition.black, rel=0.02)


def test_explains_recorded_calibrations() -> None:
    """Each pair has one reflected and one ambient light of its own; both must be possible ones.

    Where the ambient light comes out negative, the tape was darker than the paper's; by how much is held.
    """
    with (data_path("tophat-calibrations") / "white-black-pairs.csv").open(encoding="utf-8") as file:
        rows = [(float(row["white_tresh"]), float(row["black_tresh"])) for row in csv.DictReader(file)]
    pairs = [(white, black) for white, black in rows if black > 0.0]
    assert len(pairs) == 184
    misses = np.array([min(miss(fit(each), *pair) for each in GENERATIONS) for pair in pairs])
    assert np.mean(misses < 1.0) > 0.8
    assert misses.max() < 600.0


def miss(model: SensorModel, white: float, black: float) -> float:
    """Counts between the recorded black and the model's, at the height and ambient level of the pair."""
    mixing = [[1.0, 1.0], [model.reflected_by_black, model.sun_by_black]]
    lights = np.array([light_of(white), light_of(black)]) - model.leak
    reflected, ambient = np.linalg.solve(mixing, lights)
    if ambient < 0.0:
        reflected, ambient = lights[0], 0.0
    height = NEAR_HEIGHT * (reflected / model.reflected_near) ** (-1.0 / model.falloff)
    if not 0.003 < height < 0.03:
        return float("inf")
    optics = model.at(height)
    return float(abs(optics.counts(1.0, ambient / optics.sun) - black))
