"""How readings under a dead zone are compared with simulated ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blind.generator import Noise, make
from blind.hidden import draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.censored_readings import (
    IMPOSSIBLE_READING_FACTOR,
    censor_readings,
    find_flickers,
)
from raccoon.diagnose.rollout.dead_zone_evidence import (
    MAX_SHARE_IN_GAP,
    ReadingGaps,
    _share_below,
    find_gap,
    without_ruled_out_zones,
)
from simulated_drives import BLIND_CONTROLLER

ROBOT = RobotConfig()


def test_a_silent_reading_says_that_the_speed_is_inside_the_zone_and_no_more() -> None:
    samples = np.array([[3.0, 14.0, -14.0, 14.0, -5.0, 7.0]])
    measured = np.array([0.0, 0.0, 0.0, 12.0, -2.0, np.nan])
    steady = np.zeros(6, bool)
    (none,) = censor_readings(samples, np.array([[0.0]]), measured, steady)
    np.testing.assert_array_equal(none, samples[0])
    (zone,) = censor_readings(samples, np.array([[10.0]]), measured, steady)
    np.testing.assert_array_equal(zone, [0.0, 4.0, -4.0, 14.0, -5.0 - 7.5 * IMPOSSIBLE_READING_FACTOR, 7.0])


def test_a_filter_that_leaves_0_late_is_silent_up_to_there() -> None:
    samples, measured, steady = np.array([[30.0, -45.0, 30.0, 8.0]]), np.array([0.0, 0.0, 30.0, 8.0]), False
    said = censor_readings(samples, np.array([[11.5]]), measured, np.full(4, steady), silent=40.0)
    np.testing.assert_allclose(said, [[0.0, -5.0, 30.0, 8.0 + IMPOSSIBLE_READING_FACTOR * 3.0]])
    none = censor_readings(samples, np.array([[0.0]]), measured, np.full(4, steady), silent=40.0)
    np.testing.assert_array_equal(none, samples)


def test_whole_counts_are_no_dead_zone() -> None:
    samples, measured = np.array([[0.6, -0.9]]), np.array([0.0, 0.0])
    np.testing.assert_array_equal(
        censor_readings(samples, np.array([[1.0]]), measured, np.zeros(2, bool)), samples
    )


def test_a_reading_that_noise_lifts_out_of_the_zone_says_what_a_silent_one_says() -> None:
    measured = np.zeros(200)
    measured[[50, 51, 120]] = -11.0  # far from an offset of -4, and away from 0 as noise can only be here
    measured[160:] = 30.0
    measured[130] = np.nan
    flickers = find_flickers(measured)
    assert list(np.flatnonzero(flickers)) == [50, 51, 120]
    samples = np.where(measured == 30.0, 29.0, -4.0)[None]
    (inside,) = censor_readings(samples, np.array([[10.0]]), measured, flickers)
    np.testing.assert_array_equal((measured - inside)[:130], 0.0)
    np.testing.assert_array_equal(inside[160:], 29.0)
    (outside,) = censor_readings(samples - 8.0, np.array([[10.0]]), measured, flickers)
    np.testing.assert_array_equal((measured - outside)[:130], 2.0)
    np.testing.assert_array_equal(censor_readings(samples, np.array([[0.0]]), measured, flickers), samples)


@pytest.mark.parametrize("width", [0.5, 8.0, 13.0, 14.0, 20.0, 60.0])
def test_nothing_jumps_over_the_width_of_a_zone(width: float) -> None:
    rng = np.random.default_rng(2)
    samples, measured = 40.0 * rng.standard_normal((1, 500)), 40.0 * rng.standard_normal(500)
    measured[np.abs(measured) < 13.5] = 0.0
    steady = np.zeros(500, bool)
    before, after = (
        censor_readings(samples, np.array([[width + each]]), measured, steady) for each in (-1e-6, 1e-6)
    )
    assert np.abs(after - before).max() <= 2.1e-6 * IMPOSSIBLE_READING_FACTOR


def test_a_small_dead_zone_is_found_and_nothing_beside_it() -> None:
    """Though wheels stop a moment early or late. While readings did not say how small it is, a slope was
    named with it where there is twice the noise."""
    hidden = draw("bemf.dead_zone", np.random.default_rng(7), size=0.2)
    made = make(7, [hidden], seconds=12.0, noise=Noise().times(2.0))
    (cause,) = diagnose(made.columns, ROBOT, firmware=BLIND_CONTROLLER).causes
    assert cause.name == hidden.name
    zone = cause.parameters["counts"]
    assert abs(zone.value - hidden.values["counts"]) < 2.0 * zone.std


ZONES = {"bemf.dead_zone", "bemf.dead_zone@left", "bemf.dead_zone@right"}


@pytest.mark.parametrize(
    ("left", "right", "asked"),
    [
        (0.0, 0.0, ZONES),
        (5.0, 5.0, {"bemf.dead_zone"}),
        (5.0, 0.0, {"bemf.dead_zone@left"}),
        (0.0, 12.0, {"bemf.dead_zone@right"}),
        (30.0, 8.0, {"bemf.dead_zone@left", "bemf.dead_zone@right"}),
    ],
)
@pytest.mark.parametrize("drive", ["exciting", "contest"])
def test_the_readings_say_which_wheels_have_a_dead_zone(
    left: float, right: float, asked: set[str], drive: str
) -> None:
    columns = dict(make(7, drive=drive, seconds=30.0).columns)
    for name, zone in (("motor.0.bemf", left), ("motor.1.bemf", right)):
        columns[name] = np.where(np.abs(columns[name]) > zone, columns[name], 0.0)
    every = drive_causes()
    kept = {each.name for each in without_ruled_out_zones(every, log_from_columns(columns, ROBOT))}
    assert kept == {each.name for each in every} - ZONES | asked


@pytest.mark.parametrize("drive", ["exciting", "contest"])
@pytest.mark.parametrize("seed", [15, 16, 17])
def test_the_smallest_reading_shows_how_wide_a_zone_is(drive: str, seed: int) -> None:
    """In 10 s as well, where a misfit is the same from 45 to 66 counts: 45.5 +- 4.4 was reported of 64.6."""
    hidden = draw("bemf.dead_zone", np.random.default_rng(seed))
    made = make(seed, [hidden], drive=drive, seconds=10.0)
    width, std = ReadingGaps.of(log_from_columns(made.columns, ROBOT)).width(None)
    assert abs(width - hidden.values["counts"]) < 2.5 * std
    assert std < 2.0


def test_a_single_reading_does_not_show_how_wide_a_zone_is() -> None:
    stray, silent = np.zeros(400), np.zeros(400)
    stray[0], stray[20], stray[60:] = 900.0, 4.0, 3.0
    assert ReadingGaps({"left": stray, "right": silent}, {}).width(None) == (0.0, np.inf)
    assert ReadingGaps({"left": silent, "right": silent}, {}).width("left") == (0.0, np.inf)


@given(st.integers(0, 2**32 - 1), st.integers(2, 60))
def test_a_gap_is_as_wide_as_the_readings_that_are_missing(seed: int, zone: int) -> None:
    """Of readings that are as frequent below as above, a tenth of whose width is as many as chance needs."""
    sizes = np.random.default_rng(seed).exponential(80.0, 20000).astype(int)
    assert find_gap(np.bincount(sizes, minlength=400).astype(float)) == 0
    heard_ones = np.where(sizes >= zone, sizes, 0)
    assert zone <= find_gap(np.bincount(heard_ones, minlength=400).astype(float)) <= 1.15 * zone + 1.0


def test_a_robot_that_hardly_drives_slowly_says_nothing_of_dead_zones() -> None:
    """At 200 counts nearly all the time, and through what is below in some samples."""
    sizes = np.concatenate([np.full(4000, 200), np.arange(0, 200, 9), np.arange(4, 200, 9)])
    assert find_gap(np.bincount(sizes, minlength=400).astype(float)) == 0


def test_a_wheel_of_which_little_is_known_has_the_zone_of_the_other() -> None:
    clear, few = np.zeros(400), np.zeros(400)
    clear[[0, 3, 4, 5, 6, 7]], few[[0, 3, 4, 5, 6, 7]] = 40.0, 8.0
    gaps = ReadingGaps({"left": clear, "right": few}, {"left": find_gap(clear), "right": find_gap(few)})
    assert gaps.widths == {"left": 3, "right": 0}
    assert gaps.places() == (None, "left")
    assert gaps.evidence("left") < gaps.evidence(None)
    few[1:3] = 8.0  # now it has what the other one lacks
    assert gaps.evidence("left") > gaps.evidence(None)


def test_the_widest_gap_is_found_by_looking_at_few_widths() -> None:
    """As by looking at all: the quick bound leaves none out, nor where a quarter of the sizes never comes."""
    rng, found = np.random.default_rng(4), 0
    for _ in range(60):
        zone, seldom = rng.integers(2, 40), rng.uniform(0.0, 0.3)
        histogram = np.where(rng.random(200) < seldom, 0.0, 12.0)
        histogram[1:zone] = np.where(rng.random(zone - 1) < 0.1, 11.0, 0.0)
        every = [each for each in range(2, 100) if _share_below(histogram, each) <= MAX_SHARE_IN_GAP]
        assert find_gap(histogram) == max(every, default=0)
        found += bool(every)
    assert found > 20
