"""Counters that wrap and tear."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.hal.wombat.firmware.counters import Counters

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
    assert counters.are_plausible(counters.differences((0, jump, 0, 0)), 0.005) is plausible


def test_two_looks_within_an_update_may_see_all_of_it() -> None:
    counters = Counters(100_000.0)
    assert counters.are_plausible((1200, 0, 0, 0), 0.0002)
    assert not counters.are_plausible((1201, 0, 0, 0), 0.0002)


def test_continuing_from_new_words_moves_nothing() -> None:
    counters = Counters(470_000.0)
    counters.continue_from((100, 0, 0, 0))
    counters.accept((150, 0, 0, 0), (50, 0, 0, 0))
    counters.continue_from((0, 0, 0, 0))
    assert counters.totals == [50, 0, 0, 0]
    assert counters.differences((7, 0, 0, 0)) == (7, 0, 0, 0)
