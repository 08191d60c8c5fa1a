"""Light or surface: the bank of hypotheses, flicker, and what cannot be known, on the fitted model."""

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.readings import Status
from raccoon.estimate.tophat import Tophat, Verdict, calibrate
from raccoon.estimate.tophat.flicker import FlickerWatch, alternates, demodulated
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS, TophatReading

RATE, WAY = 200.0, 0.0012  # readings a second, m a reading
SENSORS = TOPHAT_READINGS[::2]


def name(condition: TophatReading) -> str:
    return f"{condition.generation}-{condition.height}"


def over_lines(seconds: float, rng: np.random.Generator, condition: TophatReading) -> NDArray[np.float64]:
    places = np.cumsum(rng.uniform(0.15, 0.5, 30))
    position = np.arange(0.0, WAY * seconds * RATE, WAY)[: int(seconds * RATE)]
    radius = reflectance.spot_radius(condition.height)
    return np.asarray(
        np.sum([reflectance.line_coverage(position, each, 0.015, radius) for each in places], axis=0)
    )


def wrong_share(
    condition: TophatReading, sun: np.ndarray, seed: int, forgiven: slice = slice(0, 0)
) -> tuple[float, Tophat]:
    """Share of wrong readings over one surface on a drive through the light `sun`, and the classifier."""
    rng = np.random.default_rng(seed)
    optics = reflectance.fit(condition.generation).at(condition.height, rng.uniform(0.85, 1.15))
    path = over_lines(2.5, rng, condition)
    tophat = Tophat(calibrate(reflectance.read(rng, path, optics, ambient=sun[: len(path)])))
    dark = over_lines(len(sun) / RATE, rng, condition)
    counts = reflectance.read(rng, dark, optics, ambient=sun)
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    clear = (dark <= 0.05) | (dark >= 0.9 * dark.max())
    clear[forgiven] = False
    return float((np.array(black) != (dark > 0.5))[clear].mean()), tophat


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("shade", [0.3, 0.02])
def test_a_shadow_edge_is_no_line(condition: TophatReading, shade: float) -> None:
    time = np.arange(1600) / RATE
    sun = np.interp(time, [4.0, 4.1], [1.0, shade])
    for seed in range(3):
        wrong, _ = wrong_share(condition, sun, seed, slice(800, 880))
        assert wrong <= 0.01


@pytest.mark.parametrize("condition", SENSORS, ids=name)
def test_the_calibration_and_the_classifier_look_through_flicker(condition: TophatReading) -> None:
    time = np.arange(1600) / RATE
    sun = 0.02 * (1.0 + 0.2 * np.sin(2.0 * np.pi * 100.3 * time + 1.0))
    for seed in range(2):
        wrong, _ = wrong_share(condition, sun, seed)
        assert wrong <= 0.01


def test_flicker_is_told_from_noise_and_edges() -> None:
    rng = np.random.default_rng(1)
    noise = 1000.0 + rng.normal(0.0, 5.0, 400)
    wave = 20.0 * np.sin(2.0 * np.pi * 100.3 / RATE * np.arange(400) + 1.0)
    lines = np.where(np.arange(400) // 12 % 4 == 0, 800.0, 0.0)
    assert not alternates(noise)
    assert not alternates(noise + lines)
    assert alternates(noise + wave)
    assert alternates(noise + wave + lines)
    assert np.std(demodulated(noise + wave)) < 0.5 * np.std(noise + wave)


def test_the_flicker_watch_follows() -> None:
    rng = np.random.default_rng(2)
    watch = FlickerWatch()
    seen = []
    for index in range(1600):
        lamp = 30.0 * (-1.0) ** index if 400 <= index < 800 else 0.0
        watch.update(1000.0 + lamp + rng.normal(0.0, 4.0))
        seen.append(watch.flickers)
    assert not any(seen[:400])
    assert all(seen[600:800])
    assert not any(seen[1500:])


def test_flicker_is_kept_with_the_calibration() -> None:
    rng = np.random.default_rng(3)
    condition = SENSORS[3]
    optics = reflectance.fit(condition.generation).at(condition.height)
    path = over_lines(2.5, rng, condition)
    sun = 0.02 * (1.0 + 0.3 * np.sin(2.0 * np.pi * 100.3 * np.arange(len(path)) / RATE))
    found = calibrate(reflectance.read(rng, path, optics, ambient=sun))
    assert found.verdict is Verdict.OK
    assert found.flickers
    assert "flickers" in found.reason


def test_a_standing_sensor_knows_that_only_the_light_can_have_changed() -> None:
    """Old sensor at 7 mm: white in little light reads 171, as black did in the sun."""
    rng = np.random.default_rng(4)
    condition = SENSORS[0]
    optics = reflectance.fit(condition.generation).at(condition.height)
    path = over_lines(2.5, rng, condition)
    tophat = Tophat(calibrate(reflectance.read(rng, path, optics, ambient=1.0)))
    sun = np.where(np.arange(400) < 200, 1.0, 0.02)
    counts = reflectance.read(rng, np.zeros(400), optics, ambient=sun)
    black = [tophat.update(i / RATE, float(each), None, 0.0).black for i, each in enumerate(counts)]
    assert not any(black[260:])


def test_black_for_longer_than_any_line_is_not_known() -> None:
    """Light that goes as quickly as an edge is crossed, to where white reads as black did."""
    rng = np.random.default_rng(5)
    condition = SENSORS[0]
    optics = reflectance.fit(condition.generation).at(condition.height)
    path = over_lines(2.5, rng, condition)
    tophat = Tophat(calibrate(reflectance.read(rng, path, optics, ambient=1.0)))
    sun = np.interp(np.arange(600), [200, 204], [1.0, 0.02])
    counts = reflectance.read(rng, np.zeros(600), optics, ambient=sun)
    readings = [tophat.update(i / RATE, float(each), None, WAY) for i, each in enumerate(counts)]
    assert readings[230].black
    assert readings[-1].status is Status.UNCERTAIN
