"""Following the light. The sensor is simulated here in few lines: light adds up, black swallows it."""

import numpy as np
import pytest

from raccoon.core.readings import Status
from raccoon.estimate.tophat import Tophat, TophatGroup, Verdict, calibrate
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, half_covered_counts
from raccoon.estimate.tophat.levels import Levels
from raccoon.estimate.tophat.sensor import explain_levels
from raccoon.model import reflectance
from raccoon.model.paper import tophat_reading

RATE = 200.0
LINE = np.concatenate([np.linspace(0, 1, 6)[1:-1], np.ones(9), np.linspace(1, 0, 6)[1:-1]])


def surface(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Share of the spot on black: a line every 0.6..1.6 s."""
    dark = np.zeros(int(seconds * RATE))
    at = 100
    while at + len(LINE) < len(dark):
        dark[at : at + len(LINE)] = LINE
        at += int(rng.integers(120, 320))
    return dark


def read(dark: np.ndarray, sun: np.ndarray | float, rng: np.random.Generator) -> np.ndarray:
    """A new sensor at 7 mm: 2.2 of own light on white, sun 26 on white, 15 on black."""
    light = 2.22 * (1 - 0.97 * dark) + 0.01 + sun * (26.0 - 10.8 * dark)
    return np.clip(np.round(4095 / (1 + light) + rng.normal(0, 3, len(dark))), 0, 4095)


def adapted(sun: np.ndarray, seed: int, *, adapt: bool = True) -> tuple[np.ndarray, np.ndarray, Tophat]:
    """(wrong, settled readings, classifier) of a drive through the light `sun` that starts calibrated."""
    rng = np.random.default_rng(seed)
    dark = surface(len(sun) / RATE, rng)
    tophat = Tophat(calibrate(read(surface(2.5, rng), float(sun[0]), rng)), adapt=adapt)
    counts = read(dark, sun, rng)
    black = [tophat.update(index / RATE, float(each)).black for index, each in enumerate(counts)]
    clear = (dark < 0.05) | (dark > 0.95)
    return (np.array(black) != (dark > 0.5)) & clear, clear, tophat


@pytest.mark.parametrize("sun", [0.0, 0.1, 1.0])
def test_steady_light_has_no_errors_and_no_jumps(sun: float) -> None:
    for seed in range(3):
        wrong, _, tophat = adapted(np.full(1600, sun), seed)
        assert not wrong[100:].any()
        assert tophat.levels.late_changes == 0


def test_cloud_is_followed() -> None:
    time = np.arange(2400) / RATE
    sun = np.interp(time, [1.0, 4.0, 7.0, 10.0], [1.0, 0.3, 0.3, 1.0])
    for seed in range(4):
        wrong, clear, _ = adapted(sun, seed)
        fixed, _, _ = adapted(sun, seed, adapt=False)
        assert wrong.sum() <= 0.01 * clear.sum()
        assert fixed.sum() > 0.3 * clear.sum()


def test_sun_patch_is_followed_at_once() -> None:
    time = np.arange(1600) / RATE
    sun = np.interp(time, [3.0, 3.1], [0.1, 1.0])
    for seed in range(4):
        wrong, clear, _ = adapted(sun, seed)
        later = time > 3.4
        assert wrong[later].sum() <= 0.01 * clear[later].sum()


def test_flicker_is_not_a_change() -> None:
    time = np.arange(2400) / RATE
    sun = 0.05 * (1 + 0.3 * np.sin(2 * np.pi * 100.3 * time))
    wrong, clear, _ = adapted(sun, 3)
    assert wrong.sum() <= 0.01 * clear.sum()  # the mean of two lags a reading behind at edges


def test_long_stay_on_one_surface_teaches_nothing_wrong() -> None:
    rng = np.random.default_rng(1)
    tophat = Tophat(calibrate(read(surface(2.5, rng), 0.0, rng)))
    for level in (0.0, 1.0, 0.0):
        counts = read(np.full(3000, level), 0.0, rng)
        states = [tophat.update(0.0, float(each)).black for each in counts]
        assert set(states[2:]) == {bool(level)}


def test_an_abyss_or_an_open_port_teaches_nothing() -> None:
    """Black near the top of the converter, then its top for a quarter of a minute: the light over both
    surfaces went to 0, and the program ended with a division by it."""
    white, black = Surface(1350.0, 20.0, 400), Surface(4066.0, 6.0, 400)
    tophat = Tophat(TophatCalibration.of_surfaces(Verdict.OK, "", white, black, 0.5))
    counts = [1350.0] * 100 + [4095.0] * 3300 + [1350.0] * 100
    read = [tophat.update(index / RATE, each, way=0.0005) for index, each in enumerate(counts)]
    assert not any(each.black for each in read[:100] + read[3420:])
    assert all(each.black for each in read[150:3400])
    assert tophat.levels.white == pytest.approx(1350.0, rel=0.15)


def test_switched_off_it_stays_what_it_was() -> None:
    rng = np.random.default_rng(1)
    tophat = Tophat(calibrate(read(surface(2.5, rng), 0.0, rng)), adapt=False)
    before = tophat.threshold
    for each in read(np.zeros(500), 0.5, rng):
        tophat.update(0.0, float(each))
    assert tophat.threshold == before


def test_status_says_when_black_is_only_guessed() -> None:
    """Sun over white: where black stands follows from a ratio that two sensor generations do not share."""
    rng = np.random.default_rng(4)
    tophat = Tophat(calibrate(read(surface(2.5, rng), 0.0, rng)))
    seen = [tophat.update(0.0, float(each)).status for each in read(np.zeros(200), 0.0, rng)]
    assert set(seen) == {Status.OK}
    ramp = np.interp(np.arange(300), [0, 20], [0.0, 1.0])
    told = [tophat.update(0.0, float(each)).status for each in read(np.zeros(300), ramp, rng)]
    assert Status.UNCERTAIN in told


def test_group_needs_a_reading_for_every_sensor() -> None:
    rng = np.random.default_rng(2)
    found = calibrate(read(surface(2.5, rng), 0.0, rng))
    group = TophatGroup([Tophat(found), Tophat(found)])
    left, right = group.update(0.0, [1270.0, 3800.0])
    assert (left.black, right.black) == (False, True)
    with pytest.raises(ValueError, match="zip"):
        group.update(0.005, [1270.0])


@pytest.mark.parametrize(
    ("white", "black", "generation", "height"),
    [
        (180, 2930, "old", 0.007),
        (50, 170, "old", 0.007),
        (140, 250, "new", 0.007),
        (3440, 4030, "new", 0.023),
    ],
)
def test_sensor_is_recognised(white: float, black: float, generation: str, height: float) -> None:
    found = explain_levels(white, black)
    assert found[0].generation == generation
    assert found[0].height == pytest.approx(height, rel=0.3)
    assert found[0].ambient == pytest.approx(1.0 if white < 145 and black < 300 else 0.0, abs=0.1)


def test_far_old_sensor_may_be_a_near_new_one() -> None:
    assert {each.generation for each in explain_levels(1830, 3810)} == {"old", "new"}


@pytest.mark.parametrize("black", [(3000.0, 10.0), (3000.0, 300.0), (1200.0, 50.0), (1200.0, 20.0)])
@pytest.mark.parametrize("white_sd", [10.0, 50.0, 100.0])
def test_threshold_and_band_are_where_a_calibration_puts_them(
    white_sd: float, black: tuple[float, float]
) -> None:
    """Where the surfaces are near each other: as many deviations from one as from the other."""
    white, dark = Surface(1000.0, white_sd, 400), Surface(*black, 400)
    levels, told = Levels(white, dark), TophatCalibration.of_surfaces(Verdict.OK, "", white, dark, 0.5)
    threshold = told.threshold
    if half_covered_counts(white, dark) is None:
        threshold = 1000.0 + (dark.mean - 1000.0) * white_sd / (white_sd + dark.sd)
    assert levels.threshold == pytest.approx(threshold, abs=1.5)
    low = max(levels.threshold - 1.5 * white_sd, 1000.0 + 0.6 * (levels.threshold - 1000.0))
    high = min(levels.threshold + 1.5 * dark.sd, dark.mean - 0.6 * (dark.mean - levels.threshold))
    assert (levels.low, levels.high) == pytest.approx((low, high), abs=1.0)


def test_two_readings_that_are_hardly_apart_are_not_taken_for_two_surfaces() -> None:
    levels = Levels(Surface(140.0, 3.0, 400), Surface(250.0, 3.0, 400))
    before = levels.threshold
    assert not levels.relearn(20.0, 29.0)
    assert levels.threshold == before
    assert levels.relearn(20.0, 40.0)
    assert (levels.white, levels.black) == pytest.approx((20.0, 40.0))


@pytest.mark.parametrize(
    ("speed", "sensor", "height", "floor"),
    [(0.03, "old", 0.007, 0.03), (0.05, "new", 0.023, 0.06), (0.1, "new", 0.023, 0.06)],
)
def test_slow_drive_over_lines_on_an_uneven_floor_in_steady_light(
    speed: float, sensor: str, height: float, floor: float
) -> None:
    """A spot that creeps sees one place of the floor for many readings: they are one, and so is an edge."""
    rng = np.random.default_rng(4)
    condition = tophat_reading(sensor, height, "normal")
    calibration = calibrate(reflectance.drive_over_line(rng, condition)[0])
    way = speed / RATE
    place = np.arange(0.0, 0.35, way)
    spot = reflectance.spot_radius(height)
    first, second = (reflectance.line_coverage(place, centre, 0.03, spot) for centre in (0.1, 0.25))
    dark = first + second
    uneven = np.exp(floor * np.sin(place / 0.02))
    light = reflectance.fit(sensor).at(height).light(dark) * uneven
    counts = np.clip(4095 / (1 + light) + rng.normal(0, 3, len(dark)), 0, 4095)
    tophat = Tophat(calibration)
    black = [tophat.update(at / RATE, float(each), None, way).black for at, each in enumerate(counts)]
    clear = (dark < 0.02) | (dark > 0.98)
    assert not ((np.array(black) != (dark > 0.5)) & clear).any()
