"""The back-EMF that is taken out of the stock firmware's counters."""

import pytest

from raccoon.hal.wombat.firmware.stock.bemf import StockBemf


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
@pytest.mark.parametrize("sign", [1, -1])
def test_a_late_look_counts_the_updates_it_missed(updates: int, sign: int) -> None:
    """Also where the time has room for one more, by the size."""
    bemf = StockBemf(235.0)
    for _ in range(5):
        bemf.update((sign * 400, 0, 0, 0), 1 / 235)
    bemf.update((sign * 400 * updates, 0, 0, 0), (updates + 0.6) / 235)
    assert bemf.value[0] == sign * 401.5
    assert bemf.shortfall[0] == sign * 1.5 * (5 + updates)


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


def test_a_rate_needs_motion() -> None:
    bemf = StockBemf(235.0)
    for _ in range(200):
        bemf.update((0, 0, 0, 0), 0.0025)
    assert bemf.rate_hz is None
    for _ in range(200):
        bemf.update((400, 0, 0, 0), 1 / 250)
    assert bemf.rate_hz == pytest.approx(250.0)


def test_a_motor_that_stopped_while_nobody_looked_is_no_hanging_firmware() -> None:
    """A difference over a long time is the mean of it: what the wheel does by now it does not tell."""
    bemf = StockBemf(235.0)
    bemf.update((400, 400, 0, 0), 0.0025)
    bemf.update((200 * 100, 200 * 100, 0, 0), 1.0)
    assert bemf.fresh
    for _ in range(4):
        bemf.update((0, 0, 0, 0), 0.0025)
        assert not bemf.overdue
    assert bemf.fresh
    assert bemf.value == (0.0, 0.0, 0.0, 0.0)


def test_a_long_rest_is_no_part_of_the_motion_after_it() -> None:
    bemf = StockBemf(235.0)
    for _ in range(10_000):
        bemf.update((0, 0, 0, 0), 0.0025)
    assert bemf.fresh
    bemf.update((45, 0, 0, 0), 0.0025)
    assert bemf.value == (46.5, 0.0, 0.0, 0.0)
    assert bemf.shortfall == [1.5, 0.0, 0.0, 0.0]
