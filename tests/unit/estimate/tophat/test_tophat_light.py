"""Light or surface: the bank of hypotheses, flicker, and what cannot be known, on the fitted model."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.readings import Status
from raccoon.estimate.tophat import Tophat, Verdict, calibrate
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration
from raccoon.estimate.tophat.flicker import UNEVEN_HZ, FlickerWatch, average_out_flicker, detect_flicker_hz
from raccoon.estimate.tophat.quality import is_restless
from raccoon.estimate.tophat.tracker import LightTracker
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
    wrong, _ = wrong_share(condition, sun, 1, slice(800, 880))
    assert wrong <= 0.01


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("gap", [6, 9, 12])
def test_an_edge_that_is_crossed_while_nothing_is_read_is_no_change_of_light(
    condition: TophatReading, gap: int
) -> None:
    """The sensor goes on meanwhile: the way is the next reading's. One reading changes no answer."""
    rng = np.random.default_rng(4)
    optics = reflectance.fit(condition.generation).at(condition.height, 1.0)
    calibration = calibrate(reflectance.read(rng, over_lines(2.5, rng, condition), optics))
    radius = reflectance.spot_radius(condition.height)
    dark = reflectance.line_coverage(np.arange(0.0, 0.15, WAY), 0.09, 0.03, radius)
    counts = reflectance.read(rng, dark, optics)
    for start in range(62 - gap, 64):
        tophat = Tophat(calibration)
        for index, each in enumerate(counts):
            reading = tophat.update(
                index / RATE, None if start <= index < start + gap else float(each), None, WAY
            )
            if index > start + gap:
                assert reading.status is Status.OK
                assert reading.black == (dark[index] > 0.5) or 0.05 < dark[index] < 0.95


MAINS = pytest.mark.parametrize(("flicker", "hertz"), [(100.3, 100), (99.8, 100), (120.2, 120), (119.7, 120)])
"""What lamps on mains of 50 and of 60 Hz do, whose frequency is never exact, and what they are called."""


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@MAINS
def test_the_calibration_and_the_classifier_look_through_flicker(
    condition: TophatReading, flicker: float, hertz: int
) -> None:
    time = np.arange(1600) / RATE
    sun = 0.02 * (1.0 + 0.2 * np.sin(2.0 * np.pi * flicker * time + 1.0))
    wrong, _ = wrong_share(condition, sun, hertz)
    assert wrong <= 0.01


@MAINS
def test_flicker_is_told_from_noise_and_edges(flicker: float, hertz: int) -> None:
    rng = np.random.default_rng(1)
    noise = 1000.0 + rng.normal(0.0, 5.0, 400)
    wave = 20.0 * np.sin(2.0 * np.pi * flicker / RATE * np.arange(400) + 1.0)
    lines = np.where(np.arange(400) // 12 % 4 == 0, 800.0, 0.0)
    assert detect_flicker_hz(noise) == detect_flicker_hz(noise + lines) == 0
    assert detect_flicker_hz(noise + wave) == detect_flicker_hz(noise + wave + lines) == hertz
    assert np.std(average_out_flicker(noise + wave, hertz)) < 0.5 * np.std(noise + wave)


@MAINS
def test_the_flicker_watch_follows(flicker: float, hertz: int) -> None:
    rng = np.random.default_rng(2)
    watch = FlickerWatch()
    seen = []
    for index in range(1600):
        lamp = 30.0 * np.cos(2.0 * np.pi * flicker / RATE * index) if 400 <= index < 800 else 0.0
        watch.update(1000.0 + lamp + rng.normal(0.0, 4.0))
        seen.append(watch.hertz)
    assert not any(seen[:400])
    assert set(seen[600:800]) == {hertz}
    assert not any(seen[1500:])


@pytest.mark.parametrize("said", [100, 120])
def test_in_another_hall_the_flicker_watch_finds_its_mains(said: int) -> None:
    other, watch = 220 - said, FlickerWatch(said)
    for index in range(400):
        watch.update(1000.0 + 30.0 * np.cos(2.0 * np.pi * other / RATE * index + 0.5))
    assert watch.hertz == other


@pytest.mark.parametrize("hertz", [100, 120])
def test_a_spike_under_flickering_lamps_makes_no_edge(hertz: int) -> None:
    """Of either sign, over either surface; of an edge that is one the time is right to a reading."""
    white, black = Surface(1270.0, 5.0, 200), Surface(3800.0, 5.0, 200)
    found = TophatCalibration(Verdict.OK, "", white, black, 2500.0, 2400.0, 2600.0, flickers=hertz)
    for spike in (400.0, 2600.0):
        tophat = Tophat(found)
        edges = []
        for index in range(600):
            counts = 3800.0 if index >= 300 else 1270.0
            lamp = 20.0 * np.cos(2.0 * np.pi * hertz / RATE * index + 0.5)
            counts = spike if index in (150, 450) else counts
            edges.append(tophat.update(index / RATE, counts + lamp, None, 0.0012).edge)
        crossed = [each for each in edges if each is not None]
        assert [each.to_black for each in crossed] == [True]
        assert crossed[0].time == pytest.approx(299.5 / RATE, abs=1.0 / RATE)


def as_renewed(readings: int, phase: float) -> NDArray[np.float64]:
    """s at which words of RaccoonOS are of, which renews them every 4 ms."""
    at = np.arange(readings) / RATE
    return np.asarray(np.floor((at - phase) / 0.004) * 0.004 + phase)


@pytest.mark.parametrize("condition", SENSORS[:2], ids=name)
@pytest.mark.parametrize("flicker", [100.3, 119.7])
def test_words_that_come_unevenly_beat_otherwise(condition: TophatReading, flicker: float) -> None:
    sun = 0.02 * (1.0 + 0.8 * np.sin(2.0 * np.pi * flicker * as_renewed(1600, 0.001) + 1.0))
    wrong, _ = wrong_share(condition, sun, 1)
    assert wrong < 0.06  # a mean of 40 ms is 4 of the 12 readings of these lines late


@pytest.mark.parametrize("flicker", [100.3, 119.7])
def test_uneven_words_are_told(flicker: float) -> None:
    rng = np.random.default_rng(1)
    wave = 20.0 * np.sin(2.0 * np.pi * flicker * as_renewed(400, 0.0013) + 1.0)
    counts = 1000.0 + wave + rng.normal(0.0, 5.0, 400)
    assert detect_flicker_hz(counts) == UNEVEN_HZ
    assert np.std(average_out_flicker(counts, UNEVEN_HZ)) < 0.4 * np.std(counts)
    assert not is_restless(1000.0 + 5.0 * (counts - 1000.0))


@MAINS
def test_faint_lamps_over_even_readings_are_no_uneven_words(flicker: float, hertz: int) -> None:
    """Of a sensor that sees more noise than lamps one drive in ten was, and its answers came 40 ms late."""
    found = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noise, phase = rng.normal(0.0, 5.0, 600), rng.uniform(0.0, math.tau)
        even, uneven = np.arange(600) / RATE, as_renewed(600, float(rng.uniform(0.0, 0.004)))
        waves = (9.0 * np.sin(math.tau * flicker * at + phase) for at in (even, uneven))
        found.append(tuple(detect_flicker_hz(1000.0 + wave + noise) for wave in waves))
    assert set(found) == {(hertz, UNEVEN_HZ)}


@pytest.mark.parametrize("flicker", [100.3, 119.7])
def test_the_watch_over_uneven_words_looks_whether_the_lamps_still_burn(flicker: float) -> None:
    rng, watch, seen = np.random.default_rng(2), FlickerWatch(UNEVEN_HZ), []
    wave = 30.0 * np.sin(2.0 * np.pi * flicker * as_renewed(1600, 0.002))
    wave[400:1200] = 0.0
    for each in 1000.0 + wave + rng.normal(0.0, 4.0, 1600):
        watch.update(float(each))
        seen.append(watch.hertz)
    assert set(seen[200:400]) == set(seen[1500:]) == {UNEVEN_HZ}
    assert not any(seen[1050:1200])


def test_flicker_is_kept_with_the_calibration() -> None:
    rng = np.random.default_rng(3)
    condition = SENSORS[3]
    optics = reflectance.fit(condition.generation).at(condition.height)
    path = over_lines(2.5, rng, condition)
    sun = 0.02 * (1.0 + 0.3 * np.sin(2.0 * np.pi * 119.8 * np.arange(len(path)) / RATE))
    found = calibrate(reflectance.read(rng, path, optics, ambient=sun))
    assert found.verdict is Verdict.OK
    assert found.flickers == 120
    assert "flickers at 120 Hz" in found.reason


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


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("way", [[1.0, 0.0], [1.0, "air", 0.0], [0.0, "air", 1.0]], ids=str)
def test_a_robot_that_is_put_down_elsewhere_stands_on_what_it_reads(
    condition: TophatReading, way: list[float | str]
) -> None:
    """It took white for black in more light. Indoors no white is as dark as black."""
    rng = np.random.default_rng(4)
    model = reflectance.fit(condition.generation)
    optics, air = model.at(condition.height), model.at(0.06)
    tophat = Tophat(calibrate(reflectance.read(rng, over_lines(2.5, rng, condition), optics)))
    counts = np.concatenate(
        [
            reflectance.read(rng, np.zeros(100), air)
            if each == "air"
            else reflectance.read(rng, np.full(100, each), optics)
            for each in way
        ]
    )
    reading = [tophat.update(i / RATE, float(each), None, 0.0) for i, each in enumerate(counts)][-1]
    assert (reading.black, reading.status) == (way[-1] == 1.0, Status.OK)


@pytest.mark.parametrize(
    ("condition", "ambient", "tape"),
    [
        (each, ambient, tape)
        for number, each in enumerate(SENSORS)
        for ambient, tape in (((1.0, 0.9), (0.3, 1.0)) if number % 2 else ((1.0, 1.0), (0.3, 0.9)))
    ],
)
def test_calibrated_in_the_sun_and_used_indoors_it_is_right_after_two_lines(
    condition: TophatReading, ambient: float, tape: float
) -> None:
    """How far away the sensor sits is hardly known from a calibration in the sun: white indoors is not out
    of the question for that. tape: of the usual black's light."""
    rng = np.random.default_rng(1)
    optics = reflectance.fit(condition.generation).at(condition.height)
    tophat = Tophat(calibrate(darker(rng, over_lines(2.5, rng, condition), optics, ambient, tape)))
    radius, position = reflectance.spot_radius(condition.height), np.arange(0.0, 0.8, WAY)
    dark = sum(reflectance.line_coverage(position, each, 0.03, radius) for each in (0.2, 0.4, 0.6))
    counts = darker(rng, np.asarray(dark), optics, 0.0, tape)
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    wrong = (np.array(black) != (dark > 0.5)) & ((dark < 0.05) | (dark > 0.95))
    assert not wrong[position > 0.5].any()


@pytest.mark.parametrize("condition", SENSORS, ids=name)
@pytest.mark.parametrize("seed", [1, 2])
def test_single_readings_of_anything_at_all_are_no_change_of_light(
    condition: TophatReading, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    optics = reflectance.fit(condition.generation).at(condition.height)
    tophat = Tophat(calibrate(reflectance.read(rng, over_lines(2.5, rng, condition), optics)))
    dark = over_lines(6.0, rng, condition)
    counts = reflectance.read(rng, dark, optics)
    clear = (dark == 0.0) | (dark == dark.max())
    places = [each + pair for each in range(40, len(dark) - 12, 50) for pair in (0, 6 + seed)]
    spikes = [each for each in places if clear[each - 6 : each + 6].all()]
    counts[spikes] = rng.integers(5, 4080, len(spikes))
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    assert len(spikes) > 20
    assert not ((np.array(black) != (dark > 0.5)) & clear).any()
    assert tophat.levels.late_changes == 0


def test_where_lamps_flickered_lately_the_light_is_followed_by_every_reading_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An edge hides the lamps, and their swing looks like spikes to who does not see them."""
    told = []
    monkeypatch.setattr(LightTracker, "update", lambda _, *reading: told.append(reading))
    white, black = Surface(1270.0, 5.0, 200), Surface(3800.0, 5.0, 200)
    tophat = Tophat(TophatCalibration(Verdict.OK, "", white, black, 2500.0, 2400.0, 2600.0, flickers=120))
    monkeypatch.setattr(FlickerWatch, "update", lambda *_: None)
    for index in range(60):
        tophat.update(index / RATE, 1270.0, None, WAY)
    tophat._flicker.hertz = 0
    for index in range(60, 90):
        tophat.update(index / RATE, 1270.0 + 500.0 * (index % 5 == 0), None, WAY)
        assert len(told) == index + 1


@pytest.mark.parametrize("condition", SENSORS[:2], ids=name)
def test_a_sensor_that_was_put_higher_after_its_calibration_is_right_from_the_first_line_on(
    condition: TophatReading,
) -> None:
    """Its white then sends back less than it could at the height of the calibration."""
    rng = np.random.default_rng(3)
    model = reflectance.fit(condition.generation)
    near, far = model.at(condition.height), model.at(condition.height + 0.008)
    tophat = Tophat(calibrate(reflectance.read(rng, over_lines(2.5, rng, condition), near)))
    radius, position = reflectance.spot_radius(condition.height + 0.008), np.arange(0.0, 0.6, WAY)
    dark = sum(reflectance.line_coverage(position, each, 0.03, radius) for each in (0.15, 0.35, 0.5))
    counts = reflectance.read(rng, np.asarray(dark), far)
    readings = [tophat.update(i / RATE, float(each), None, WAY) for i, each in enumerate(counts)]
    wrong = np.array([each.black for each in readings]) != (dark > 0.5)
    assert not (wrong & ((dark < 0.05) | (dark > 0.95)))[position > 0.2].any()
    assert readings[0].status is Status.UNCERTAIN  # neither surface reads so
    assert readings[-1].status is Status.OK


def darker(
    rng: np.random.Generator, dark: NDArray[np.float64], optics: reflectance.Optics, sun: float, tape: float
) -> NDArray[np.float64]:
    """Readings over a tape that sends back `tape` of the usual black's light."""
    light = optics.light(dark, sun) - (1.0 - tape) * dark * optics.light(1.0, sun)
    return np.asarray(np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, len(dark))), 0, 4095))


@pytest.mark.parametrize("condition", SENSORS[1:], ids=name)
def test_put_down_in_another_light_a_robot_stands_on_white_rather_than_on_black(
    condition: TophatReading,
) -> None:
    """Readings between the levels of two lights fit white in one and black in another: most of a table is
    white. (An old sensor at 7 mm reads over white indoors what it reads over black in the sun.)"""
    rng = np.random.default_rng(2)
    optics = reflectance.fit(condition.generation).at(condition.height)
    tophat = Tophat(calibrate(reflectance.read(rng, over_lines(2.5, rng, condition), optics, ambient=0.3)))
    counts = reflectance.read(rng, np.zeros(60), optics)
    black = [tophat.update(i / RATE, float(each), None, WAY).black for i, each in enumerate(counts)]
    assert not any(black[20:])


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
