"""A wheel at rest whose back-EMF has an offset ticks on, and that is no sign of a dead sensor."""

from raccoon.estimate.drive.wheel_track import WheelTrack

TICK = 0.003
OFFSET = 50 * TICK  # rad/s: the counter ticks every fourth cycle


def test_an_offset_at_rest_is_not_taken_for_a_dead_back_emf() -> None:
    wheel = WheelTrack(0.0225)
    counted = 0.0
    for cycle in range(2000):
        before, counted = counted, (cycle + 1) * OFFSET * 0.005 // TICK * TICK
        wheel.update(0.005, 0.0, counted - before - OFFSET * 0.005)
        assert wheel.stuck == ""
    assert wheel.fine


def test_a_back_emf_that_stands_while_the_counter_goes_is_dead() -> None:
    wheel = WheelTrack(0.0225)
    for _ in range(40):
        wheel.update(0.005, 0.0, 4.0 * 0.005)
    assert wheel.stuck == "back-EMF"
