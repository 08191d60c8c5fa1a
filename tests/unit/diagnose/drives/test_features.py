"""What of a recording is compared."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import BIN_S, SETTLING_S, Features, bin_width, without_empty_channels
from raccoon.diagnose.drives.log import Channel, Log

Array = NDArray[np.float64]
TIME: Array = np.linspace(0.0, 9.995, 2000, dtype=np.float64)


def bins_of(values: Array, role: str = "bemf_left") -> Array:
    log = Log(TIME, np.zeros((len(TIME), 2)), (Channel("motor.0.bemf", role, "counts", values, 1.0),))
    return Features.of(log).measured[:, 0]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_counts_are_taken_for_what_they_were_before_they_were_cut(sign: float) -> None:
    speeds = sign * (150.0 + 100.0 * np.sin(TIME))
    assert np.mean(bins_of(np.trunc(speeds)) - bins_of(speeds + 1e-9)) == pytest.approx(0.0, abs=0.02)


def test_a_silent_reading_stays_silent_and_one_with_a_fraction_as_it_is() -> None:
    assert not bins_of(np.zeros(len(TIME))).any()
    assert bins_of(np.full(len(TIME), 20.25)) == pytest.approx(20.25)
    assert bins_of(np.full(len(TIME), 3.0), role="battery") == pytest.approx(3.0)


def test_counts_that_are_missing_do_not_make_the_others_fractions() -> None:
    values = np.full(len(TIME), -20.0)
    values[::3] = np.nan
    assert bins_of(values) == pytest.approx(-20.5)


def test_a_channel_without_readings_of_what_is_compared_is_missing() -> None:
    """It was an IndexError: a battery that was read until the robot drove off."""
    counts = Channel("motor.0.bemf", "bemf_left", "counts", np.sin(TIME), 1.0)
    volts = np.where((TIME < 0.25) | ((TIME > 4.0) & (TIME < 5.0)), 6.8, np.nan)
    log = Log(
        TIME, np.zeros((len(TIME), 2)), (counts, Channel("battery.voltage", "battery", "V", volts, 0.004))
    )
    assert without_empty_channels(log) is log
    kept = without_empty_channels(replace(log, lost=((3.9, 5.1),)))
    assert [each.role for each in kept.channels] == ["bemf_left"]
    assert kept.missing == ("battery.voltage",)
    assert kept.notes[0].startswith("battery.voltage: next to no readings are left")
    assert Features.of(kept).measured.shape[1] == 1


def test_bins_are_means_and_lines_over_what_is_missing() -> None:
    """Against the definition, sample by sample, with times that jitter and gaps of many bins."""
    rng = np.random.default_rng(6)
    time = np.sort(TIME + rng.uniform(-0.002, 0.002, len(TIME)))
    values = rng.normal(size=len(time))
    values[rng.random(len(time)) < 0.4] = np.nan
    values[500:560] = np.nan
    log = Log(time, np.zeros((len(time), 2)), (Channel("battery.voltage", "battery", "V", values, 0.004),))
    features = Features.of(log)
    edges = time[0] + SETTLING_S + BIN_S * np.arange(len(features.time) + 1)
    means = np.full(len(features.time), np.nan)
    for index, (low, high) in enumerate(pairwise(edges)):
        inside = values[(time >= low) & (time < high) & np.isfinite(values)]
        means[index] = inside.mean() if inside.size else np.nan
    known = np.isfinite(means)
    assert 0.7 < known.mean() < 0.99
    expected = np.interp(np.arange(len(means)), np.flatnonzero(known), means[known])
    np.testing.assert_allclose(features.measured[:, 0], expected, atol=1e-12)
    lanes = np.stack([np.nan_to_num(values), 2.0 * np.nan_to_num(values)])[:, None]
    np.testing.assert_allclose(features.simulated(lanes)[:, :, 0], [expected, 2.0 * expected], atol=1e-12)


def test_what_is_kept_of_a_log_goes_with_it() -> None:
    """Four logs and their bins stayed in memory after a diagnosis."""
    log = Log(TIME, np.zeros((len(TIME), 2)), (Channel("battery.voltage", "battery", "V", TIME, 0.004),))
    kept = Features.cached(log, BIN_S)
    assert Features.cached(log, BIN_S) is kept
    assert Features.cached(log, 2.0 * BIN_S) is not kept
    alive = weakref.ref(log), weakref.ref(kept.measured)
    del log, kept
    gc.collect()
    assert [each() for each in alive] == [None, None]


def commanded(duty: Array) -> Log:
    """A drive with this duty at both wheels, every 5 ms."""
    return Log(TIME, np.column_stack([duty, duty]), ())


def test_bins_are_usual_where_no_loop_answers() -> None:
    duty = np.where(TIME < 5.0, 0.4, -0.3)
    duty[:200] = 0.0
    duty[200:300] = np.linspace(0.0, 0.4, 100)  # a ramp says nothing of a loop
    assert bin_width(commanded(duty)) == BIN_S
    assert bin_width(commanded(np.zeros(len(TIME)))) == BIN_S


@pytest.mark.parametrize(("rows", "seconds"), [(1, 0.005), (2, 0.01), (8, BIN_S)])
def test_bins_are_no_longer_than_a_loop_takes_to_answer(rows: int, seconds: float) -> None:
    steady = 0.4 + 0.01 * np.random.default_rng(1).normal(size=len(TIME))
    duty = np.repeat(steady[::rows], rows)[: len(TIME)]
    duty[:600] = 0.0  # before and after it the robot stands
    duty[-600:] = 0.0
    assert bin_width(commanded(duty)) == pytest.approx(seconds)
