"""A wheel at rest whose back-EMF has an offset ticks on, and that is no sign of a dead sensor."""

import pytest

from raccoon.estimate.drive.wheel_track import WheelTrack

TICK = 0.003
OFFSET = 50 * TICK  # rad/s: the counter ticks every fourth cycle


def test_an_offset_at_rest_is_not_taken_for_a_dead_back_emf() -> None:
    wheel = WheelTrack(0.0225)
    counted = 0.0
    for cycle in range(2000):
        before, counted = counted, (cycle + 1) * OFFSET * 0.005 // TICK * TICK
        wheel.update(0.005, 0.0, counted - before - OFFSET * 0.005)
        assert wheel.stuck_source == ""
    assert wheel.has_bemf


@pytest.mark.parametrize("fraction", [0.9, -0.9])
def test_words_cut_to_whole_counts_are_no_dead_counter_however_long_it_waits(fraction: float) -> None:
    """The counter keeps the fractions that each word loses; ten minutes are a long wait for a start."""
    wheel = WheelTrack(0.0276)
    for _ in range(30_000):
        wheel.update(0.02, -fraction * TICK, 0.0)
        assert wheel.stuck_source == ""


def test_a_look_between_two_updates_of_the_back_emf_loses_nothing() -> None:
    """The stock firmware has a new word every 4.3 ms. Who looks every 2 ms sees counters that stand, too."""
    wheel = WheelTrack(0.0225)
    turned = 0.0
    for cycle in range(1000):
        fresh = cycle % 2 == 1
        wheel.update(0.002, 4.0 if fresh else None, 4.0 * 0.004 if fresh else 0.0)
        turned += wheel.increment
        assert wheel.stuck_source == ""
    assert wheel.has_bemf
    assert wheel.speed == pytest.approx(4.0)
    assert turned == pytest.approx(4.0 * 2.0, abs=0.02)


def test_a_back_emf_that_stands_while_the_counter_goes_is_dead() -> None:
    wheel = WheelTrack(0.0225)
    for _ in range(40):
        wheel.update(0.005, 0.0, 4.0 * 0.005)
    assert wheel.stuck_source == "back-EMF"


def test_a_counter_that_jumps_again_and_again_is_not_taken_for_one_that_stands() -> None:
    wheel = WheelTrack(0.0225)
    for cycle in range(400):
        jumped = cycle % 4 == 0
        if jumped:
            wheel.take_counter_jump(0.005)
        wheel.update(0.005, None if jumped else 5.0, None if jumped else 0.025 * (cycle % 4 != 1))
        assert wheel.stuck_source == ""
