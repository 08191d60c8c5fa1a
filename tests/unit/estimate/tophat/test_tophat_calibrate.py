"""The cluster calibrator, on readings made here: nothing is shared with the code under test."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import norm

from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.estimate.tophat import Verdict, calibrate, calibrate_two_phase
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, best_threshold
from raccoon.estimate.tophat.mixture import best_mixture
from raccoon.estimate.tophat.quality import is_restless
from raccoon.estimate.tophat.standing_calibration import calibrate_standing
from raccoon.model.paper import TOPHAT_READINGS, TophatReading
from raccoon.model.reflectance import DISTANCE_PER_READING, LINE_WIDTH, fit, line_coverage, read, spot_radius

PAPER = [(180, 2930), (50, 170), (1270, 3800), (140, 250), (1830, 3810), (50, 130), (3440, 4030), (130, 220)]


def line_drive(rng: np.random.Generator, white: float, black: float, noise: float = 3.0) -> np.ndarray:
    """500 readings: floor, a ramp of 4, 9 on the line, a ramp of 4, floor."""
    shape = np.concatenate([[0.2, 0.4, 0.6, 0.8], np.ones(9), [0.8, 0.6, 0.4, 0.2]])
    start = rng.integers(100, 380)
    dark = np.zeros(500)
    dark[start : start + len(shape)] = shape
    return np.clip(np.round(white + (black - white) * dark + rng.normal(0.0, noise, 500)), 0, 4095)


@pytest.mark.parametrize(("white", "black"), PAPER)
def test_accepts_every_condition_of_the_paper(white: float, black: float) -> None:
    rng = np.random.default_rng(7)
    found = calibrate(line_drive(rng, white, black))
    assert found.verdict is Verdict.OK
    assert found.threshold is not None
    assert white + 15 < found.threshold < black - 15
    assert found.low is not None
    assert found.high is not None
    assert white < found.low < found.threshold < found.high < black
    low, high = found.probability_black([white, black])
    assert low < 0.001
    assert high > 0.999


def density(counts: float, surface: Surface) -> float:
    return math.exp(-0.5 * ((counts - surface.mean) / surface.sd) ** 2) / surface.sd


@pytest.mark.parametrize("white_sd", [30.0, 60.0, 200.0])
@pytest.mark.parametrize("black_sd", [30.0, 59.9, 60.0, 200.0])
def test_the_best_threshold_is_where_the_densities_cross(white_sd: float, black_sd: float) -> None:
    white, black = Surface(1000.0, white_sd, 100), Surface(1700.0, black_sd, 100)
    threshold = best_threshold(white, black)
    assert white.mean < threshold < black.mean
    assert density(threshold, white) == pytest.approx(density(threshold, black))


@pytest.mark.parametrize(("white_sd", "black_sd"), [(10.0, 300.0), (300.0, 10.0)])
def test_densities_that_do_not_cross_between_their_means_are_cut_as_far_from_both(
    white_sd: float, black_sd: float
) -> None:
    white, black = Surface(1000.0, white_sd, 100), Surface(1015.0, black_sd, 100)
    threshold = best_threshold(white, black)
    assert (threshold - white.mean) / white_sd == pytest.approx((black.mean - threshold) / black_sd)


@pytest.mark.parametrize(("white_sd", "black_sd"), [(20.0, 20.0), (20.0, 40.0), (40.0, 20.0)])
def test_the_odds_of_black_are_those_of_the_densities_around_the_threshold(
    white_sd: float, black_sd: float
) -> None:
    white, black = Surface(1000.0, white_sd, 100), Surface(1100.0, black_sd, 100)
    found = TophatCalibration.of_surfaces(Verdict.OK, "", white, black, 0.5)
    assert found.threshold is not None
    assert found.probability_black(found.threshold) == pytest.approx(0.5)
    for counts in (1010.0, 1090.0):
        black_odds = [density(each, black) / density(each, white) for each in (counts, found.threshold)]
        probability = float(found.probability_black(counts))
        assert probability / (1.0 - probability) == pytest.approx(black_odds[0] / black_odds[1])


@pytest.mark.parametrize(
    ("white", "black", "threshold"),
    [
        (Surface(1000.0, 10.0, 9), Surface(3000.0, 10.0, 9), 1500.0),  # light 3.095 and 0.365, half is 1.73
        (Surface(1000.0, 100.0, 9), Surface(3000.0, 10.0, 9), 1600.0),
        (Surface(1000.0, 10.0, 9), Surface(3000.0, 300.0, 9), 1200.0),
    ],
)
def test_the_threshold_is_where_half_of_the_spot_is_black_but_six_deviations_from_both(
    white: Surface, black: Surface, threshold: float
) -> None:
    found = TophatCalibration.of_surfaces(Verdict.OK, "", white, black, 0.5)
    assert found.threshold == pytest.approx(threshold)
    assert (found.low, found.high) == pytest.approx(
        (threshold - 1.5 * white.sd, threshold + 1.5 * black.sd), rel=1e-12
    )


def test_the_band_leaves_most_of_the_way_to_each_surface_outside() -> None:
    found = TophatCalibration.of_surfaces(
        Verdict.WEAK, "", Surface(1000.0, 50.0, 9), Surface(1200.0, 50.0, 9), 0.5
    )
    assert (found.low, found.threshold, found.high) == pytest.approx((1060.0, 1100.0, 1140.0))


def test_separation_share_and_error_are_those_of_the_data() -> None:
    rng = np.random.default_rng(3)
    samples = np.concatenate([rng.normal(300, 40, 1500), rng.normal(600, 60, 500)])
    found = calibrate(rng.permutation(samples))
    assert found.verdict is Verdict.OK
    assert found.separation == pytest.approx(3.0, rel=0.05)
    assert found.share_black == pytest.approx(0.25, abs=0.01)
    assert found.error_rate == pytest.approx(0.00125, rel=0.35)  # the densities cross near 419


def on_white(rng: np.random.Generator, white: float, begin: int, end: int, times: float) -> np.ndarray:
    """500 readings of a floor that sends back so many times its light between two of them."""
    light = np.full(500, 4095.0 / white - 1.0) * np.exp(0.02 * rng.standard_normal(500))
    light[begin:end] *= times
    return np.clip(np.round(4095.0 / (1.0 + light) + rng.normal(0.0, 3.0, 500)), 0, 4095)


@pytest.mark.parametrize("white", [white for white, _ in PAPER])
@pytest.mark.parametrize("times", [0.68, 0.8])
def test_another_board_is_no_black_line(white: float, times: float) -> None:
    found = calibrate(on_white(np.random.default_rng(7), white, 300, 500, times))
    assert found.verdict is Verdict.ONE_SURFACE
    if white > 100:  # in the sun an old sensor cannot tell that there were two boards
        assert "a board or a seam, not a line" in found.reason


@pytest.mark.parametrize("white", [180, 1270, 3440])
def test_glare_on_a_white_floor_is_said_where_no_line_was_seen(white: float) -> None:
    found = calibrate(on_white(np.random.default_rng(7), white, 300, 330, 2.2))
    assert found.verdict is Verdict.WEAK
    assert "glare" in found.reason


@pytest.mark.parametrize("drift", [550.0, -550.0])
def test_a_line_in_a_light_that_drifts_by_more_than_it_is_darker_is_found_in_the_light_of_the_end(
    drift: float,
) -> None:
    rng = np.random.default_rng(7)
    found = calibrate(line_drive(rng, 600.0, 900.0) + np.linspace(-drift, 0.0, 500))
    assert found.verdict is Verdict.WEAK  # it is soon wrong again
    assert "drifted by" in found.reason
    assert found.white is not None
    assert found.black is not None
    assert found.black.mean - found.white.mean == pytest.approx(300.0, abs=60.0)
    # The floor is the median of some readings before: behind the light by what it drifts in half of them.
    assert found.white.mean == pytest.approx(600.0, abs=0.15 * abs(drift))


@pytest.mark.parametrize(
    "floor",
    [
        lambda rng: rng.normal(1000, 60, 500),
        lambda rng: rng.uniform(800, 1200, 500),
        lambda rng: 800 + rng.gamma(2.0, 40.0, 500),
        lambda rng: 1500 + 40 * rng.standard_t(3, 500),
        lambda rng: 1000 + np.linspace(0, 300, 500) + rng.normal(0, 5, 500),
    ],
    ids=["gaussian", "uniform", "skewed", "heavy-tailed", "drifting"],
)
def test_bare_floor_gives_no_threshold(floor: Callable[[np.random.Generator], np.ndarray]) -> None:
    for seed in range(2):
        found = calibrate(np.clip(floor(np.random.default_rng(seed)), 0, 4095))
        assert found.verdict is Verdict.ONE_SURFACE
        assert found.threshold is None
        with pytest.raises(CalibrationError, match="one_surface"):
            found.probability_black([1000.0])


def test_rare_line_on_an_uneven_floor() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        samples = np.concatenate([rng.normal(300, 100, 490).clip(0), rng.normal(1000, 20, 10)])
        found = calibrate(samples)
        assert found.usable
        assert 600 < (found.threshold or 0) < 980


@pytest.mark.parametrize(
    ("samples", "verdict"),
    [
        ([], Verdict.TOO_FEW),
        ([100.0] * 10, Verdict.TOO_FEW),
        ([777.0] * 300, Verdict.ONE_SURFACE),
        ([0.0] * 300, Verdict.SATURATED),
        ([4095.0] * 295 + [3000.0] * 5, Verdict.SATURATED),
        ([10.0 * step for step in range(400)], Verdict.ONE_SURFACE),
    ],
)
def test_hopeless_readings_get_a_named_verdict(samples: list[float], verdict: Verdict) -> None:
    found = calibrate(samples)
    assert found.verdict is verdict
    assert found.threshold is None
    assert found.reason


def test_open_input_is_floating() -> None:
    found = calibrate(np.random.default_rng(0).uniform(0, 4095, 500))
    assert found.verdict is Verdict.FLOATING


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        ([100.0] * 50 + [float("nan")], r"samples\[50\] = nan"),
        ([100.0, 4096.0], r"samples\[1\] = 4096"),
        ([-1.0], r"samples\[0\] = -1"),
        ([[1.0, 2.0]], "shape"),
        (["white"], "not numbers"),
    ],
)
def test_impossible_readings_are_refused(samples: list[object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        calibrate(samples)  # type: ignore[arg-type]


def test_two_phases() -> None:
    rng = np.random.default_rng(9)
    found = calibrate_two_phase(rng.normal(1270, 18, 200), rng.normal(3800, 9, 200))
    assert found.verdict is Verdict.OK
    assert found.white is not None
    assert found.white.mean == pytest.approx(1270, abs=5)
    same = calibrate_two_phase(rng.normal(1270, 18, 200), rng.normal(1275, 18, 200))
    assert same.verdict is Verdict.ONE_SURFACE
    assert calibrate_two_phase([], rng.normal(3800, 9, 200)).verdict is Verdict.TOO_FEW


@pytest.mark.parametrize(
    ("floor", "line", "verdict"),
    [
        (0.0, 500.0, Verdict.WEAK),  # in the sun: a change of the light is seen late
        (500.0, 4095.0, Verdict.WEAK),  # the line swallows all light, or the plug is loose
        (0.0, 4095.0, Verdict.SATURATED),
        (4095.0, 4095.0, Verdict.SATURATED),
    ],
)
def test_one_of_two_phases_may_stand_at_an_end_of_the_converter(
    floor: float, line: float, verdict: Verdict
) -> None:
    rng = np.random.default_rng(9)
    phases = [np.clip(rng.normal(mean, 5.0 * (0.0 < mean < 4095.0), 100), 0, 4095) for mean in (floor, line)]
    assert calibrate_two_phase(*phases).verdict is verdict


def test_one_normal_surface_is_one_component() -> None:
    ordered = np.sort(np.random.default_rng(4).normal(1000.0, 20.0, 400))
    found = best_mixture(ordered)
    assert [each.mean for each in found.components] == pytest.approx([1000.0], abs=3.0)
    likelihood = norm.logpdf(ordered, ordered.mean(), ordered.std()).sum()
    assert found.bic == pytest.approx(-2.0 * likelihood + 2.0 * math.log(400), rel=1e-4)


@pytest.mark.parametrize("hertz", [0.0, 100.2, 119.8])
def test_one_that_is_plugged_in_is_calm_while_the_robot_stands(hertz: float) -> None:
    random = np.random.default_rng(1)
    time = 0.005 * np.arange(80)
    lamp = 200.0 * np.sin(2.0 * np.pi * hertz * time + 1.0)
    shadow = np.where(time > 0.2, -600.0, 0.0) - 800.0 * time
    assert not is_restless(1500.0 + random.normal(0.0, 5.0, 80) + lamp + shadow)
    wandering = np.cumsum(random.normal(0.0, 15.0, 80))
    assert is_restless(1500.0 + wandering)
    assert not is_restless(1500.0 + wandering[:20])


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_second_surface_at_the_top_of_the_converter_may_be_a_loose_wire(share: float) -> None:
    rng = np.random.default_rng(4)
    floor = rng.normal(1270.0, 4.0, 600)
    loose = np.where(np.arange(600) < 600 * (1.0 - share), floor, 4095.0)
    for counts in (loose, rng.permutation(loose)):
        found = calibrate(counts)
        assert found.verdict is Verdict.WEAK
        assert "loose wire" in found.reason
    assert calibrate(np.where(loose == 4095.0, 4060.0, loose)).verdict is Verdict.OK


@pytest.mark.parametrize("seed", range(4))
def test_edges_widen_no_surface(seed: int) -> None:
    """The first readings of an edge to what is ten times as dark are many times what white's noise is."""
    edge = [0.05, 0.2, 0.5, 0.8, 0.95]
    dark = np.concatenate([np.zeros(200), edge, np.ones(9), edge[::-1], np.zeros(280)])
    counts = 4095 / (1 + 21.75 * (1 - 0.98 * dark)) + np.random.default_rng(seed).normal(0.0, 3.0, len(dark))
    white, _ = calibrate(counts).surfaces()
    assert white.sd == pytest.approx(3.0, rel=0.2)


def test_surface_of_many_readings_keeps_its_spread_beside_a_wide_one() -> None:
    rng = np.random.default_rng(3)
    white, black = calibrate_two_phase(rng.normal(200, 4, 500), rng.normal(2500, 300, 100)).surfaces()
    assert white.sd == pytest.approx(4.0, rel=0.2)
    assert black.sd == pytest.approx(300.0, rel=0.3)


@pytest.mark.parametrize("seed", range(4))
def test_beginnings_of_edges_hide_no_narrow_line(seed: int) -> None:
    """Four readings that no surface gives, beside eight of the line, looked like one wide surface."""
    line = [1420, 1714, 2375, 3378, 3788, 3790, 3793, 3796, 3788, 3801, 3804, 3803, 3602, 2535, 1810, 1420]
    counts = np.random.default_rng(seed).normal(1262.0, 17.0, 500)
    counts[200 : 200 + len(line)] = line
    white, black = calibrate(counts).surfaces()
    assert white.mean == pytest.approx(1262.0, abs=5.0)
    assert black.mean == pytest.approx(3796.0, abs=60.0)


@pytest.mark.parametrize(
    "condition", TOPHAT_READINGS[::2], ids=lambda each: f"{each.generation}-{each.height}"
)
def test_what_is_narrower_than_any_line_is_a_seam_where_the_way_is_known(condition: TophatReading) -> None:
    """However dark: a spot of 5 to 10 mm sees 3 mm of nothing as 9 mm at the most, and a tape as wide as it
    is."""
    rng = np.random.default_rng(5)
    optics, radius = fit(condition.generation).at(condition.height), spot_radius(condition.height)
    position = np.arange(0.0, 0.6, DISTANCE_PER_READING)
    ways = np.full(len(position), DISTANCE_PER_READING)
    seam = read(rng, 0.95 * line_coverage(position, 0.3, 0.003, radius), optics)
    tape = read(rng, line_coverage(position, 0.3, LINE_WIDTH, radius), optics)
    assert calibrate(seam, ways).verdict is Verdict.ONE_SURFACE
    assert calibrate(tape, ways) == calibrate(tape)
    assert calibrate(tape, ways).usable
    with pytest.raises(ConfigError, match="ways have the shape"):
        calibrate(tape, ways[1:])


@pytest.mark.parametrize(
    ("level", "said"),
    [
        (8.0, "too bright for the sensor"),
        (1270.0, "drive over white and black"),
        (4040.0, "too high above"),
    ],
)
def test_who_saw_one_surface_is_told_what_it_may_be(level: float, said: str) -> None:
    """White reads 1270 at 7 mm, 8 in sunlight that is twenty times the paper's, and 4040 at 50 mm."""
    counts = np.round(np.random.default_rng(2).normal(level, 3.0, 400))
    assert said in calibrate(counts).reason


@pytest.mark.parametrize(("covered", "verdict"), [(0.5, Verdict.WEAK), (1.0, Verdict.OK)])
def test_a_sensor_that_was_half_beside_the_line_is_weak(covered: float, verdict: Verdict) -> None:
    noise, optics = np.random.default_rng(3).normal(0.0, 3.0, 200), fit("new").at(0.007)
    white, black = (np.round(optics.counts(each) + noise) for each in (0.0, covered))
    found = calibrate_standing(white, black)
    assert found.verdict is verdict
    assert ("half beside the line" in found.reason) is (verdict is Verdict.WEAK)
