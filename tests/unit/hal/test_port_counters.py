"""Counters that wrap and tear, and the back-EMF that is taken out of them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.hal.wombat.counters import CounterRate, Counters, StockBemf
from raccoon.hal.wombat.dialect import Reading
from raccoon.hal.wombat.stock_dialect import StockDialect

INT32 = st.integers(-0x8000_0000, 0x7FFF_FFFF)
STEP = st.integers(-4000, 4000)


def wrapped(value: int) -> int:
    return (value + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000


@given(st.tuples(*[INT32] * 4), st.lists(st.tuples(*[STEP] * 4), max_size=20))
def test_positions_go_on_over_any_number_of_wraps(
    start: tuple[int, ...], steps: list[tuple[int, int, int, int]]
) -> None:
    counters = Counters(470_000.0)
    counters.continue_from(start)
    true = list(start)
    for step in steps:
        true = [old + new for old, new in zip(true, step, strict=True)]
        words = [wrapped(each) for each in true]
        differences = counters.differences(words)
        assert differences == step
        counters.accept(words, differences)
    assert counters.totals == [now - first for now, first in zip(true, start, strict=True)]


@pytest.mark.parametrize(
    ("jump", "plausible"), [(4000, True), (-4000, True), (65536, False), (-65536, False)]
)
def test_a_torn_upper_half_is_not_plausible(jump: int, plausible: bool) -> None:
    counters = Counters(470_000.0)
    counters.continue_from((0, 0, 0, 0))
    assert counters.plausible(counters.differences((0, jump, 0, 0)), 0.005) is plausible


def test_continuing_from_new_words_moves_nothing() -> None:
    counters = Counters(470_000.0)
    counters.continue_from((100, 0, 0, 0))
    counters.accept((150, 0, 0, 0), (50, 0, 0, 0))
    counters.continue_from((0, 0, 0, 0))
    assert counters.totals == [50, 0, 0, 0]
    assert counters.differences((7, 0, 0, 0)) == (7, 0, 0, 0)


def test_one_difference_is_one_filtered_reading_made_up_for_truncation() -> None:
    bemf = StockBemf(235.0)
    bemf.update((400, -400, 0, 0), 0.0025)
    assert bemf.fresh
    assert bemf.value == (401.5, -401.5, 0.0, 0.0)
    assert bemf.shortfall == [1.5, -1.5, 0.0, 0.0]


def test_no_difference_soon_after_motion_is_no_news() -> None:
    bemf = StockBemf(235.0)
    bemf.update((400, 0, 0, 0), 0.0025)
    bemf.update((0, 0, 0, 0), 0.0025)
    assert not bemf.fresh
    for _ in range(4):
        bemf.update((0, 0, 0, 0), 0.0025)
    # The filter cannot fall to 0 like that: the firmware's loop stands still.
    assert not bemf.fresh
    assert bemf.overdue


def test_a_slow_motor_may_stop_at_once() -> None:
    bemf = StockBemf(235.0)
    bemf.update((12, 0, 0, 0), 0.0025)
    bemf.update((0, 0, 0, 0), 0.0025)
    bemf.update((0, 0, 0, 0), 0.0035)
    assert bemf.fresh
    assert bemf.value == (0.0, 0.0, 0.0, 0.0)
    assert not bemf.overdue


def test_a_motor_that_is_driven_back_may_stop_at_once() -> None:
    bemf = StockBemf(235.0)
    bemf.update((15, -13, 0, 0), 0.0025)
    for _ in range(5):
        bemf.update((0, 0, 0, 0), 0.0025)
        assert not bemf.overdue
    assert bemf.value == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("updates", [2, 3, 7])
def test_a_late_look_counts_the_updates_it_missed(updates: int) -> None:
    bemf = StockBemf(235.0)
    for _ in range(5):
        bemf.update((400, 0, 0, 0), 1 / 235)
    bemf.update((400 * updates, 0, 0, 0), (updates + 0.3) / 235)
    assert bemf.value[0] == 401.5
    assert bemf.shortfall[0] == 1.5 * (5 + updates)


@pytest.mark.parametrize("updates", [2, 3])
@pytest.mark.parametrize("believed", [200, 600, 800])
def test_a_speed_that_was_taken_wrong_does_not_stay_so(updates: int, believed: int) -> None:
    """By size alone three updates of 400 were two of 600, for ever."""
    bemf = StockBemf(235.0)
    bemf.update((believed, 0, 0, 0), 1 / 235)
    for _ in range(10):
        bemf.update((400 * updates, 0, 0, 0), (updates - 0.06) / 235)
    assert bemf.value[0] == 401.5


def test_two_updates_in_little_more_than_the_time_of_one_are_two() -> None:
    bemf = StockBemf(235.0)
    bemf.update((400, 0, 0, 0), 1 / 235)
    for _ in range(5):  # looks of 1.5 periods meet one and two updates in turn
        bemf.update((400, 0, 0, 0), 1.45 / 235)
        assert bemf.value[0] == 401.5
        bemf.update((800, 0, 0, 0), 1.45 / 235)
        assert bemf.value[0] == 401.5


def test_rates_need_motion() -> None:
    bemf, rate = StockBemf(235.0), CounterRate()
    for _ in range(200):
        bemf.update((0, 0, 0, 0), 0.0025)
        rate.update((0, 0, 0, 0), (0.0,) * 4, 0.005)
    assert bemf.rate_hz is None
    assert rate.rate_hz is None
    for _ in range(200):
        bemf.update((400, 0, 0, 0), 1 / 250)
        rate.update((400 * 9, 0, 0, 0), (400.0, 0.0, 0.0, 0.0), 0.05)
    assert bemf.rate_hz == pytest.approx(250.0)
    assert rate.rate_hz == pytest.approx(180.0)


@pytest.mark.parametrize(
    ("first", "second", "seconds", "torn"),
    [
        (400, 400, 0.0002, False),
        (400, 790, 0.0002, False),  # an update fell between the looks
        (-400, -1150, 0.005, False),
        (0, 90, 0.0002, False),  # it starts
        (656, 400, 0.0002, True),
        (400, 144, 0.005, True),
        (20, 276, 0.0002, True),
    ],
)
def test_counters_that_count_on_between_two_looks_are_not_torn(
    first: int, second: int, seconds: float, torn: bool
) -> None:
    assert StockDialect().torn((0, first, 0, 0), (0, second, 0, 0), seconds) is torn


def test_two_updates_in_one_look_deserve_no_second_one() -> None:
    dialect = StockDialect(250.0)
    frame = Reading(b"", (), (0, 0, 0, 0), 0)
    dialect.bemf(frame, (0, 600, 0, 0), 0.004)
    assert not dialect.suspicious((0, 1190, 0, 0), 0.005)
    assert dialect.suspicious((0, 1190, 0, 0), 0.004)
    assert dialect.suspicious((0, 600 + 256, 0, 0), 0.005)
