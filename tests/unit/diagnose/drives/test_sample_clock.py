"""Samples by a clock of their own: when they were taken, and what was in force, told by counters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from raccoon.diagnose.drives.sample_clock import (
    SampleClock,
    count_arrivals,
    count_by_ticks,
    find_sample_clock,
    resample_to_one_age,
    resample_wheel_to_one_age,
)

Array = NDArray[np.float64]

ROW, SECONDS = 0.005, 20.0
TIME = np.arange(0.0, SECONDS, ROW)
TICK = 250.0


def rows_of(count: int) -> Array:
    return np.linspace(0.0, ROW * (count - 1), count)


def speed(time: Array) -> Array:
    """Counts of a wheel that speeds up and brakes by thousands a second, both ways."""
    return 900.0 * np.sin(5.0 * time) + 500.0 * np.sin(2.1 * time + 1.0)


@dataclass(frozen=True)
class Made:
    """What rows show of samples at those moments. mean: of the rows' samples."""

    moments: Array
    bemf: Array
    mean: Array
    position: Array


def made(rate: float, drift: float = 0.0, jitter: float = 0.0, seed: int = 1, rows: Array = TIME) -> Made:
    """Samples that come by a rate that swings by a part, each a little off, as rows at those times show
    them."""
    even = np.arange(-0.1, SECONDS, 1.0 / rate) + 0.0013
    moments = even + drift / 1.5 * np.sin(1.5 * even)
    moments = np.sort(moments + jitter * np.random.default_rng(seed).standard_normal(len(even)))
    values = speed(moments)
    sums = np.concatenate([[0.0], np.cumsum(values)])
    latest = np.searchsorted(moments, rows, side="right")
    before = np.concatenate([[latest[0] - 1], latest[:-1]])
    several = np.maximum(latest - before, 1)
    mean = (sums[latest] - sums[latest - several]) / several
    return Made(moments, values[latest - 1], mean, sums[latest] / TICK)


@pytest.mark.parametrize("rate", [181.0, 187.3, 235.0, 262.0])
@pytest.mark.parametrize(("drift", "jitter"), [(0.0, 0.0), (0.002, 0.0001)])
def test_rows_without_a_sample_or_with_two_tell_when_all_were_taken(
    rate: float, drift: float, jitter: float
) -> None:
    seen = made(rate, drift, jitter)
    rates = (172.0, 199.0) if rate < 200.0 else (225.0, 275.0)
    clock = find_sample_clock(TIME, count_by_ticks(TIME, seen.bemf, seen.position, TICK), rates)
    assert clock is not None
    assert 1.0 / clock.period == pytest.approx(rate, abs=0.4 if drift else 0.05)
    _, latest = clock.latest_samples(TIME)
    true = seen.moments[np.searchsorted(seen.moments, TIME, side="right") - 1]
    off = (latest - true + 0.5 * clock.period) % clock.period - 0.5 * clock.period
    assert np.abs(off).max() < 0.0004 + 10.0 * jitter
    assert np.median(np.abs(off)) < 0.0001 + 2.0 * jitter

    even = resample_wheel_to_one_age(clock, TIME, seen.bemf, seen.position, TICK)
    wanted = speed(TIME - 0.5 * clock.period)
    loud = np.abs(wanted) > 5.0
    size = np.std((seen.bemf - wanted)[loud])
    assert np.std((even - wanted)[loud]) < (0.6 if jitter else 0.25) * size

    summed = resample_wheel_to_one_age(clock, TIME, seen.mean, seen.position, TICK, sums=True)
    assert np.std((summed - wanted)[loud]) < (0.6 if jitter else 0.4) * size


@pytest.mark.parametrize("row", [0.01, 0.02])
def test_rows_of_several_cycles_are_no_clock(row: float) -> None:
    """Rows of 20 ms have one phase at 250 samples a second, whatever the clock is."""
    time = np.arange(0.0, SECONDS, row)
    seen = made(235.0, rows=time)
    whole_ticks = np.trunc(seen.position)
    clock = find_sample_clock(time, count_by_ticks(time, seen.bemf, whole_ticks, TICK), (225.0, 275.0))
    assert clock is not None
    assert 1.0 / clock.period == pytest.approx(235.0, abs=0.05)


def test_a_channel_that_says_when_it_has_a_new_sample_has_a_clock_too() -> None:
    seen = made(188.0)
    number = np.searchsorted(seen.moments, TIME, side="right")
    gyro = np.where(np.diff(number, prepend=0) > 0, seen.bemf, np.nan)
    clock = find_sample_clock(TIME, count_arrivals(TIME, gyro), (170.0, 199.0))
    assert clock is not None
    even = resample_to_one_age(clock, TIME, gyro)
    assert (np.isnan(even) == np.isnan(gyro)).all()
    wanted = speed(TIME - 0.5 * clock.period)
    assert np.nanstd(even - wanted) < 0.2 * np.nanstd(gyro - wanted)


def test_what_tells_no_clock_has_none() -> None:
    stands = np.zeros_like(TIME)
    assert find_sample_clock(TIME, count_by_ticks(TIME, stands, stands, TICK), (172.0, 199.0)) is None
    in_step = made(200.0)
    rows = count_by_ticks(TIME, in_step.bemf, in_step.position, TICK)
    assert find_sample_clock(TIME, rows, (172.0, 199.0)) is None
    random = np.random.default_rng(2)
    late = made(181.0)
    rows = count_by_ticks(TIME, late.bemf, random.permutation(late.position), TICK)
    assert find_sample_clock(TIME, rows, (172.0, 199.0)) is None
    known = np.isfinite(random.choice([1.0, np.nan], len(TIME), p=[0.9, 0.1]))
    gyro = np.where(known, 1.0, np.nan)
    assert find_sample_clock(TIME, count_arrivals(TIME, gyro), (170.0, 199.0)) is None


def test_a_dead_zone_is_left_as_it_is() -> None:
    seen = made(181.0)
    heard = np.where(np.abs(seen.bemf) < 25.0, 0.0, seen.bemf)
    clock = find_sample_clock(TIME, count_by_ticks(TIME, heard, seen.position, TICK), (172.0, 199.0))
    assert clock is not None
    even = resample_wheel_to_one_age(clock, TIME, heard, seen.position, TICK, zone=25.0)
    assert (even[heard == 0.0] == 0.0).all()
    assert np.abs(even[heard != 0.0]).min() >= 25.0


CLOCK = SampleClock(0.005, np.array([0.0, 1.0]), np.array([0.002, 0.002]), lead=0.001)
"""Commands come into force 1 ms after the row's start, in each."""


def test_a_command_has_what_its_row_leaves_it() -> None:
    time = rows_of(6)
    duty = np.array([0.0, 0.0, 0.8, 0.8, 0.8, 0.8])
    mean, closed = CLOCK.in_force(time, duty, np.ones(6))
    assert mean == pytest.approx([0.0, 0.0, 0.8 * 0.8, 0.8, 0.8, 0.8])
    assert closed == pytest.approx(np.ones(6))


def test_a_row_in_part_of_which_a_motor_coasts_is_driven_in_the_rest() -> None:
    time = rows_of(6)
    duty = np.array([0.5, 0.5, 0.0, 0.0, -0.6, -0.6])
    mean, closed = CLOCK.in_force(time, duty, (duty != 0.0).astype(float))
    assert closed == pytest.approx([1.0, 1.0, 0.2, 0.0, 0.8, 1.0])
    assert mean == pytest.approx([0.5, 0.5, 0.5, 0.0, -0.6, -0.6])


def test_some_commands_come_into_force_more_often_than_samples_are_taken() -> None:
    often = SampleClock(0.005, np.array([0.0, 1.0]), np.array([0.002, 0.002]), waits=4, lead=0.001)
    taken = often.times_in_force(np.array([0.0, 0.0011, 0.0024, 0.0049]))
    assert taken == pytest.approx([0.001, 0.00225, 0.0035, 0.006])


@given(
    st.lists(st.integers(-4, 4), min_size=8, max_size=40),
    st.floats(0.0, 0.006),
    st.floats(0.0037, 0.0062),
)
def test_no_command_is_lost_or_added(levels: list[int], phase: float, period: float) -> None:
    """What all commands give together is what they gave, but for those that a later one overtook."""
    duty = np.array([*levels, 0, 0, 0, 0], float) / 4.0
    time = rows_of(len(duty))
    clock = SampleClock(period, time[[0, -1]], np.array([phase, phase]))
    mean, closed = clock.in_force(time, duty, np.ones(len(duty)))
    moments = clock.times_in_force(time)
    given_out = np.diff(np.append(moments, moments[-1] + ROW)) @ duty
    early = duty[0] * (moments[0] - time[0])
    assert ROW * (mean @ closed) == pytest.approx(given_out + early, abs=1e-9)
    assert (np.abs(mean) <= 1.0).all()
    assert ((closed >= 0.0) & (closed <= 1.0)).all()
